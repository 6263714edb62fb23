"""Import control for the command line: unused libraries are not imported, and late ones are imported in the background.

This applies to the command line only: a program that imports icmj gets all libraries unchanged.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any, get_origin

_IDLE = (
    *("numpy.f2py", "numpy.testing", "rerun.catalog", "rerun.experimental", "rerun.server", "rerun.urdf"),
    *("yaml", "PIL.Image"),
)
"""What libraries import at their start and use, if at all, when asked to: a tenth of what a run imports."""


class _Later:
    """Finds modules that are loaded when something is taken from them, and not before."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = frozenset(names)

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The module's own specification, with a loader that waits."""
        if fullname not in self._names:
            return None
        from importlib.util import LazyLoader

        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.loader is not None:
            spec.loader = LazyLoader(spec.loader)
        return spec


class _Without:
    """Hides a library from the thread that makes this, until it is told to hide nothing any more.

    It stays in ``sys.meta_path``: another thread that goes through the list as one is taken out misses the next finder,
    and does not find a module that is there.
    """

    def __init__(self, name: str) -> None:
        self._name, self._thread, self.hides = name, threading.get_ident(), True

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Nothing, or an error of a module that is not there."""
        if self.hides and fullname == self._name and threading.get_ident() == self._thread:
            raise ModuleNotFoundError(f"No module named {fullname!r}", name=fullname)
        return None


@contextmanager
def unguarded() -> Iterator[None]:
    """Let tyro see by its kind alone whether a default has the type that it is declared with.

    Of tuples it would ask typeguard, whose import takes as long as tyro's own.
    """
    if "typeguard" in sys.modules:
        yield
        return
    guard: Any = ModuleType("typeguard")
    guard.check_type, guard.TypeCheckError = _expect_kind, TypeError
    sys.modules["typeguard"] = guard
    try:
        yield
    finally:
        del sys.modules["typeguard"]


def _expect_kind(value: object, kind: Any) -> None:
    if not isinstance(value, get_origin(kind) or kind):
        raise TypeError(f"{value!r} is no {kind}")


def unhurried() -> None:
    """Defer modules that libraries import when they are loaded and that icmj does not need."""
    if not any(isinstance(finder, _Later) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Later(_IDLE))


def arrow_alone() -> None:
    """Load pyarrow so that it never looks for pandas, which it would import to see whether it is given a table of it.

    Tables of pandas it then does not know; icmj gives it none.
    """
    if "pyarrow" in sys.modules or "pandas" in sys.modules:
        return
    hiding = _Without("pandas")
    sys.meta_path.insert(0, hiding)
    try:
        import_module("pyarrow").array([0])  # it looks once, and remembers
    finally:
        hiding.hides = False


def meanwhile(name: str) -> None:
    """Import a module that is needed later, in a separate thread, while compiled code computes.

    Whoever imports it then waits for it; what goes wrong with it shows there.
    """

    def load() -> None:
        with suppress(Exception):
            arrow_alone()
            import_module(name)

    threading.Thread(target=load, name=f"import {name}", daemon=True).start()
