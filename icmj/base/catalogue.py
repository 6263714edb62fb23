"""A catalogue: things of one kind, each in a module of its own, entered by a line, imported when asked for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType
from typing import Any


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

    def collect(self, attribute: str) -> tuple[Any, ...]:
        """What the modules have under this name, in their order; a module may lack it."""
        return tuple(getattr(module, attribute) for module in self if hasattr(module, attribute))
