"""Import control for the command line: unused libraries are not imported, and late ones are imported in the background.

This applies to the command line only: a program that imports icmj gets all libraries unchanged.
"""

from __future__ import annotations

import ast
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from types import ModuleType
from typing import Any, get_origin

_IDLE = ("numpy.f2py", "numpy.ma", "numpy.random", "numpy.testing", "yaml", "PIL.Image")
"""What libraries import at their start and use, if at all, when asked to: a tenth of what a run imports."""
_SHOPS = (
    *(f"rerun{part}" for part in ("", ".archetypes", ".components", ".encodings", ".catalog", ".chunk", ".blueprint")),
    *(f"rerun.blueprint.{part}" for part in ("archetypes", "components", "encodings", "views")),
)
"""Packages that import each of their many modules to offer its names, of which a log needs one in four."""


class _Later:
    """Finds modules that are loaded when something is taken from them, and packages whose names are."""

    def __init__(self, names: Sequence[str], shops: Sequence[str]) -> None:
        self._names, self._shops = frozenset(names), frozenset(shops)

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The module's own specification, with a loader that waits."""
        if fullname not in self._names | self._shops:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is None or spec.loader is None:
            return spec
        if fullname in self._names:
            from importlib.util import LazyLoader

            spec.loader = LazyLoader(spec.loader)
        elif type(spec.loader) is SourceFileLoader:
            spec.loader = _Shop(spec.loader.name, spec.loader.path)
        return spec


class _Shop(SourceFileLoader):
    """Loads a package without what it imports from its own modules only to offer it: that is imported when asked for.

    What the package's code uses itself is imported with it, as ever.
    """

    def exec_module(self, module: ModuleType) -> None:
        """Execute the package's code without those imports; ``__getattr__`` of the module makes up for them."""
        tree = ast.parse(self.get_data(self.path))
        used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} | {"*"}
        offered: dict[str, tuple[str, str]] = {}
        for node in [node for node in tree.body if isinstance(node, ast.ImportFrom) and node.level == 1]:
            here = [alias for alias in node.names if (alias.asname or alias.name) in used]
            for alias in node.names:
                if alias not in here:
                    of, name = (f".{node.module}", alias.name) if node.module else (f".{alias.name}", "")
                    offered[alias.asname or alias.name] = of, name
                    if node.module:  # which importing from it leaves there, too, if nothing else has this name
                        module_name = node.module.partition(".")[0]
                        offered.setdefault(module_name, (f".{module_name}", ""))
            node.names = here
            if not here:
                tree.body.remove(node)
        own: list[Any] = []

        def ask(name: str) -> Any:
            if name not in offered:
                if own:
                    return own[0](name)
                raise AttributeError(f"module {module.__name__!r} has no attribute {name!r}", name=name, obj=module)
            of, attribute = offered[name]
            found = import_module(of, module.__name__)
            value = getattr(found, attribute) if attribute else found
            setattr(module, name, value)
            return value

        space = module.__dict__
        space["__getattr__"] = ask  # before: its modules may import each other by way of it
        exec(compile(tree, self.path, "exec", dont_inherit=True), space)
        if space["__getattr__"] is not ask:
            own.append(space["__getattr__"])
            space["__getattr__"] = ask


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
        sys.meta_path.insert(0, _Later(_IDLE, _SHOPS))


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
