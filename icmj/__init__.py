"""icmj: event-driven intermittent control, from linear eigen-analysis to a standing human in MuJoCo."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("icmj")
except PackageNotFoundError:  # a source tree that is not installed
    __version__ = "0+unknown"
