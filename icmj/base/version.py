"""The version, from the installed package's own metadata."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as installed

try:
    VERSION = installed("icmj")
except PackageNotFoundError:  # a source tree that is not installed
    VERSION = "0+unknown"
