"""A catalogue: things of one kind, each in a module of its own, entered by a line, imported when asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType
from typing import Any
from warnings import warn


@dataclass(frozen=True)
class Catalogue:
    """Modules of one package that each define a thing of one kind.

    Attributes:
        package: dotted name of the package.
        names: names of the modules in it, in the order in which people are told of them.
    """

    package: str
    names: tuple[str, ...]

    def __iter__(self) -> Iterator[ModuleType]:
        """The modules, each imported when it is its turn."""
        return (import_module(f"{self.package}.{name}") for name in self.names)

    def __getitem__(self, name: str) -> ModuleType:
        """The module of this name.

        Raises:
            KeyError: if there is none.
        """
        if name not in self.names:
            raise KeyError(name)
        return import_module(f"{self.package}.{name}")

    def collect(self, attribute: str) -> tuple[Any, ...]:
        """What the modules have under this name, in their order; a module may lack it."""
        return tuple(getattr(module, attribute) for module in self if hasattr(module, attribute))


def find_moved(module: str, name: str, moved: Mapping[str, str]) -> Any:
    """For a module's ``__getattr__``: what now lies elsewhere, with a warning that says where.

    Args:
        module, name: of which somebody asks for this.
        moved: the module in which each name that has moved is now.

    Raises:
        AttributeError: if it never was there.
    """
    if name not in moved:
        raise AttributeError(f"module {module!r} has no attribute {name!r}")
    warn(f"{module}.{name} is now {moved[name]}.{name}", DeprecationWarning, stacklevel=3)
    return getattr(import_module(moved[name]), name)
