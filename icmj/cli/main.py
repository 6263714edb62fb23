"""The command line's entry: from words to the status with which it ends (docs/command_line.md).

Status 0 on success, 2 on bad input with one line on standard error, 70 where icmj itself is wrong, 130 after Ctrl-C,
143 after SIGTERM.
"""

from __future__ import annotations

import codecs
import contextlib
import os
import signal
import sys
import warnings
from collections.abc import Iterator, Sequence
from typing import TextIO

from icmj.base.address_space import LEAST_ROOM, address_space_too_small, reserve_little
from icmj.base.blas_threads import set_one_thread
from icmj.base.interruption import EndRequest, Termination, catch_termination
from icmj.base.process import collect_garbage_seldom, load_matplotlib_apart
from icmj.base.text import one_line, spell
from icmj.cli.arguments import refuse_values
from icmj.cli.parsing import COMPLETION, parse
from icmj.errors import IcmjError, beyond_arithmetic, beyond_memory

BAD_INPUT, OURS, INTERRUPTED = 2, 70, 130

# Heavy imports happen inside the commands: `icmj --help` must stay quick, and a signal must find us ready.


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of ``icmj``; returns the exit status."""
    os.environ.setdefault("RUST_LOG", "off")  # rerun's own words, in colour; what they mean comes as an error
    # no pictures are drawn by MuJoCo here; else it loads a window library, in a process that a signal finds talking
    os.environ.setdefault("MUJOCO_GL", "disable")
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # for which all that is installed would be searched
    set_one_thread()
    reserve_little()
    collect_garbage_seldom()
    asked = EndRequest()
    try:
        with _open_streams(), _silence_libraries(), catch_termination() as asked:
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
            _discard(stream)
    os._exit(status)


def _obey(arguments: list[str]) -> int:
    try:
        if arguments[:1] == ["--version"]:
            from icmj.base import VERSION

            print(f"icmj {VERSION}", flush=True)
            return 0
        if arguments[:1] in ([], ["--help"], ["-h"]):
            from icmj.cli.overview import write_overview

            print(write_overview(), flush=True)
            return 0
        if arguments[0] == COMPLETION:
            from icmj.cli.overview import write_completion

            print(write_completion(" ".join(arguments[1:])), flush=True)
            return 0
        try:
            command = parse(arguments)
        except SystemExit as stop:
            sys.stdout.flush()
            return stop.code if isinstance(stop.code, int) else 0  # help
        if (room := address_space_too_small()) is not None:
            return _say(
                f"ulimit -v leaves {room / 1e9:.2g} GB of addresses, and the libraries need {LEAST_ROOM / 1e9:.2g} GB; "
                "raise it",
                BAD_INPUT,
            )
        load_matplotlib_apart()
        from icmj.cli.terminal import ERR, OUT, apply_verbosity

        refuse_values(command)
        with apply_verbosity(command.quiet, command.verbose):
            command.carry_out(OUT, ERR)
        sys.stdout.flush()
    except IcmjError as error:
        return _say(str(error), BAD_INPUT)
    except BrokenPipeError:  # the reader of our output went away, as `| head` does
        _discard(sys.stdout)
        return 0
    except OSError as error:
        if error.filename is None:  # not a file of ours: standard output is full, or gone
            _discard(sys.stdout)
        name = f"{error.filename}: " if error.filename is not None else ""
        return _say(f"{name}{error.strerror or error}", BAD_INPUT)
    except Exception as error:
        if not beyond_memory(error):
            raise
        return _say("out of memory; use a smaller model, a longer record_interval or fewer --jobs", BAD_INPUT)
    return 0


@contextlib.contextmanager
def _silence_libraries() -> Iterator[None]:
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
def _open_streams() -> Iterator[None]:
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


def _discard(stream: TextIO) -> None:
    """Discard the buffer of a standard stream, so that Python reports no error at exit."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, stream.fileno())
        os.close(nothing)
