"""What several commands take: mix-ins of their arguments, and how all options are shown in the help."""

from __future__ import annotations

from dataclasses import dataclass
from inspect import get_annotations
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import tyro


@dataclass(frozen=True, kw_only=True)
class General:
    """Options of every command."""

    quiet: Annotated[bool, tyro.conf.arg(aliases=("-q",))] = False
    """Print results and errors only, without progress and notes."""
    verbose: Annotated[bool, tyro.conf.arg(aliases=("-v",))] = False
    """Log every step to standard error, with the time."""


@dataclass(frozen=True, kw_only=True)
class Shared:
    """A command of the program."""

    general: tyro.conf.OmitArgPrefixes[General] = General()
    """Options of every command."""


@dataclass(frozen=True, kw_only=True)
class Overrides(Shared):
    """Values of the run file changed for once; :func:`icmj.runfile.overrides.overridden` puts them in."""

    set: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="KEY=VALUE")] = ()
    """Replace a value of the run file for this run, as in --set actual.gain=0.85. May be repeated."""
    allow_code: bool = False
    """Run Python code that the run file names as module:name. Read the code first."""


def annotate(cls: type) -> None:
    """Set how the help shows the options that ``cls`` adds: without the defaults None, empty and false."""
    hints = get_type_hints(cls, include_extras=True)
    for name in get_annotations(cls).keys() - {"general"}:
        shown = tyro.conf.arg(metavar=_metavar(hints[name]), help_behavior_hint=_default)
        cls.__annotations__[name] = Annotated[hints[name], shown]


def _default(label: str) -> str:
    return "" if label in ("", "None", "False") else f"(default: {label})"


def _metavar(hint: Any) -> str | None:
    """Placeholder for the value of an optional option; ``None`` if tyro's own placeholder is right."""
    while get_origin(hint) is Annotated:
        if given := [note.metavar for note in get_args(hint)[1:] if getattr(note, "metavar", None)]:
            return str(given[0])
        hint = get_args(hint)[0]
    if get_origin(hint) is tuple and get_args(hint)[1:] == (...,):
        return f"[{get_args(hint)[0].__name__.upper().replace('STR', 'NAME')} ...]"
    kinds = [kind for kind in get_args(hint) if kind is not NoneType]
    if get_origin(hint) not in (Union, UnionType) or len(kinds) != 1:
        return None
    if get_origin(kinds[0]) is tuple:
        return " ".join(kind.__name__.upper() for kind in get_args(kinds[0]))
    if get_origin(kinds[0]) is Literal:
        return f"{{{','.join(map(str, get_args(kinds[0])))}}}"
    return str(getattr(kinds[0], "__name__", "VALUE")).upper()
