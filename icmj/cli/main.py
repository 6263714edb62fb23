"""The command line: a thin shell over the API, and what becomes of errors and signals there (docs/promises.md).

Words that make no command are told in one line, with what was probably meant.

Status 0 on success, 2 on bad input with one line on standard error, 70 where icmj itself is wrong, 130 after Ctrl-C,
143 after SIGTERM.
"""

from __future__ import annotations

import codecs
import contextlib
import io
import os
import re
import signal
import sys
import textwrap
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, TextIO, get_args, get_type_hints

from icmj.base.process import (
    LEAST_ROOM,
    EndRequest,
    Termination,
    collect_garbage_seldom,
    load_matplotlib_apart,
    narrow,
    one_thread,
    sparing,
    terminable,
)
from icmj.base.text import did_you_mean, one_line, spell
from icmj.errors import IcmjError, beyond_arithmetic, beyond_memory

if TYPE_CHECKING:
    from icmj.cli.arguments import Command

BAD_INPUT, OURS, INTERRUPTED = 2, 70, 130
_NUMBERS = {"INT": "a whole number", "int": "a whole number", "FLOAT": "a number", "float": "a number"}

# Heavy imports happen inside the commands: `icmj --help` must stay quick, and a signal must find us ready.


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of ``icmj``; returns the exit status."""
    os.environ.setdefault("RUST_LOG", "off")  # rerun's own words, in colour; what they mean comes as an error
    # no pictures are drawn by MuJoCo here; else it loads a window library, in a process that a signal finds talking
    os.environ.setdefault("MUJOCO_GL", "disable")
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # for which all that is installed would be searched
    one_thread()
    sparing()
    collect_garbage_seldom()
    asked = EndRequest()
    try:
        with _sayable(), _library_words_unsaid(), terminable() as asked:
            return _obey(sys.argv[1:] if arguments is None else list(arguments))
    except KeyboardInterrupt:
        return _say("interrupted", INTERRUPTED)
    except Termination as stop:
        return _say("interrupted", stop.status)
    except Exception as error:
        if asked.signum:  # it fell into code that made another exception of it
            return _say("interrupted", 128 + asked.signum)
        if os.environ.get("ICMJ_TRACEBACK"):
            raise
        if beyond_arithmetic(error):
            return _say(f"not computable: numbers too far apart ({one_line(error, 200)})", BAD_INPUT)
        what = f"{type(error).__name__}: {error}"
        return _say(f"this is a mistake in icmj ({one_line(what, 300)}); ICMJ_TRACEBACK=1 shows where", OURS)


def entry() -> None:
    """The program: :func:`main`, which ignores signals at its end and exits without interpreter shutdown.

    All is unwound and written by then. Threads of libraries in other languages that are still there, and destructors
    of modules that were being imported when a signal came, would abort it now and then.
    """
    status = main()
    with contextlib.suppress(ValueError, OSError):
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), signal.SIG_IGN)
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError, AttributeError):  # the interpreter would say so, and change the status
            _unheard(stream)
    os._exit(status)


def _obey(arguments: list[str]) -> int:
    try:
        if arguments[:1] == ["--version"]:
            from icmj.base import VERSION

            print(f"icmj {VERSION}", flush=True)
            return 0
        if arguments[:1] in ([], ["--help"], ["-h"]):
            print(overview(), flush=True)
            return 0
        try:
            command = parse(arguments)
        except SystemExit as stop:
            sys.stdout.flush()
            return stop.code if isinstance(stop.code, int) else 0  # help, or completion for a shell
        if (room := narrow()) is not None:
            return _say(
                f"ulimit -v leaves {room / 1e9:.2g} GB of addresses, and the libraries need {LEAST_ROOM / 1e9:.2g} GB; "
                "raise it",
                BAD_INPUT,
            )
        load_matplotlib_apart()
        import icmj.cli.cycles  # noqa: F401, for the commands that it registers
        from icmj.cli import arguments as given
        from icmj.cli import commands, terminal

        given.refuse_other_kind(command)
        with terminal.talking(command.general.quiet, command.general.verbose):
            commands.execute(command)
        sys.stdout.flush()
    except IcmjError as error:
        return _say(str(error), BAD_INPUT)
    except BrokenPipeError:  # the reader of our output went away, as `| head` does
        _unheard(sys.stdout)
        return 0
    except OSError as error:
        if error.filename is None:  # not a file of ours: standard output is full, or gone
            _unheard(sys.stdout)
        name = f"{error.filename}: " if error.filename is not None else ""
        return _say(f"{name}{error.strerror or error}", BAD_INPUT)
    except Exception as error:
        if not beyond_memory(error):
            raise
        return _say("out of memory; use a smaller model, a longer record_interval or fewer --jobs", BAD_INPUT)
    return 0


@contextlib.contextmanager
def _library_words_unsaid() -> Iterator[None]:
    """Suppress warnings of libraries unless Python was asked to show them; icmj reports what they mean itself.

    Where Python was asked to make errors of them they are shown: a library that warns has done its work all the same.
    """
    with warnings.catch_warnings():
        if not sys.warnoptions:
            warnings.simplefilter("ignore")
        elif any(action.startswith("e") for action in sys.warnoptions):
            warnings.simplefilter("default")
        yield


@contextlib.contextmanager
def _sayable() -> Iterator[None]:
    """Make sure that the standard streams exist and can encode any character.

    One that is closed leads nowhere: else the next file that is opened would stand in its place, and get what others
    print. What a stream cannot encode is spelt.
    """
    codecs.register_error("icmj", spell)
    with contextlib.suppress(OSError):
        while (handle := os.open(os.devnull, os.O_RDWR)) <= 2:
            continue
        os.close(handle)
    for name, way in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, way, encoding="utf-8"))  # noqa: SIM115, it is open to the end
    before = [(stream, getattr(stream, "errors", None)) for stream in (sys.stdout, sys.stderr)]
    for stream, _ in before:
        _reconfigure(stream, "icmj")
    try:
        yield
    finally:
        for stream, errors in before:
            _reconfigure(stream, errors)


def _reconfigure(stream: TextIO, errors: str | None) -> None:
    with contextlib.suppress(OSError, ValueError, AttributeError):  # not there, or not a stream of a file
        stream.reconfigure(errors=errors)  # type: ignore[attr-defined]


def _say(message: str, status: int) -> int:
    """Print one line to standard error; errors of a closed stream are ignored."""
    with contextlib.suppress(OSError, ValueError):
        print(f"icmj: {one_line(message)}", file=sys.stderr, flush=True)
    return status


def _unheard(stream: TextIO) -> None:
    """Discard the buffer of a standard stream, so that Python reports no error at exit."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, stream.fileno())
        os.close(nothing)


def parse(words: list[str]) -> Command:
    """The command that the words of a command line ask for.

    Raises:
        IcmjError: one line that says what is wrong with them.
        SystemExit: with status 0, where help was asked for and shown.
    """
    import tyro

    from icmj.cli.arguments import Command

    classes = _classes()
    if not words[0].startswith("-") and words[0] not in classes:
        hint = did_you_mean(words[0], classes) or f"; there are {', '.join(classes)}"
        raise IcmjError(f"no command {words[0]!r}{hint}")
    command: Any = Command
    shown = io.StringIO()
    try:
        with contextlib.redirect_stderr(shown):
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
    from icmj.cli.arguments import DESCRIPTION, GROUPS

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
    from icmj.cli.arguments import Command, General, annotate

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
