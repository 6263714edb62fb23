"""The words of a command line: the command that they ask for, or one line that says what was probably meant.

The parser of a command is made of the class of its arguments.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import MISSING, is_dataclass
from types import NoneType
from typing import Any, Literal, NoReturn, get_args, get_origin

from icmj.base.docstrings import read_attribute_docstrings
from icmj.base.similar_names import suggest
from icmj.base.text import one_line
from icmj.cli.arguments import Command, Given, list_arguments, name_option
from icmj.cli.commands import COMMANDS
from icmj.errors import IcmjError

COMPLETION = "--print-completion"


class Parser(argparse.ArgumentParser):
    """A parser whose errors are those of icmj."""

    def error(self, message: str) -> NoReturn:
        """One line, with the command and where its help is."""
        raise IcmjError(f"{self.prog.removeprefix('icmj ')}: {message}; see {self.prog} --help")


def parse(words: list[str]) -> Command:
    """The command that the words of a command line ask for.

    Raises:
        IcmjError: one line that says what is wrong with them.
        SystemExit: with status 0, where help was asked for and shown.
    """
    name, *rest = words
    if name.startswith("-"):
        raise IcmjError(f"icmj has no option {_suggest(name, ['--help', '--version', COMPLETION])}; see icmj --help")
    if name not in COMMANDS.names:
        hint = suggest(name, COMMANDS.names) or f"; there are {', '.join(COMMANDS.names)}"
        raise IcmjError(f"no command {name!r}{hint}; see icmj --help")
    cls: type[Command] = COMMANDS[name].COMMAND.complete()
    parser = Parser(f"icmj {name}", **STYLE)
    helped = any(word == "--help" or (word[:1] == "-" != word[1:2] and "h" in word) for word in rest)
    options = ["--help", *fill(parser, cls, helped)]

    def refuse(option: str) -> NoReturn:
        raise IcmjError(f"{name} has no option {_suggest(option, options)}; see icmj {name} --help")

    end = rest.index("--") if "--" in rest else len(rest)
    for i, word in enumerate(rest[:end]):
        option, equals, value = word.partition("=")
        if word.startswith("--"):
            if (hyphened := option.replace("_", "-")) not in options:
                refuse(option)
            rest[i] = f"{hyphened}{equals}{value}"
    # what stands after -- is no option; intermixed arguments do not know it
    found, more = (parser.parse_known_args if "--" in rest else parser.parse_known_intermixed_args)(rest)
    if more and more[0].startswith("-"):
        refuse(more[0])
    if more:
        parser.error(f"one argument too many, {one_line(more[0], 80)}")
    values = {key: tuple(each) if isinstance(each, list) else each for key, each in vars(found).items()}
    command: Callable[..., Command] = cls
    return command(**values)


def _suggest(option: str, known: Sequence[str]) -> str:
    return f"{one_line(option, 80)}{suggest(option, known)}"


def fill(parser: argparse.ArgumentParser, cls: type[Command], helped: bool, files: object = None) -> list[str]:
    """Give a parser the arguments of a command, and its help; returns the names of the options.

    Args:
        parser: to be filled.
        cls: the class of the command.
        helped: whether its help is needed, too, which is read from the source.
        files: what completion for a shell offers where a path is expected.
    """
    parser.description = "\n\n".join(
        textwrap.fill(" ".join(words.split()), shutil.get_terminal_size().columns - 2)
        for words in (cls.__doc__ or "").split("\n\n")
    )
    meanings: dict[str, str] = {}
    for owner in filter(is_dataclass, reversed(cls.__mro__)) if helped else ():
        if vars(sys.modules[owner.__module__]).get(owner.__name__) is owner:  # not one that was extended
            meanings |= read_attribute_docstrings(owner)
    general = parser.add_argument_group("general options")
    names = []
    for field, kind, given in list_arguments(cls):
        kind = next((each for each in get_args(kind) if NoneType in get_args(kind)), kind)
        default = cls.__dataclass_fields__[field].default
        how = _describe_values(kind, given)
        note = "required" if default is MISSING else f"default: {default}"
        meaning = (given.meaning or meanings.get(field, "")) + ("" if default in (None, False, ()) else f" ({note})")
        how["help"] = meaning.replace("%", "%%")
        if given.positional:
            if default is not MISSING:
                how = {"nargs": "?", "default": default} | how
            action = parser.add_argument(field, **how)
        else:
            names.append(name_option(field, given))
            place = general if field in Command.__dataclass_fields__ else parser
            flags = [given.short, names[-1]] if given.short else names[-1:]
            action = place.add_argument(*flags, dest=field, required=default is MISSING, **how)
        if how.get("metavar") in _PATHS:
            action.complete = files  # type: ignore[attr-defined]
    return names


def _describe_values(kind: Any, given: Given) -> dict[str, Any]:
    """How argparse reads the values of an argument, and shows them."""
    if kind is bool:
        return {"action": "store_true"}
    how: dict[str, Any] = {}
    if get_origin(kind) is tuple:
        kind, *others = get_args(kind)
        open_end = others == [...]
        how = {"action": "append"} if given.repeated else {"nargs": "*" if open_end else 1 + len(others)}
        if given.positional:
            how["default"] = ()
    if get_origin(kind) is Literal:
        return how | {"choices": get_args(kind), "type": _choose(get_args(kind))}
    name = "NAME" if how and kind is str else kind.__name__.upper()
    if given.writes is not None:
        name = "FILE" if given.writes else "FOLDER"
    return how | {"metavar": given.metavar or name, "type": _NUMBERS.get(kind, kind)}


def _choose(known: tuple[str, ...]) -> Callable[[str], str]:
    def choose(word: str) -> str:
        if word not in known:
            hint = suggest(word, known)
            raise argparse.ArgumentTypeError(f"expected {' or '.join(sorted(known))}, got {word!r}{hint}")
        return word

    return choose


def _read_number(kind: type[int] | type[float], words: str) -> Callable[[str], float]:
    def read(word: str) -> float:
        try:
            return kind(word)
        except ValueError:
            raise argparse.ArgumentTypeError(f"expected {words}, got {one_line(repr(word), 80)}") from None

    return read


_NUMBERS = {int: _read_number(int, "a whole number"), float: _read_number(float, "a number")}
_PATHS = ("PATH", "FILE", "FOLDER")
STYLE: dict[str, Any] = {
    "allow_abbrev": False,
    "argument_default": argparse.SUPPRESS,
    "formatter_class": argparse.RawDescriptionHelpFormatter,
}
