"""The arguments of each command, and its help.

What several commands take: mix-ins of their arguments, and how all options are shown in the help.

The arguments of the commands that one begins with: models, run files and their schema.

The arguments of the commands that export and measure time series.

The arguments of the command that fits families of controllers to recordings.
"""

from __future__ import annotations

from dataclasses import dataclass
from inspect import get_annotations
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import tyro

from icmj.base.files import is_file_name
from icmj.errors import IcmjError

RESULTS = Path("runs/out")
"""The folder of results where none is given."""


@dataclass(frozen=True)
class Target:
    """What an option names that is written: a note in its type, from which help and :func:`refuse_other_kind` say it.

    Attributes:
        suffixes: that a file may end in, the usual one first; empty for a folder.
    """

    suffixes: tuple[str, ...] = ()


Folder = Annotated[Path, Target()]
Page = Annotated[Path, Target((".html",))]


def refuse_other_kind(command: object) -> None:
    """See that no name of a folder that is written looks like that of a file, nor the reverse, unless it is there.

    Raises:
        IcmjError: one line that says what to give instead.
    """
    for name, hint in get_type_hints(type(command), include_extras=True).items():
        path, target = getattr(command, name), _target(hint)
        if target is None or path is None:
            continue
        option = f"--{name.replace('_', '-')} {path}"
        if not target.suffixes and is_file_name(path) and not path.is_dir():
            raise IcmjError(f"{option}: looks like a file, and a folder is meant; give one, such as {path.stem}")
        if target.suffixes and (path.is_dir() or not (path.suffix or path.exists())):
            at = path / name if path.is_dir() else path
            such = " or ".join(f"{at}{suffix}" for suffix in target.suffixes)
            raise IcmjError(f"{option}: looks like a folder, and a file is meant; give one, such as {such}")


def _target(hint: Any) -> Target | None:
    """The note on what is written in the type of an option, if there is one."""
    if get_origin(hint) is Annotated:
        hint, *notes = get_args(hint)
        return next((note for note in notes if isinstance(note, Target)), None) or _target(hint)
    return next(filter(None, map(_target, get_args(hint))), None) if get_origin(hint) in (Union, UnionType) else None


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
    """Values of the run file changed for once; :func:`icmj.runfile.schema.overridden` puts them in."""

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
    if (target := _target(hint)) is not None:
        return "FILE" if target.suffixes else "FOLDER"
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


@dataclass(frozen=True)
class Cases(Shared):
    """List the cases, rival controllers, sweeps, experiments and families that come with icmj.

    Example: icmj cases
    """

    json: bool = False
    """Print JSON instead of a list."""


@dataclass(frozen=True)
class New(Shared):
    """Write a commented file to begin with, or copy a shipped one and its models.

    A run file for a model; a sweep, experiment or family file for a run file; a table of recordings for icmj fit.

    Example: icmj new body.xml --out body.toml
    """

    what: tyro.conf.Positional[Path]
    """Kind of file: run, sweep, experiment, family or recordings. Or an MJCF file, for which a run file is written; or
    the name of a shipped model, case, sweep, experiment or family."""
    of: tyro.conf.Positional[tuple[Path, ...]] = ()
    """What the file is for: a model (run), a run file or shipped case (sweep, experiment, family), or recordings
    (default: a shipped model or case)."""
    stimulus: Literal["quiet_standing", "perturbed_stance", "multisine", "double_step", "intersection_point"] = (
        "quiet_standing"
    )
    """Kind of experiment."""
    out: Annotated[Path, Target((".toml", ".csv"))] | None = None
    """File to write (default: the name of the model or kind, in this folder). An existing file is never overwritten."""
    keyframe: str | None = None
    """Keyframe of the operating point of a run (default: the first at which the model is at rest)."""


@dataclass(frozen=True)
class Person(Shared):
    """Scale the three-link model to the height and mass of a person, and write it.

    Example: icmj person three_link --height 1.65 --mass 60 --out person.xml
    """

    model: tyro.conf.Positional[Path]
    """MJCF file with the bodies shank, thigh and trunk, or name of a shipped model."""
    height: float = 1.80
    """Height of the person [m]."""
    mass: float = 80.0
    """Mass of the person [kg]."""
    out: Annotated[Path, Target((".xml",))] = Path("person.xml")
    """MJCF file to write."""


@dataclass(frozen=True)
class Linearise(Shared):
    """Linearise an MJCF model by centred finite differences; print the matrices A, B, C and the poles.

    Example: icmj linearise three_link --keyframe upright
    """

    model: tyro.conf.Positional[Path]
    """MJCF file, or name of a shipped model."""
    keyframe: str | None = None
    """Keyframe of the operating point (default: the reference configuration)."""
    operating_point: Literal["as given", "static control", "balance"] | None = None
    """How the operating point is completed: as given, controls only, or controls and pose (default: as given for a
    keyframe; without one, as given if the model is at rest there, else balance).
    """
    free: tuple[str, ...] = ()
    """Joints that may move to complete the pose with --operating-point balance (default: all)."""
    outputs: tuple[str, ...] = ()
    """Sensors or joints to take as outputs; the word joints means all joints (default: all sensors)."""
    json: bool = False
    """Print JSON instead of tables."""
    full: bool = False
    """Print the matrices even if they are large."""
    out: Annotated[Path, Target((".npz",))] | None = None
    """File (.npz) for A, B, C, poles, names and units."""


@dataclass(frozen=True)
class Schema(Shared):
    """Print the JSON Schema of run, sweep, experiment or family files; editors use it to complete and check them.

    Example: icmj schema run --out run.schema.json
    """

    kind: tyro.conf.Positional[Literal["run", "sweep", "experiment", "family"]] = "run"
    """Kind of file."""
    out: Annotated[Path, Target((".json",))] | None = None
    """File to write instead of printing."""


@dataclass(frozen=True)
class Export(Shared):
    """Export the signals of a log and, in a second file, its events for use in other tools.

    Units are in the header (CSV), in the metadata of each field (Parquet) or in a separate array (npz).

    Example: icmj export runs/out/three-link-0.9.mujoco.rrd --to csv --rate 100
    """

    log: tyro.conf.Positional[Path]
    """Log to read, folder of logs, or name of a case with logs in runs/out."""
    to: Literal["csv", "parquet", "npz"] | None = None
    """Format (default: the one that --out ends in, else csv)."""
    rate: float | None = None
    """Rate of evenly spaced rows [Hz] (default: the rows as recorded, which include every event)."""
    out: Annotated[Path, Target((".csv", ".parquet", ".npz"))] | None = None
    """File to write, for one log (default: beside the log, with its name). The file of events has ".events" added to
    its name.
    """


@dataclass(frozen=True)
class Measure(Shared):
    """Measure sway: RMS, speed, range, prediction ellipse, frequencies, stabilogram diffusion.

    In a log, the centre of pressure is measured if the body stands on a floor, else the outputs; in a table (CSV,
    Parquet, npz, OpenSim's mot and sto), all columns; in a C3D file, the centre of pressure of its force plates, else
    its points. Two columns with the same unit are also measured together, as the path of a point in a plane.

    Example: icmj measure sway.csv --columns ap ml --rate 100
    """

    file: tyro.conf.Positional[Path]
    """Log, folder of logs, name of a case with logs in runs/out, or file of time series."""
    columns: tuple[str, ...] = ()
    """Columns to measure (default: see above)."""
    rate: float | None = None
    """Rate to resample to (default: 100 for a log), or the rate of a file without times [Hz]."""
    since: float | None = None
    """Time from which the series are measured [s] (default: all rows, those before 0 too)."""
    low_pass: float | None = None
    """Corner frequency of a low-pass filter applied before all measures [Hz]."""
    band: tuple[float, float] | None = None
    """Lowest and highest frequency of the spectral measures [Hz] (default: all frequencies)."""
    torque: str | None = None
    """Column of the ankle torque, from which the centre of pressure is computed."""
    weight: float | None = None
    """Vertical force on the foot [N], for --torque."""
    json: bool = False
    """Print JSON, in the units of the file, instead of a table."""


@dataclass(frozen=True)
class Fit(Shared):
    """Fit families of controllers to recordings of standing people (exploratory): parameters, reliability, comparison.

    Needs pip install 'icmj[fit]'. Each family is simulated, and its network trained, only once for all people.

    Example: icmj fit anna-1.csv anna-2.csv anna-3.csv --model event --model switching --out runs/out/anna
    """

    recordings: tyro.conf.Positional[tuple[Path, ...]] = ()
    """Recordings of one person (CSV, Parquet, npz, C3D), each of one trial or several."""
    model: Annotated[tyro.conf.UseAppendAction[tuple[Path, ...]], tyro.conf.arg(metavar="FAMILY")] = ()
    """Family file, or name of a shipped family. May be repeated; the families are then compared, which depends
    on the noise that they assume."""
    table: Path | None = None
    """CSV table that lists the recordings of several people, instead of RECORDINGS (required columns: file and person;
    optional columns: column, group and condition); or BDSinfo.txt of the public data set (Santos and Duarte 2016),
    beside its trials."""
    columns: tuple[str, ...] = ()
    """Columns of the recordings that hold the front-to-back centre of pressure, one column for each trial."""
    unit: Literal["m", "cm", "mm"] | None = None
    """Unit of recordings that do not state one."""
    rate: float | None = None
    """Rate of recordings without times [Hz]."""
    hold_out: int = 0
    """Number of trials of each person, counted from the last, that are predicted instead of fitted."""
    out: Folder = RESULTS / "fit"
    """Folder for posteriors (netCDF, for ArviZ), tables, figures and page. The same command resumes a fit."""
    trained: Folder = RESULTS / "families"
    """Folder for simulated and trained families, which are reused for all people."""
    simulations: int = 6000
    """Number of draws from the prior of each family that are simulated to train its network."""
    draws: int = 2000
    """Number of draws from each posterior."""
    seed: int = 0
    """Seed of all random numbers."""
    jobs: int | None = None
    """Number of processes (default: one per core)."""
    dask: str | None = None
    """Address of a Dask scheduler whose workers run the simulations instead of local processes."""
    allow_code: bool = False
    """Run Python code that the run files of families name as module:name. Read the code first."""
    json: bool = False
    """Print JSON instead of tables."""


@dataclass(frozen=True)
class Sweep(Shared):
    """Compute a case at many points of its parameters and write Parquet files; an interrupted sweep can be resumed.

    Example: icmj sweep validity --out runs/out/validity
    """

    sweep: tyro.conf.Positional[Path]
    """Sweep file, or name of a shipped sweep."""
    out: Folder | None = None
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
    """Logs, folders of logs, names of cases with logs in runs/out, or files of event times or outputs."""
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
    out: Folder | None = None
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
    out: Folder = RESULTS
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
    out: Folder = RESULTS
    """Folder for the log, which is named CASE.PLANT.rrd."""
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
    out: Folder = RESULTS
    """Folder for the branches (Parquet, logs) and figures (PDF, SVG)."""


@dataclass(frozen=True)
class Report(Shared):
    """Build the comparison report from logs.

    Example: icmj report runs/out/simple-0.8.linear.rrd runs/out/simple-0.8.mujoco.rrd --out report.html
    """

    logs: tyro.conf.Positional[tuple[Path, ...]]
    """Logs, folders of logs or of sweeps, names of cases with logs in runs/out, or branches of cycles (Parquet). Logs
    of one case on both plants are shown together.
    """
    out: Page | None = None
    """HTML page to write; its figures go into a folder beside it (default: report.html, in the folder of logs if one is
    given).
    """
    json: bool = False
    """Print JSON instead of a table."""


@dataclass(frozen=True)
class Replay(Shared):
    """Open a log in the rerun viewer, serve it to a browser on this machine, or render a picture of it.

    Example: icmj replay runs/out/three-link-0.9.mujoco.rrd --screenshot pose.png --time 20
    """

    log: tyro.conf.Positional[Path]
    """Log to show, folder of logs, or name of a case with logs in runs/out; a picture is of one log, of a case that in
    MuJoCo. A truncated log is shown as far as it can be read.
    """
    web: bool = False
    """Serve the log to a browser on this machine (loopback address only), and print the address."""
    screenshot: Annotated[Path, Target((".png",))] | None = None
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
    out: Annotated[Page, tyro.conf.arg(aliases=("-o",))] = Path("live.html")
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
