"""``{public-names} part``: the public names of one part of icmj, and their data; ``{public-index}``: all of them.

A name finds its page by its home, so that a new one is documented as soon as it is public. Its path is
``icmj.NAME``, or ``icmj.ROOM.NAME`` where a room has it.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

PARTS: dict[str, tuple[str, ...]] = {
    "plants": ("plant", "engine"),
    "controllers": ("controller",),
    "theory": ("theory",),
    "simulation": ("case", "simulation", "linear"),
    "cycles": ("cycle",),
    "measurement": ("measurement", "case.comparison", "experiments"),
    "sweeps": ("study.sweep", "identification"),
    "people": ("fits",),
    "logs": ("case.result", "log", "report", "study"),
    "run-files": ("runfile",),
    "series": ("series",),
}
OTHERS = "others"  # whatever lives elsewhere


class PublicNames(SphinxDirective):
    """One part's names, functions after classes, then the data inside."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        part = self.arguments[0]
        lines: list[str] = []
        things = {path: thing for path, thing in surface().items() if _part_of(thing.__module__) == part}
        for path in sorted(things, key=lambda path: (not inspect.isclass(things[path]), _name(path).lower())):
            lines += _entry(path, things[path])
        inside = list(_inside(things.values()))
        if inside:
            lines += [".. rubric:: Data inside", ""]
            for thing in inside:
                lines += _entry(f"{thing.__module__}.{thing.__qualname__}", thing)
        if not lines:
            return []
        holder = nodes.section()
        holder.document = self.state.document
        wrapped = ["```{eval-rst}", *lines, "```"]
        self.state.nested_parse(StringList(wrapped, "public names"), self.content_offset, holder, match_titles=True)
        return holder.children


class PublicIndex(SphinxDirective):
    """Every public name with the first sentence of its description: those of icmj, then room by room."""

    def run(self) -> list[nodes.Node]:
        lines: list[str] = []
        for home, room in _homes().items():
            said = "What people meet first." if home == "icmj" else _sentence(room).replace(r"\|", "|")
            lines += [f"### {home}", "", said, ""]
            lines += ["```{eval-rst}", ".. list-table::", "   :widths: 30 70", ""]
            for name in sorted(_names(room), key=str.lower):
                said = _sentence(getattr(room, name))
                lines += [f"   * - :py:obj:`{name} <{home}.{name}>`", f"     - {said}"]
            lines += ["```", ""]
        holder = nodes.section()
        holder.document = self.state.document
        self.state.nested_parse(StringList(lines, "public index"), self.content_offset, holder, match_titles=True)
        return holder.children


def _sentence(thing: object) -> str:
    first = " ".join((inspect.getdoc(thing) or "").partition("\n\n")[0].split())
    return re.split(r"(?<=[.])(?<!eqs[.])\s+(?=[A-Z`])|:$", first)[0].replace("|", r"\|")  # not a substitution


def _entry(path: str, thing: object) -> list[str]:
    if inspect.isclass(thing):
        # a table of a run file is explained on a page of its own
        deep = [] if hasattr(thing, "model_fields") else ["   :members:"]
        return [f".. autoclass:: {path}", *deep, ""]
    return [f".. autofunction:: {path}", ""]


def _inside(things: Iterable[Any]) -> Iterator[type]:
    """Dataclasses that share a module with a public name, and are not public themselves."""
    public = {id(thing) for thing in surface().values()}
    for home in dict.fromkeys(thing.__module__ for thing in things):
        for each in vars(sys.modules[home]).values():
            own = (
                inspect.isclass(each)
                and dataclasses.is_dataclass(each)
                and each.__module__ == home
                and id(each) not in public
            )
            if own and not each.__name__.startswith("_"):
                yield each


@cache
def surface() -> dict[str, Any]:
    """Every public class and function by its path."""
    return {f"{home}.{name}": getattr(room, name) for home, room in _homes().items() for name in _names(room)}


def _homes() -> dict[str, Any]:
    """icmj and its rooms; a room that is a single module has a page of its own."""
    import icmj

    rooms = {f"icmj.{name}": getattr(icmj, name) for name in icmj.__all__}
    return {"icmj": icmj} | {path: room for path, room in rooms.items() if hasattr(room, "__path__")}


def _names(room: Any) -> list[str]:
    return [name for name in room.__all__ if not inspect.ismodule(getattr(room, name))]


def _name(path: str) -> str:
    return path.rpartition(".")[2]


def _part_of(module: str) -> str:
    """The page of a module, or else of its folder."""
    place = module.partition(".")[2]
    of = {home: part for part, homes in PARTS.items() for home in homes}
    return of.get(place) or of.get(place.split(".")[0], OTHERS)


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the directive to Sphinx."""
    app.add_directive("public-names", PublicNames)
    app.add_directive("public-index", PublicIndex)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
