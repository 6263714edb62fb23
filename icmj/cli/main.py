"""The command line: a thin shell over the API. Status 0 on success, 2 on bad input with one line on standard error."""

from __future__ import annotations

import contextlib
import io
import sys
from collections.abc import Iterator, Sequence

import tyro

from icmj.cli.arguments import DESCRIPTION, Command
from icmj.errors import IcmjError

# Heavy imports happen inside the commands: `icmj --help` must stay quick.


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of ``icmj``; returns the exit status."""
    try:
        command = _parse(sys.argv[1:] if arguments is None else list(arguments))
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else 2
    try:
        from icmj.cli import commands

        commands.execute(command)
    except IcmjError as error:
        print(f"icmj: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("icmj: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of our output went away, as `| head` does
        sys.stderr.close()
        return 0
    return 0


def _parse(arguments: list[str]) -> Command:
    if not arguments:
        arguments = ["--help"]
    with _one_line_errors():
        return tyro.cli(
            Command, prog="icmj", description=DESCRIPTION, args=arguments, config=(tyro.conf.FlagCreatePairsOff,)
        )


@contextlib.contextmanager
def _one_line_errors() -> Iterator[None]:
    """Make one line of the parser's boxed message."""
    shown = io.StringIO()
    try:
        with contextlib.redirect_stderr(shown):
            yield
    except SystemExit as stop:
        if stop.code not in (0, None):
            print(f"icmj: {_unboxed(shown.getvalue())}; see icmj --help", file=sys.stderr)
            raise SystemExit(2) from None
        sys.stderr.write(shown.getvalue())
        raise


def _unboxed(text: str) -> str:
    lines: list[str] = []
    for line in text.splitlines():
        inner = line.strip(" │|╭╮╰╯─+-")
        if not inner and lines:
            break  # a rule: what follows repeats the help
        if inner and not line.startswith(("╭", "+")):
            lines.append(inner)
    return " ".join(lines).rstrip(".") or "arguments not understood"
