"""The arguments of each command, and its help."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from icmj.cli.overrides import Overrides
from icmj.cli.series_arguments import Export, Measure
from icmj.cli.sweep_arguments import Identify, Sweep


@dataclass(frozen=True)
class Study(Overrides):
    """Run every case on the linear plant and in MuJoCo, and write logs, report.html and summary.json.

    Example: icmj study --out runs/out
    """

    runs: tyro.conf.Positional[tuple[Path, ...]] = ()
    """Run files, folders of them, or names of shipped cases. None: the folder runs, or else all shipped cases."""
    out: Path = Path("runs/out")
    """Folder for the outputs."""
    jobs: int | None = None
    """Processes; as many as there are cores by default."""
    yes: bool = False
    """Start also what is estimated to take longer than a minute for one case."""


@dataclass(frozen=True)
class Analyse(Overrides):
    """Predict from the linear theory: critical interval, eigenvalue, cycle, amplitude, all crossings.

    Example: icmj analyse simple-0.8 --json
    """

    run: tyro.conf.Positional[Path]
    """Run file, or the name of a shipped case."""
    json: bool = False
    """Print JSON instead of a table."""


@dataclass(frozen=True)
class Run(Overrides):
    """Simulate one case, write its log and say what it did.

    Example: icmj run three-link-0.9 --plant mujoco --set actual.gain=0.85
    """

    run: tyro.conf.Positional[Path]
    """Run file, or the name of a shipped case."""
    plant: Literal["linear", "mujoco"] | None = None
    """Plant to simulate; by default MuJoCo's, and the linear one where the run file gives matrices."""
    out: Path = Path("runs/out")
    """Folder for the log."""
    yes: bool = False
    """Start also what is estimated to take longer than a minute."""


@dataclass(frozen=True)
class Cycle(Overrides):
    """Find the periodic orbit itself, attracting or not, with its multipliers, by Newton's method.

    Example: icmj cycle runs/simple-1.7.toml --plant mujoco
    """

    run: tyro.conf.Positional[Path]
    """Run file, or the name of a shipped case."""
    plant: Literal["linear", "mujoco"] | None = None
    """Plant that moves; by default MuJoCo's, and the linear one where the run file gives matrices."""
    start: Literal["auto", "prediction", "simulation"] = "auto"
    """First guess: the linear prediction (if there is an orbit, by default), or the end of the run file's run."""
    json: bool = False
    """Print JSON instead of a table."""


@dataclass(frozen=True)
class Continue(Overrides):
    """Follow the cycle along a parameter: past folds, to where it changes or ends; stored, and drawn.

    Example: icmj continue runs/simple-1.7.toml --parameter b --from 1.7 --to 1.2 --branches
    """

    run: tyro.conf.Positional[Path]
    """Run file, or the name of a shipped case."""
    parameter: str
    """b, q_t, delay, delta_min, rho, a change such as mass:trunk (its factor), or a dotted key of the run file."""
    to: float
    """Its last value."""
    from_: Annotated[float | None, tyro.conf.arg(name="from")] = None
    """Its first value; the run file's own by default."""
    plant: Literal["linear", "mujoco"] | None = None
    """Plant that moves, by default as for cycle. With mujoco, the linear prediction is drawn beneath."""
    start: Literal["auto", "prediction", "simulation"] = "auto"
    """First guess of the first cycle."""
    points: int = 40
    """Cycles on the branch at least, if it runs through."""
    branches: bool = False
    """Follow also what branches off."""
    out: Path = Path("runs/out")
    """Folder for branches (Parquet) and figures (PDF, SVG)."""


@dataclass(frozen=True)
class Report:
    """Build the comparison report from logs alone.

    Example: icmj report runs/out/simple-0.8.linear.rrd runs/out/simple-0.8.mujoco.rrd --out report.html
    """

    logs: tyro.conf.Positional[tuple[Path, ...]]
    """Logs (those of one case on both plants are shown together), folders of sweeps, branches of cycles (Parquet)."""
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

    Example: icmj linearise three_link --keyframe upright
    """

    model: tyro.conf.Positional[Path]
    """MJCF file, or the name of a shipped model."""
    keyframe: str | None = None
    """Operating point; the reference configuration by default."""
    operating_point: Literal["as given", "static control", "balance"] | None = None
    """What of the keyframe stands; a balance moves joints, too. Without a keyframe: as given if at rest, else balance.
    """
    free: tuple[str, ...] = ()
    """Joints that a balance may move; all by default."""
    outputs: tuple[str, ...] = ()
    """Sensors or joints; the one word joints means all joints, and all sensors are taken by default."""
    json: bool = False
    """Print JSON instead of tables."""
    full: bool = False
    """Print the matrices however large they are."""
    out: Path | None = None
    """Save A, B, C, poles, names and units to this .npz file."""


@dataclass(frozen=True)
class Person:
    """Write the three-link model of a person of another height and mass.

    Example: icmj person three_link --height 1.65 --mass 60 --out person.xml
    """

    model: tyro.conf.Positional[Path]
    """MJCF file with bodies shank, thigh and trunk, or the name of a shipped model."""
    height: float = 1.80
    """[m]"""
    mass: float = 80.0
    """[kg]"""
    out: Path = Path("person.xml")
    """MJCF file to write."""


@dataclass(frozen=True)
class New:
    """Write a commented run file for a model, with its own names in it, or a copy of a shipped case and its models.

    Example: icmj new body.xml --out body.toml
    """

    model: tyro.conf.Positional[Path]
    """MJCF file, or the name of a shipped model or case."""
    out: Path | None = None
    """Run file to write; MODEL.toml in this folder by default. One that is there is never overwritten."""
    keyframe: str | None = None
    """Operating point; by default the first keyframe at which the model rests."""


Command = (
    Annotated[Study, tyro.conf.subcommand("study")]
    | Annotated[Analyse, tyro.conf.subcommand("analyse")]
    | Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Cycle, tyro.conf.subcommand("cycle")]
    | Annotated[Continue, tyro.conf.subcommand("continue")]
    | Annotated[Report, tyro.conf.subcommand("report")]
    | Annotated[Replay, tyro.conf.subcommand("replay")]
    | Annotated[Linearise, tyro.conf.subcommand("linearise")]
    | Annotated[Person, tyro.conf.subcommand("person")]
    | Annotated[New, tyro.conf.subcommand("new")]
    | Annotated[Sweep, tyro.conf.subcommand("sweep")]
    | Annotated[Identify, tyro.conf.subcommand("identify")]
    | Annotated[Export, tyro.conf.subcommand("export")]
    | Annotated[Measure, tyro.conf.subcommand("measure")]
)

DESCRIPTION = """Event-driven intermittent control: predict limit cycles from the linear theory, simulate them on the
linear plant and in MuJoCo, and compare. --version prints the version.

Example: icmj study"""
