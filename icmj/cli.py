"""The command line: a thin shell over the API. Status 0 on success, 2 on bad input with one line on standard error."""

from __future__ import annotations

import contextlib
import io
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from icmj.errors import IcmjError

# Heavy imports happen inside the commands: `icmj --help` must stay quick.


@dataclass(frozen=True)
class Study:
    """Run every case on the linear plant and in MuJoCo, and write logs, report.html and summary.json.

    Example: icmj study --out runs/out
    """

    runs: tyro.conf.Positional[tuple[Path, ...]] = (Path("runs"),)
    """Run files, or folders of them."""
    out: Path = Path("runs/out")
    """Folder for the outputs."""
    jobs: int | None = None
    """Processes; as many as there are cores by default."""


@dataclass(frozen=True)
class Analyse:
    """Predict from the linear theory: critical interval, eigenvalue, cycle, amplitude, all crossings.

    Example: icmj analyse runs/simple-0.8.toml --json
    """

    run: tyro.conf.Positional[Path]
    """Run file."""
    json: bool = False
    """Print JSON instead of a table."""


@dataclass(frozen=True)
class Run:
    """Simulate one case, write its log and say what it did.

    Example: icmj run runs/three-link-0.9.toml --plant mujoco
    """

    run: tyro.conf.Positional[Path]
    """Run file."""
    plant: Literal["linear", "mujoco"] = "mujoco"
    """Plant to simulate."""
    out: Path = Path("runs/out")
    """Folder for the log."""


@dataclass(frozen=True)
class Report:
    """Build the comparison report from logs alone.

    Example: icmj report runs/out/simple-0.8.linear.rrd runs/out/simple-0.8.mujoco.rrd --out report.html
    """

    logs: tyro.conf.Positional[tuple[Path, ...]]
    """Logs; those of one case on both plants are shown together."""
    out: Path = Path("report.html")
    """The page; its figures go into a folder beside it."""


@dataclass(frozen=True)
class Replay:
    """Open a log in the rerun viewer, serve it to a browser on this machine, or render a picture of it.

    Example: icmj replay runs/out/three-link-0.9.mujoco.rrd --screenshot pose.png --time 20
    """

    log: tyro.conf.Positional[Path]
    """Log. One that was cut short is salvaged as far as it goes."""
    web: bool = False
    """Serve to a browser on the loopback address and print the address."""
    screenshot: Path | None = None
    """Render to this PNG file, without a screen."""
    time: float | None = None
    """Instant of the screenshot [s]."""


@dataclass(frozen=True)
class Linearise:
    """Linearise any MJCF model by centred finite differences: A, B, C, poles, names.

    Example: icmj linearise models/three_link.xml --keyframe upright
    """

    model: tyro.conf.Positional[Path]
    """MJCF file."""
    keyframe: str | None = None
    """Operating point; the reference configuration by default."""
    json: bool = False
    """Print JSON instead of tables."""


Command = (
    Annotated[Study, tyro.conf.subcommand("study")]
    | Annotated[Analyse, tyro.conf.subcommand("analyse")]
    | Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Report, tyro.conf.subcommand("report")]
    | Annotated[Replay, tyro.conf.subcommand("replay")]
    | Annotated[Linearise, tyro.conf.subcommand("linearise")]
)

DESCRIPTION = """Event-driven intermittent control: predict limit cycles from the linear theory, simulate them on the
linear plant and in MuJoCo, and compare.

Example: icmj study"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of ``icmj``; returns the exit status."""
    try:
        command = _parse(sys.argv[1:] if arguments is None else list(arguments))
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else 2
    try:
        from icmj import commands

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


def _parse(arguments: list[str]) -> Study | Analyse | Run | Report | Replay | Linearise:
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
