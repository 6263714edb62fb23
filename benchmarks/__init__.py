"""What the project costs, as ratios to something else measured in the same run; see ``python -m benchmarks --help``."""

import os

from icmj.base.blas_threads import set_one_thread
from icmj.base.process import collect_garbage_seldom

SHELL = dict(os.environ)
"""The environment that the benchmarks were started in, for what is measured as anybody starts it."""
# as the command line does; BLAS reads it when numpy comes
set_one_thread()
collect_garbage_seldom()
