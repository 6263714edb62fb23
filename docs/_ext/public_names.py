"""``{public-names} part``: the public names of one part of icmj, and their data; ``{public-index}``: all of them.

A name finds its page by the folder of its home, so that a new one is documented as soon as it is public.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
import sys
from collections.abc import Iterator

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
    "measurement": ("measurement", "comparison", "experiments"),
    "sweeps": ("sweeps", "identification"),
    "people": ("fitting",),
    "logs": ("result", "log", "report", "study", "view"),
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
        names = [name for name in _all() if _part_of(_home(name)) == part]
        for name in sorted(names, key=lambda name: (not inspect.isclass(_public(name)), name.lower())):
            lines += _entry(f"icmj.{name}", _public(name))
        inside = list(_inside(names))
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
    """Every public name with the first sentence of its description."""

    def run(self) -> list[nodes.Node]:
        lines = [".. list-table::", "   :widths: 30 70", ""]
        for name in sorted(_all(), key=str.lower):
            lines += [f"   * - :py:obj:`{name} <icmj.{name}>`", f"     - {_sentence(_public(name))}"]
        holder = nodes.section()
        holder.document = self.state.document
        wrapped = ["```{eval-rst}", *lines, "```"]
        self.state.nested_parse(StringList(wrapped, "public index"), self.content_offset, holder, match_titles=True)
        return holder.children


def _sentence(thing: object) -> str:
    first = " ".join((inspect.getdoc(thing) or "").partition("\n\n")[0].split())
    return re.split(r"(?<=[.])\s+(?=[A-Z`])|:$", first)[0].replace("|", r"\|")  # not a substitution


def _entry(path: str, thing: object) -> list[str]:
    if inspect.isclass(thing):
        # a table of a run file is explained on a page of its own
        deep = [] if hasattr(thing, "model_fields") else ["   :members:"]
        return [f".. autoclass:: {path}", *deep, ""]
    return [f".. autofunction:: {path}", ""]


def _inside(names: list[str]) -> Iterator[type]:
    """Dataclasses that share a module with a public name, and are not public themselves."""
    public = {id(_public(name)) for name in _all()}
    for home in dict.fromkeys(_home(name) for name in names):
        for each in vars(sys.modules[home]).values():
            own = (
                inspect.isclass(each)
                and dataclasses.is_dataclass(each)
                and each.__module__ == home
                and id(each) not in public
            )
            if own and not each.__name__.startswith("_"):
                yield each


def _all() -> list[str]:
    import icmj

    # a public module has a page of its own
    return [name for name in icmj.__all__ if not inspect.ismodule(getattr(icmj, name))]


def _public(name: str) -> object:
    import icmj

    return getattr(icmj, name)


def _home(name: str) -> str:
    return _public(name).__module__


def _part_of(module: str) -> str:
    folder = module.split(".")[1]
    return next((part for part, folders in PARTS.items() if folder in folders), OTHERS)


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the directive to Sphinx."""
    app.add_directive("public-names", PublicNames)
    app.add_directive("public-index", PublicIndex)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
