"""The arguments of each command, and its help."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from icmj.cli.fit_arguments import Fit
from icmj.cli.overrides import Overrides, Shared
from icmj.cli.series_arguments import Export, Measure
from icmj.cli.starting_arguments import Cases, Linearise, New, Person, Schema


@dataclass(frozen=True)
class Sweep(Shared):
    """Compute a case at many points of its parameters and write Parquet files; an interrupted sweep can be resumed.

    Example: icmj sweep validity --out runs/out/validity
    """

    sweep: tyro.conf.Positional[Path]
    """Sweep file, or name of a shipped sweep."""
    out: Path | None = None
    """Folder for the results (default: runs/out/NAME). The same command resumes an interrupted sweep."""
    jobs: int | None = None
    """Number of local processes (default: one per core)."""
    dask: str | None = None
    """Address of a Dask scheduler whose workers do the computing."""
    allow_code: bool = False
    """Run Python code that the run file names as module:name. Read the code first."""
    dry_run: bool = False
    """Print the number of points, the estimated time and the size of the results, and stop."""


@dataclass(frozen=True)
class Identify(Overrides):
    """Estimate a model error and its uncertainty from a measured motion, or say that the motion does not determine it.

    The motion is a log; or, with --run, a file of event times, one per line, or of sampled outputs with their times.

    Example: icmj identify runs/out/three-link-0.9.mujoco.rrd
    """

    motions: tyro.conf.Positional[tuple[Path, ...]]
    """Logs, or files of event times or outputs."""
    run: Path | None = None
    """Run file that describes plant and controller (default: that of the log). Its value of the unknown is ignored."""
    unknown: str = "actual.gain"
    """Unknown parameter: a key of the run file, or a change and its target, such as "mass trunk" (its factor)."""
    low: float = 0.5
    """Lower end of the search."""
    high: float = 1.5
    """Upper end of the search."""
    timing: float | None = None
    """Standard deviation of timing errors [s] (default: that of rounding to the sampling interval)."""
    reading: float | None = None
    """Standard deviation of the measurement errors of outputs [rad, or the unit of the plant] (default: a hundredth of
    the size of the outputs).
    """
    plant: Literal["linear", "mujoco"] | None = None
    """Plant that made the motion (default: that of the log; mujoco for other files)."""
    json: bool = False
    """Print JSON instead of sentences."""


@dataclass(frozen=True)
class Experiment(Shared):
    """Carry out a standard experiment on simulated cases or on recordings; an interrupted one can be resumed.

    Example: icmj experiment intersection-point --out runs/out/intersection-point
    """

    experiment: tyro.conf.Positional[Path]
    """Experiment file, or name of a shipped experiment."""
    out: Path | None = None
    """Folder for trials, results and figure (default: runs/out/NAME). The same command resumes an interrupted
    experiment.
    """
    jobs: int | None = None
    """Number of processes (default: one per core)."""
    yes: bool = False
    """Also start trials that are estimated to take longer than a minute altogether."""
    recording: Annotated[tyro.conf.UseAppendAction[tuple[Path, ...]], tyro.conf.arg(metavar="FILE")] = ()
    """Recording to analyse (CSV, Parquet, npz) instead of simulating the cases. Repeat the option for further
    trials of the same condition.
    """
    rate: float | None = None
    """Rate of a recording without times [Hz]."""
    allow_code: bool = False
    """Run Python code that the run files name as module:name. Read the code first."""
    json: bool = False
    """Print JSON instead of a table."""


@dataclass(frozen=True)
class Study(Overrides):
    """Simulate cases on the linear plant and in MuJoCo; write logs, report.html and summary.json.

    Example: icmj study --out runs/out
    """

    runs: tyro.conf.Positional[tuple[Path, ...]] = ()
    """Run files, folders of run files, or names of shipped cases (default: the run files in the folder runs; if there
    are none, all shipped cases).
    """
    out: Path = Path("runs/out")
    """Folder for the outputs."""
    jobs: int | None = None
    """Number of processes (default: one per core)."""
    yes: bool = False
    """Also run cases that are estimated to take longer than a minute."""
    json: bool = False
    """Print JSON instead of a table."""


@dataclass(frozen=True)
class Analyse(Overrides):
    """Predict by linear theory: critical open-loop interval, eigenvalues that cross the unit circle, limit cycle.

    For a controller that is not intermittent, the characteristic roots of its loop are computed instead; for one that
    switches, also how fast its motion grows.

    Example: icmj analyse simple-0.8 --json
    """

    run: tyro.conf.Positional[Path]
    """Run file, or name of a shipped case."""
    json: bool = False
    """Print JSON instead of a table."""


@dataclass(frozen=True)
class Run(Overrides):
    """Simulate one case, write its log and compare the result with the prediction.

    The log contains this run alone. With --study it also contains what icmj study computes beside a prediction:
    continuous control, growth under clocks, and the amplitude law (MuJoCo) or other attractors (linear plant).

    Example: icmj run three-link-0.9 --plant mujoco --set actual.gain=0.85
    """

    run: tyro.conf.Positional[Path]
    """Run file, or name of a shipped case."""
    plant: Literal["linear", "mujoco"] | None = None
    """Plant to simulate (default: mujoco; linear if the run file gives matrices)."""
    out: Path = Path("runs/out")
    """Folder for the log."""
    study: bool = False
    """Also compute what icmj study computes beside a prediction."""
    yes: bool = False
    """Run the case even if it is estimated to take longer than a minute."""
    json: bool = False
    """Print JSON instead of a table."""


@dataclass(frozen=True)
class Cycle(Overrides):
    """Find the periodic orbit, attracting or repelling, and its multipliers by Newton's method.

    Example: icmj cycle runs/simple-1.7.toml --plant mujoco
    """

    run: tyro.conf.Positional[Path]
    """Run file, or name of a shipped case."""
    plant: Literal["linear", "mujoco"] | None = None
    """Plant on which the orbit is found (default: mujoco; linear if the run file gives matrices)."""
    start: Literal["auto", "prediction", "simulation"] = "auto"
    """Initial guess: the predicted orbit, or the end of a simulation; auto uses the prediction if there is one."""
    json: bool = False
    """Print JSON instead of a table."""


@dataclass(frozen=True)
class Continue(Overrides):
    """Follow a cycle as a parameter varies, through folds, up to its end; write the branch and its figure.

    Example: icmj continue runs/simple-1.7.toml --parameter b --from 1.7 --to 1.2 --branches
    """

    run: tyro.conf.Positional[Path]
    """Run file, or name of a shipped case."""
    parameter: str
    """Parameter to vary: b (input gain), q_t (threshold), delay, delta_min (refractory period), rho (share of the
    changes of the plant), the factor of a change such as mass:trunk, or a dotted key of the run file.
    """
    to: float
    """Last value of the parameter."""
    from_: Annotated[float | None, tyro.conf.arg(name="from")] = None
    """First value of the parameter (default: that of the run file)."""
    plant: Literal["linear", "mujoco"] | None = None
    """Plant whose cycle is followed (default: as for icmj cycle). With mujoco, the linear prediction is drawn, too."""
    start: Literal["auto", "prediction", "simulation"] = "auto"
    """Initial guess of the first cycle, as for icmj cycle."""
    points: int = 40
    """Minimum number of cycles on a branch that spans the whole range."""
    branches: bool = False
    """Also follow the branches that bifurcate from this one."""
    out: Path = Path("runs/out")
    """Folder for the branches (Parquet, logs) and figures (PDF, SVG)."""


@dataclass(frozen=True)
class Report(Shared):
    """Build the comparison report from logs.

    Example: icmj report runs/out/simple-0.8.linear.rrd runs/out/simple-0.8.mujoco.rrd --out report.html
    """

    logs: tyro.conf.Positional[tuple[Path, ...]]
    """Logs, folders of sweeps, or branches of cycles (Parquet). Logs of one case on both plants are shown together."""
    out: Path = Path("report.html")
    """HTML page to write; its figures go into a folder beside it."""
    json: bool = False
    """Print JSON instead of a table."""


@dataclass(frozen=True)
class Replay(Shared):
    """Open a log in the rerun viewer, serve it to a browser on this machine, or render a picture of it.

    Example: icmj replay runs/out/three-link-0.9.mujoco.rrd --screenshot pose.png --time 20
    """

    log: tyro.conf.Positional[Path]
    """Log to show. A truncated log is shown as far as it can be read."""
    web: bool = False
    """Serve the log to a browser on this machine (loopback address only), and print the address."""
    screenshot: Path | None = None
    """PNG file to render; no screen is needed."""
    time: float | None = None
    """Time of the screenshot [s]."""


@dataclass(frozen=True)
class Live(Overrides):
    """Write a page that simulates one case live in a browser, with sliders for b, threshold, delay and noise.

    The page is one file that needs no network and no installation. Its sliders start at the values of the run file.

    Example: icmj live three-link-0.9 -o live.html
    """

    run: tyro.conf.Positional[Path]
    """Run file, or name of a shipped case."""
    out: Annotated[Path, tyro.conf.arg(aliases=("-o",))] = Path("live.html")
    """HTML page to write."""


Command = (
    Annotated[Cases, tyro.conf.subcommand("cases")]
    | Annotated[New, tyro.conf.subcommand("new")]
    | Annotated[Person, tyro.conf.subcommand("person")]
    | Annotated[Linearise, tyro.conf.subcommand("linearise")]
    | Annotated[Schema, tyro.conf.subcommand("schema")]
    | Annotated[Analyse, tyro.conf.subcommand("analyse")]
    | Annotated[Cycle, tyro.conf.subcommand("cycle")]
    | Annotated[Continue, tyro.conf.subcommand("continue")]
    | Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Study, tyro.conf.subcommand("study")]
    | Annotated[Live, tyro.conf.subcommand("live")]
    | Annotated[Sweep, tyro.conf.subcommand("sweep")]
    | Annotated[Experiment, tyro.conf.subcommand("experiment")]
    | Annotated[Report, tyro.conf.subcommand("report")]
    | Annotated[Replay, tyro.conf.subcommand("replay")]
    | Annotated[Export, tyro.conf.subcommand("export")]
    | Annotated[Measure, tyro.conf.subcommand("measure")]
    | Annotated[Identify, tyro.conf.subcommand("identify")]
    | Annotated[Fit, tyro.conf.subcommand("fit")]
)

GROUPS = {
    "Begin": ("cases", "new", "person", "linearise", "schema"),
    "Predict": ("analyse", "cycle", "continue"),
    "Simulate": ("run", "study", "live", "sweep", "experiment"),
    "Use the logs": ("report", "replay", "export", "measure", "identify", "fit"),
}

DESCRIPTION = """Event-driven intermittent control of human standing: predict limit cycles from the linear theory,
simulate them on the linear plant and in MuJoCo, and compare."""
