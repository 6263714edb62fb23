"""Code of the user's own, named ``module:name`` in a run file or a log, and run only where that was asked for.

The module is a file in the folder of the run file, or one that is installed. Reading a file never runs code; who calls
says so, by ``--allow-code`` or in Python.
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import importlib.util
import inspect
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from icmj.base.array import Array
from icmj.base.files import read_bytes
from icmj.base.text import one_line
from icmj.errors import IcmjError, RunFileError

REFERENCE = r"^[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*$"
"""What names code: a module, a colon, and a name in it."""
MOST_BYTES = 10_000_000  # of a source file
_ORIGIN = "__icmj_module__"  # of a module from a folder: its name there

Fact = bool | int | float | str | Array | None
"""A parameter as a log keeps it."""


@dataclass(frozen=True)
class Code:
    """The folder in which code is sought, and whether it may be executed.

    Attributes:
        folder: folder of the run file; modules in it take precedence over installed ones.
        allowed: whether the user has allowed it.
    """

    folder: Path
    allowed: bool = False

    def find(self, reference: str) -> Any:
        """The object that ``module:name`` names.

        Raises:
            RunFileError: if code is not allowed, or there is no such module or name, or importing it fails.
        """
        if not self.allowed:
            raise RunFileError(
                f"{reference} names Python code, which is not run unasked; read it, then add --allow-code (in Python, "
                "allow_code=True)"
            )
        name, _, attribute = reference.partition(":")
        with guard(f"{reference}: importing it"):
            module = self._module(name)
            if hasattr(module, attribute):
                return getattr(module, attribute)
        raise RunFileError(f"{reference}: the module has no {attribute!r}")

    def make(self, reference: str, /, *arguments: Any, **parameters: Any) -> Any:
        """The result of ``module:name`` for these arguments and parameters, which may have any names.

        Raises:
            RunFileError: as :meth:`find`, or if it fails.
        """
        make = self.find(reference)
        with guard(reference):
            return make(*arguments, **parameters)

    def digest(self, reference: str) -> str:
        """SHA-256 of the source file in which ``module:name`` would be looked for, which is not run; "" if none."""
        name = reference.partition(":")[0]
        path = self._file(name)
        try:
            if not path.is_file():
                spec = importlib.util.find_spec(name)
                path = Path(spec.origin) if spec is not None and spec.origin else path
            return hashlib.sha256(read_bytes(path, MOST_BYTES)).hexdigest()
        except (ImportError, OSError, ValueError):
            return ""

    def sources(self, reference: str) -> tuple[Path, ...]:
        """Source files in the folder that ``module:name`` takes part in, by their import statements; none is run."""
        found: dict[Path, None] = {}
        left = [reference.partition(":")[0]]
        while left:
            name = left.pop()
            package = self.folder.joinpath(*name.split("."), "__init__.py")
            for path, inside in ((self._file(name), name.rpartition(".")[0]), (package, name)):
                if path in found or not path.is_file():
                    continue
                found[path] = None
                left += _imports(path, inside)
        return tuple(found)

    def _file(self, name: str) -> Path:
        return self.folder.joinpath(*name.split(".")).with_suffix(".py")

    def _module(self, name: str) -> ModuleType:
        path = self._file(name)
        if not path.is_file():
            return importlib.import_module(name)
        content = read_bytes(path, MOST_BYTES)
        # one name for one content: a file that was changed is another module, and two folders do not mix
        own = f"icmj_own_{hashlib.sha256(str(path.resolve()).encode() + content).hexdigest()[:16]}"
        if own in sys.modules:
            return sys.modules[own]
        spec = importlib.util.spec_from_file_location(own, path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        setattr(module, _ORIGIN, name)
        sys.modules[own] = module
        sys.path.insert(0, str(self.folder))  # it may import what lies beside it
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[own]
            raise
        finally:
            sys.path.remove(str(self.folder))
        return module


@contextmanager
def guard(what: str) -> Iterator[None]:
    """Within the block code of the user's own is at work: what it raises, or that it wants to exit, is its failure.

    Raises:
        RunFileError: in one line that begins with ``what``; errors of icmj are told as what they are.
    """
    try:
        yield
    except IcmjError as error:
        raise type(error)(f"{what}: {error}") from error
    except (Exception, SystemExit) as error:
        raise RunFileError(f"{what} fails ({_words(error)})") from error


def _imports(path: Path, package: str) -> Iterator[str]:
    """Names of the modules, and of what may be modules, that the source of one in ``package`` imports."""
    try:
        nodes = [*ast.walk(ast.parse(read_bytes(path, MOST_BYTES)))]
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):  # importing it fails, and says why
        return
    for node in nodes:
        given = [alias.name for alias in node.names] if isinstance(node, ast.Import | ast.ImportFrom) else []
        if isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            home = ".".join([*filter(None, above), *([node.module] if node.module else [])])
            given = [home, *(f"{home}.{name}".lstrip(".") for name in given)]
        for name in given:
            parts = name.split(".")
            yield from (".".join(parts[: i + 1]) for i in range(len(parts)) if parts[0])


def reference_of(thing: Any) -> str:
    """``module:name`` of a class, a function, or what a class has made."""
    kind = thing if isinstance(thing, type) or inspect.isroutine(thing) else type(thing)
    module = sys.modules.get(kind.__module__)
    return f"{getattr(module, _ORIGIN, kind.__module__)}:{kind.__qualname__}"


def folder_of(kind: type | Callable[..., Any]) -> Path | None:
    """The folder from whose files a class or a function was imported; ``None`` if its module is an installed one."""
    module = sys.modules.get(kind.__module__)
    name = getattr(module, _ORIGIN, None)
    return Path(str(getattr(module, "__file__", ""))).parents[name.count(".")] if name else None


def digest_of(thing: Any) -> str:
    """SHA-256 of the source file of a class, a function, or what a class has made; "" if there is none."""
    kind = thing if isinstance(thing, type) or inspect.isroutine(thing) else type(thing)
    try:
        source = inspect.getsourcefile(kind)
        return hashlib.sha256(read_bytes(Path(source), MOST_BYTES)).hexdigest() if source else ""
    except (OSError, TypeError):
        return ""


def pick_accepted(make: Callable[..., Any], parameters: Mapping[str, Any]) -> dict[str, Any]:
    """The ``parameters`` that ``make`` accepts by name."""
    try:
        known = inspect.signature(make).parameters
    except Exception:  # it has none, or the user's own, which may be anything
        return {}
    return {name: value for name, value in parameters.items() if name in known}


def plain(value: Any) -> Fact:
    """A parameter as a log has a place for it: numbers, text, arrays of numbers; else its text."""
    if isinstance(value, bool | int | float | str) or value is None:
        return value
    array = np.asarray(value)
    return array.astype(float) if array.dtype.kind in "fiub" else str(value)


def _words(error: BaseException) -> str:
    return one_line(f"{type(error).__name__}: {error}", 200)
