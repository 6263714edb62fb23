"""Parsing of the command line, with one-line error messages."""

from __future__ import annotations

import contextlib
import io
import re
import sys
import textwrap
from collections.abc import Callable
from functools import cache
from typing import Any, get_args, get_type_hints

import tyro

from icmj.base.process import skip_typeguard
from icmj.base.text import did_you_mean, one_line
from icmj.cli.arguments import DESCRIPTION, GROUPS, Command, General, annotate
from icmj.errors import IcmjError

_NUMBERS = {"INT": "a whole number", "int": "a whole number", "FLOAT": "a number", "float": "a number"}


def parse(words: list[str]) -> Command:
    """The command that the words of a command line ask for.

    Raises:
        IcmjError: one line that says what is wrong with them.
        SystemExit: with status 0, where help was asked for and shown.
    """
    classes = _classes()
    if not words[0].startswith("-") and words[0] not in classes:
        hint = did_you_mean(words[0], classes) or f"; there are {', '.join(classes)}"
        raise IcmjError(f"no command {words[0]!r}{hint}")
    command: Any = Command
    shown = io.StringIO()
    try:
        with contextlib.redirect_stderr(shown), skip_typeguard():
            return tyro.cli(command, prog="icmj", args=words, config=(tyro.conf.FlagCreatePairsOff,))
    except SystemExit as stop:
        if stop.code == 1 and not shown.getvalue():  # what rich makes of a reader that went away
            raise BrokenPipeError from None
        if stop.code in (0, None):
            with contextlib.suppress(OSError):  # nobody may listen
                sys.stderr.write(shown.getvalue())
            raise
        where = f"icmj {words[0]}" if words[0] in classes else "icmj"
        wrong = _in_words(_unbox(shown.getvalue()), words, classes)
        raise IcmjError(f"{wrong}; see {where} --help") from None


def overview() -> str:
    """The purpose of the program, and of each command in one sentence."""
    classes = _classes()
    lines = ["usage: icmj COMMAND [OPTIONS]", "", *textwrap.wrap(" ".join(DESCRIPTION.split()), 78)]
    for group, names in GROUPS.items():
        lines += ["", f"{group}:"]
        for name in names:
            purpose = " ".join((classes[name].__doc__ or "").partition("\n\n")[0].split())
            lines += textwrap.wrap(purpose, 78, initial_indent=f"  {name:<11}", subsequent_indent=" " * 13)
    more = (
        ("icmj COMMAND --help", "options of a command, with an example"),
        ("icmj --version", "version"),
        ("icmj --tyro-print-completion bash", "completion for the shell: bash, zsh or tcsh"),
    )
    lines += ["", *(f"{words:<36}{purpose}" for words, purpose in more)]
    return "\n".join([*lines, "", "Example: icmj study"])


@cache
def _classes() -> dict[str, type]:
    """The arguments of each command by its name, ready to be shown in the help."""
    classes = {}
    for member in get_args(Command):
        cls, *notes = get_args(member)
        classes[next(note.name for note in notes if hasattr(note, "name"))] = cls
    for shown in {owner for command in (*classes.values(), General) for owner in command.__mro__[:-1]}:
        annotate(shown)
    return classes


def _in_words(complaint: str, words: list[str], classes: dict[str, type]) -> str:
    """The parser's error message reworded; unchanged if no rule applies."""
    if complaint.startswith("Unrecognized"):
        return _unknown(complaint, words, classes)
    for pattern, say in _SAYINGS:
        if found := re.search(pattern, complaint):
            return say(*found.groups())
    return complaint


def _unknown(complaint: str, words: list[str], classes: dict[str, type]) -> str:
    command = words[0]
    cls: Any = classes.get(command)
    known = ["--help", *_options(cls)] if cls else ["--help", "--version"]
    for word in words:
        name = word.partition("=")[0]
        if name.startswith("-") and name.replace("_", "-") not in (*known, "-h"):
            return f"{command if cls else 'icmj'} has no option {one_line(name, 80)}{did_you_mean(name, known)}"
    return f"{command}: one argument too many, {complaint.partition(': ')[2]}"


def _options(cls: type) -> list[str]:
    """Options of a command, by the names that they have on the command line."""
    options = ["--quiet", "--verbose"]
    for name, hint in get_type_hints(cls, include_extras=True).items():
        if name == "general":
            continue
        given = (getattr(note, "name", None) for note in getattr(hint, "__metadata__", ()))
        options.append(f"--{next(filter(None, given), name).replace('_', '-')}")
    return options


def _missing(command: str, what: str) -> str:
    parts = [part.strip().rstrip(".") for part in what.split("(required)") if part.strip()]
    if len(parts) > 1 or parts[0].startswith("--"):
        return f"{command}: missing {' and '.join(' '.join(part.split()[:2]) for part in parts)}"
    name, _, purpose = parts[0].partition(" ")
    return f"{command}: missing {name} ({purpose})"


def _choice(got: str, option: str, choices: str) -> str:
    known = sorted(set(re.findall(r"'([^']*)'", choices)) - {"None"})  # None: what is not given at all
    return f"{option}: expected {' or '.join(known)}, got {got!r}{did_you_mean(got, known)}"


def _number(option: str, kind: str, got: str) -> str:
    return f"{option}: expected {_NUMBERS.get(kind, 'another value')}, got {got!r}"


_SAYINGS: tuple[tuple[str, Callable[..., str]], ...] = (
    (r"^Missing from icmj (\w+): (.*)$", _missing),
    (r"^invalid choice '(.*)' for argument '(\S+)'\. Expected one of \((.*)\)", _choice),
    (r"^Error parsing (\S+): no type matching \{None\}\|(\w+) could be instantiated from \['(.*)'\]", _number),
    (r"^Error parsing (\S+): could not convert string to (float): '(.*)'", _number),
    (r"^Error parsing (\S+): invalid literal for (int)\(\) with base 10: '(.*)'", _number),
    (r"^Missing value for argument '(\S+)'", "{}: its value is missing".format),
)


def _unbox(text: str) -> str:
    """The first paragraph in the parser's box, in one line; where there are no characters for a box, a rule follows its
    title.
    """
    lines: list[str] = []
    titled = text.lstrip().startswith(("╭", "+"))
    for line in text.splitlines():
        inner = line.strip(" │|╭╮╰╯─+")
        inner = "" if set(inner) <= {"-"} else inner
        if not inner and lines:
            if titled:
                break  # a rule: what follows repeats the help
            lines, titled = [], True
        elif inner and not line.startswith(("╭", "+")):
            lines.append(inner)
    return " ".join(lines).rstrip(".") or "arguments not understood"
