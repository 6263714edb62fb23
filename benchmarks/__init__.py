"""Benchmarks: `python -m benchmarks --help`."""

from icmj.base.environment import one_thread

one_thread()  # as the command line does; BLAS reads it when numpy comes
