"""The command line: a thin shell over the API, and what becomes of errors and signals there (docs/command_line.md).

The parser of a command is made of the class of its arguments; words that make no command are told in one line, with
what was probably meant.

Status 0 on success, 2 on bad input with one line on standard error, 70 where icmj itself is wrong, 130 after Ctrl-C,
143 after SIGTERM.
"""

from __future__ import annotations

import argparse
import codecs
import contextlib
import os
import shutil
import signal
import sys
import textwrap
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import MISSING
from types import NoneType
from typing import TYPE_CHECKING, Annotated, Any, Literal, NoReturn, TextIO, get_args, get_origin, get_type_hints

from icmj.base.address_space import LEAST_ROOM, narrow, sparing
from icmj.base.blas_threads import one_thread
from icmj.base.interruption import EndRequest, Termination, terminable
from icmj.base.process import collect_garbage_seldom, load_matplotlib_apart
from icmj.base.text import attribute_docstrings, did_you_mean, one_line, spell
from icmj.errors import IcmjError, beyond_arithmetic, beyond_memory

if TYPE_CHECKING:
    from icmj.cli.arguments import Command, Given

BAD_INPUT, OURS, INTERRUPTED = 2, 70, 130

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
        if arguments[0] == COMPLETION:
            print(completion(" ".join(arguments[1:])), flush=True)
            return 0
        try:
            command = parse(arguments)
        except SystemExit as stop:
            sys.stdout.flush()
            return stop.code if isinstance(stop.code, int) else 0  # help
        if (room := narrow()) is not None:
            return _say(
                f"ulimit -v leaves {room / 1e9:.2g} GB of addresses, and the libraries need {LEAST_ROOM / 1e9:.2g} GB; "
                "raise it",
                BAD_INPUT,
            )
        load_matplotlib_apart()
        import icmj.cli.continuation
        import icmj.cli.cycles  # noqa: F401, for the commands that both register
        from icmj.cli import arguments as given
        from icmj.cli import commands, terminal

        given.refuse_other_kind(command)
        with terminal.talking(command.quiet, command.verbose):
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


class _Parser(argparse.ArgumentParser):
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
    from icmj.cli.arguments import COMMANDS

    name, *rest = words
    if name.startswith("-"):
        raise IcmjError(f"icmj has no option {_near(name, ['--help', '--version', COMPLETION])}; see icmj --help")
    if name not in COMMANDS:
        hint = did_you_mean(name, COMMANDS) or f"; there are {', '.join(COMMANDS)}"
        raise IcmjError(f"no command {name!r}{hint}; see icmj --help")
    parser = _Parser(f"icmj {name}", **_STYLE)
    helped = any(word == "--help" or (word[:1] == "-" != word[1:2] and "h" in word) for word in rest)
    cls = COMMANDS[name].complete()
    options = ["--help", *_fill(parser, cls, helped)]

    def refuse(option: str) -> NoReturn:
        raise IcmjError(f"{name} has no option {_near(option, options)}; see icmj {name} --help")

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


def _near(option: str, known: Sequence[str]) -> str:
    return f"{one_line(option, 80)}{did_you_mean(option, known)}"


def _fill(parser: argparse.ArgumentParser, cls: type[Command], helped: bool, files: object = None) -> list[str]:
    """Give a parser the arguments of a command, and its help; returns the names of the options.

    Args:
        parser: to be filled.
        cls: the class of the command.
        helped: whether its help is needed, too, which is read from the source.
        files: what completion for a shell offers where a path is expected.
    """
    from icmj.cli.arguments import Command, Given

    parser.description = "\n\n".join(
        textwrap.fill(" ".join(words.split()), shutil.get_terminal_size().columns - 2)
        for words in (cls.__doc__ or "").split("\n\n")
    )
    meanings: dict[str, str] = {}
    for owner in cls.__mro__[-2::-1] if helped else ():
        meanings |= (
            attribute_docstrings(owner) if vars(sys.modules[owner.__module__]).get(owner.__name__) is owner else {}
        )
    general = parser.add_argument_group("general options")
    names = []
    for field, hint in get_type_hints(cls, include_extras=True).items():
        kind, given = get_args(hint) if get_origin(hint) is Annotated else (hint, Given())
        kind = next((each for each in get_args(kind) if NoneType in get_args(kind)), kind)
        default = cls.__dataclass_fields__[field].default
        how = _of_kind(kind, given)
        note = "required" if default is MISSING else f"default: {default}"
        meaning = (given.meaning or meanings.get(field, "")) + ("" if default in (None, False, ()) else f" ({note})")
        how["help"] = meaning.replace("%", "%%")
        if given.positional:
            if default is not MISSING:
                how = {"nargs": "?", "default": default} | how
            action = parser.add_argument(field, **how)
        else:
            names.append(f"--{(given.name or field).replace('_', '-')}")
            place = general if field in get_type_hints(Command) else parser
            flags = [given.short, names[-1]] if given.short else names[-1:]
            action = place.add_argument(*flags, dest=field, required=default is MISSING, **how)
        if how.get("metavar") in _PATHS:
            action.complete = files  # type: ignore[attr-defined]
    return names


def _of_kind(kind: Any, given: Given) -> dict[str, Any]:
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
            hint = did_you_mean(word, known)
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
_STYLE: dict[str, Any] = {
    "allow_abbrev": False,
    "argument_default": argparse.SUPPRESS,
    "formatter_class": argparse.RawDescriptionHelpFormatter,
}
COMPLETION = "--print-completion"
_SHELLS = ("bash", "zsh", "tcsh")


def completion(shell: str) -> str:
    """The script by which a shell completes the commands of icmj and their options.

    Raises:
        IcmjError: if ``shell`` is not one of those.
    """
    import shtab

    from icmj.cli.arguments import COMMANDS

    if shell not in _SHELLS:
        raise IcmjError(f"{COMPLETION}: expected {' or '.join(_SHELLS)}, got {shell!r}{did_you_mean(shell, _SHELLS)}")
    parser = _Parser("icmj", **_STYLE)
    commands = parser.add_subparsers()
    for name, cls in COMMANDS.items():
        _fill(commands.add_parser(name, help=_purpose(cls), **_STYLE), cls.complete(), True, shtab.FILE)
    return str(shtab.complete(parser, shell))


def overview() -> str:
    """The purpose of the program, and of each command in one sentence."""
    from icmj.cli.arguments import DESCRIPTION, GROUPS, name_command

    lines = ["usage: icmj COMMAND [OPTIONS]", "", *textwrap.wrap(" ".join(DESCRIPTION.split()), 78)]
    for group, classes in GROUPS.items():
        lines += ["", f"{group}:"]
        for cls in classes:
            indent = f"  {name_command(cls):<11}"
            lines += textwrap.wrap(_purpose(cls), 78, initial_indent=indent, subsequent_indent=" " * 13)
    more = (
        ("icmj COMMAND --help", "options of a command, with an example"),
        ("icmj --version", "version"),
        (f"icmj {COMPLETION} bash", "completion for the shell: bash, zsh or tcsh"),
    )
    lines += ["", *(f"{words:<36}{purpose}" for words, purpose in more)]
    return "\n".join([*lines, "", "Example: icmj study"])


def _purpose(cls: type[Command]) -> str:
    return " ".join((cls.__doc__ or "").partition("\n\n")[0].split())
