"""What the project costs, as ratios to something else measured in the same run; see ``python -m benchmarks --help``."""

from icmj.base.environment import one_thread, seldom_collected

# as the command line does; BLAS reads it when numpy comes
one_thread()
seldom_collected()
