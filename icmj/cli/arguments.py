"""The arguments of each command, whose docstrings are its help: the command line is made of these classes.

What several commands take: mix-ins of their arguments, and what all take.

The arguments of the commands that one begins with: models, run files and their schema.

The arguments of the commands that export and measure time series.

The arguments of the command that fits families of controllers to recordings.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, make_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_type_hints

from icmj.base.files import is_file_name
from icmj.errors import IcmjError
from icmj.study.kinds import KINDS

if TYPE_CHECKING:
    Stimulus = str
else:
    Stimulus = Literal[KINDS.names]

RESULTS = Path("runs/out")
"""The folder of results where none is given."""


@dataclass(frozen=True)
class Given:
    """How an argument is given on the command line, where its type does not say so: a note of ``Annotated``.

    Attributes:
        positional: whether it has no option.
        repeated: whether the option stands once for each value, instead of once before all of them.
        metavar: placeholder of a value in the help.
        name: of the option, where it is not that of the field.
        short: a second name of the option.
        meaning: what it is, where no docstring stands under the field.
        writes: what the path of something that is written may end in: of a file the usual ending first, of a folder
            none; ``None`` where nothing is written.
    """

    positional: bool = False
    repeated: bool = False
    metavar: str = ""
    name: str = ""
    short: str = ""
    meaning: str = ""
    writes: tuple[str, ...] | None = None


POSITIONAL, FOLDER, PAGE = Given(positional=True), Given(writes=()), Given(writes=(".html",))


def refuse_other_kind(command: object) -> None:
    """See that no name of a folder that is written looks like that of a file, nor the reverse, unless it is there.

    Raises:
        IcmjError: one line that says what to give instead.
    """
    for name, hint in get_type_hints(type(command), include_extras=True).items():
        path, given = (
            getattr(command, name),
            next((each for each in get_args(hint) if isinstance(each, Given)), Given()),
        )
        if given.writes is None or path is None:
            continue
        option = f"--{name.replace('_', '-')} {path}"
        if not given.writes and is_file_name(path) and not path.is_dir():
            raise IcmjError(f"{option}: looks like a file, and a folder is meant; give one, such as {path.stem}")
        if given.writes and (path.is_dir() or not (path.suffix or path.exists())):
            at, is_folder = (path / name, "a folder is there") if path.is_dir() else (path, "looks like a folder")
            such = " or ".join(f"{at}{suffix}" for suffix in given.writes)
            raise IcmjError(f"{option}: {is_folder}, and a file is meant; give one, such as {such}")


@dataclass(frozen=True, kw_only=True)
class Command:
    """A command of the program, and the options of every command."""

    quiet: Annotated[bool, Given(short="-q")] = False
    """Print results and errors only, without progress and notes."""
    verbose: Annotated[bool, Given(short="-v")] = False
    """Log every step to standard error, with the time."""

    @classmethod
    def complete(cls) -> type[Command]:
        """The command with the options that it takes of a list; most take none."""
        return cls

    @classmethod
    def extend(cls, options: Iterable[tuple[str, Any, str]]) -> type[Command]:
        """The command with further options, each with name, type and meaning, and ``None`` where it is not given."""
        new = [(name, Annotated[kind | None, Given(meaning=meaning)], None) for name, kind, meaning in options]
        return make_dataclass(cls.__name__, new, bases=(cls,), frozen=True, namespace={"__doc__": cls.__doc__})


@dataclass(frozen=True, kw_only=True)
class Overrides(Command):
    """Values of the run file changed for once; :func:`icmj.runfile.schema.overridden` puts them in."""

    set: Annotated[tuple[str, ...], Given(repeated=True, metavar="KEY=VALUE")] = ()
    """Replace a value of the run file for this run, as in --set actual.gain=0.85. May be repeated."""
    allow_code: bool = False
    """Run Python code that the run file names as module:name. Read the code first."""


@dataclass(frozen=True)
class CasesCommand(Command):
    """List the cases, rival controllers, sweeps, experiments and families that come with icmj.

    Example: icmj cases
    """

    json: bool = False
    """Print JSON instead of a list."""


@dataclass(frozen=True)
class NewCommand(Command):
    """Write a commented file to begin with, or copy a shipped one and its models.

    A run file for a model; a sweep, experiment or family file for a run file; a table of recordings for icmj fit.

    Example: icmj new body.xml --out body.toml
    """

    what: Annotated[Path, POSITIONAL]
    """Kind of file: run, sweep, experiment, family or recordings. Or an MJCF file, for which a run file is written; or
    the name of a shipped model, case, sweep, experiment or family."""
    of: Annotated[tuple[Path, ...], POSITIONAL] = ()
    """What the file is for: a model (run), a run file or shipped case (sweep, experiment, family), or recordings
    (default: a shipped model or case)."""
    stimulus: Stimulus = KINDS.names[0]
    """Kind of experiment."""
    out: Annotated[Path | None, Given(writes=(".toml", ".csv"))] = None
    """File to write (default: the name of the model or kind, in this folder). An existing file is never overwritten."""
    keyframe: str | None = None
    """Keyframe of the operating point of a run (default: the first at which the model is at rest)."""


@dataclass(frozen=True)
class PersonCommand(Command):
    """Scale the three-link model to the height and mass of a person, and write it.

    Example: icmj person three_link --height 1.65 --mass 60 --out person.xml
    """

    model: Annotated[Path, POSITIONAL]
    """MJCF file with the bodies shank, thigh and trunk, or name of a shipped model."""
    height: float = 1.80
    """Height of the person [m]."""
    mass: float = 80.0
    """Mass of the person [kg]."""
    out: Annotated[Path, Given(writes=(".xml",))] = Path("person.xml")
    """MJCF file to write."""


@dataclass(frozen=True)
class LineariseCommand(Command):
    """Linearise an MJCF model by centred finite differences; print the matrices A, B, C and the poles.

    Example: icmj linearise three_link --keyframe upright
    """

    model: Annotated[Path, POSITIONAL]
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
    out: Annotated[Path | None, Given(writes=(".npz",))] = None
    """File (.npz) for A, B, C, poles, names and units."""


@dataclass(frozen=True)
class SchemaCommand(Command):
    """Print the JSON Schema of run, sweep, experiment or family files; editors use it to complete and check them.

    Example: icmj schema run --out run.schema.json
    """

    kind: Annotated[Literal["run", "sweep", "experiment", "family"], POSITIONAL] = "run"
    """Kind of file."""
    out: Annotated[Path | None, Given(writes=(".json",))] = None
    """File to write instead of printing."""


@dataclass(frozen=True)
class ExportCommand(Command):
    """Export the signals of a log and, in a second file, its events for use in other tools.

    Units are in the header (CSV), in the metadata of each field (Parquet) or in a separate array (npz).

    Example: icmj export runs/out/three-link-0.9.mujoco.rrd --to csv --rate 100
    """

    log: Annotated[Path, POSITIONAL]
    """Log to read, folder of logs, or name of a case with logs in runs/out."""
    to: Literal["csv", "parquet", "npz"] | None = None
    """Format (default: the one that --out ends in, else csv)."""
    rate: float | None = None
    """Rate of evenly spaced rows [Hz] (default: the rows as recorded, which include every event)."""
    out: Annotated[Path | None, Given(writes=(".csv", ".parquet", ".npz"))] = None
    """File to write, for one log (default: beside the log, with its name). The file of events has ".events" added to
    its name.
    """


@dataclass(frozen=True)
class MeasureCommand(Command):
    """Measure sway: RMS, speed, range, prediction ellipse, frequencies, stabilogram diffusion.

    In a log, the centre of pressure is measured if the body stands on a floor, else the outputs; in a table (CSV,
    Parquet, npz, OpenSim's mot and sto), all columns; in a C3D file, the centre of pressure of its force plates, else
    its points. Two columns with the same unit are also measured together, as the path of a point in a plane.

    Example: icmj measure sway.csv --columns ap ml --rate 100
    """

    file: Annotated[Path, POSITIONAL]
    """Log, folder of logs, name of a case with logs in runs/out, or file of time series."""
    columns: tuple[str, ...] = ()
    """Columns to measure (default: see above)."""
    rate: float | None = None
    """Rate to resample to (default: 100 for a log), or the rate of a file without times [Hz]."""
    since: float | None = None
    """Time from which the series are measured [s] (default: all rows, those before 0 too)."""
    until: float | None = None
    """Time up to which they are measured [s]."""
    low_pass: float | None = None
    """Corner frequency of a low-pass filter applied before all measures [Hz]."""
    measure: Annotated[tuple[str, ...], Given(metavar="NAME")] = ()
    """Measures beside the standard ones: the module:name of your own, or the name of one that is not standard."""
    allow_code: bool = False
    """Run Python code that --measure names as module:name. Read the code first."""
    torque: str | None = None
    """Column of the ankle torque, from which the centre of pressure is computed."""
    weight: float | None = None
    """Vertical force on the foot [N], for --torque."""
    unit: str | None = None
    """Unit of the columns that do not state one, such as mm, or "N mm" for --torque."""
    json: bool = False
    """Print JSON, in the units of the file, instead of a table."""

    @classmethod
    def complete(cls) -> type[Command]:
        """With the options of the measures."""
        from icmj.measurement.measures import list_options

        return cls.extend([(one.name, one.kind, one.meaning) for one in list_options().values()])


@dataclass(frozen=True)
class FitCommand(Command):
    """Fit families of controllers to recordings of standing people (exploratory): parameters, reliability, comparison.

    Needs pip install -e '.[fit]' in a checkout. Each family is simulated, and its network trained, only once for all
    people.

    Example: icmj fit anna-1.csv anna-2.csv anna-3.csv --model event --model switching --out runs/out/anna
    """

    recordings: Annotated[tuple[Path, ...], POSITIONAL] = ()
    """Recordings of one person (CSV, Parquet, npz, C3D), each of one trial or several."""
    model: Annotated[tuple[Path, ...], Given(repeated=True, metavar="FAMILY")] = ()
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
    since: float | None = None
    """Time from which each recording is fitted [s] (default: all of it)."""
    until: float | None = None
    """Time up to which it is fitted [s]."""
    hold_out: int = 0
    """Number of trials of each person, counted from the last, that are predicted instead of fitted."""
    out: Annotated[Path, FOLDER] = RESULTS / "fit"
    """Folder for posteriors (netCDF, for ArviZ), tables, figures and page. The same command resumes a fit."""
    trained: Annotated[Path, FOLDER] = RESULTS / "families"
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
class SweepCommand(Command):
    """Compute a case at many points of its parameters and write Parquet files; an interrupted sweep can be resumed.

    Example: icmj sweep validity --out runs/out/validity
    """

    sweep: Annotated[Path, POSITIONAL]
    """Sweep file, or name of a shipped sweep."""
    out: Annotated[Path | None, FOLDER] = None
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
class IdentifyCommand(Overrides):
    """Estimate a model error and its uncertainty from a measured motion, or say that the motion does not determine it.

    The motion is a log; or, with --run, a file of event times, one per line, or of sampled outputs with their times.

    Example: icmj identify runs/out/three-link-0.9.mujoco.rrd
    """

    motions: Annotated[tuple[Path, ...], POSITIONAL]
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
class ExperimentCommand(Command):
    """Carry out a standard experiment on simulated cases or on recordings; an interrupted one can be resumed.

    Example: icmj experiment intersection-point --out runs/out/intersection-point
    """

    experiment: Annotated[Path, POSITIONAL]
    """Experiment file, or name of a shipped experiment."""
    out: Annotated[Path | None, FOLDER] = None
    """Folder for trials, results and figure (default: runs/out/NAME, of recordings
    runs/out/NAME-RECORDING). The same command resumes an interrupted
    experiment.
    """
    jobs: int | None = None
    """Number of processes (default: one per core)."""
    yes: bool = False
    """Also start trials that are estimated to take longer than a minute altogether."""
    recording: Annotated[tuple[Path, ...], Given(repeated=True, metavar="FILE")] = ()
    """Recording to analyse (CSV, Parquet, npz) instead of simulating the cases. Repeat the option for further
    trials of the same condition.
    """
    rate: float | None = None
    """Rate of a recording without times [Hz]."""
    since: float | None = None
    """Time from which each recording is analysed [s] (default: all of it, or what the experiment file says)."""
    until: float | None = None
    """Time up to which it is analysed [s]."""
    allow_code: bool = False
    """Run Python code that the experiment file or run files name as module:name. Read the code first."""
    json: bool = False
    """Print JSON instead of a table."""


@dataclass(frozen=True)
class StudyCommand(Overrides):
    """Simulate cases on the linear plant and in MuJoCo; write logs, report.html and summary.json.

    Example: icmj study --out runs/out
    """

    runs: Annotated[tuple[Path, ...], POSITIONAL] = ()
    """Run files, folders of run files, or names of shipped cases (default: the run files in the folder runs; if there
    are none, all shipped cases).
    """
    out: Annotated[Path, FOLDER] = RESULTS
    """Folder for the outputs."""
    jobs: int | None = None
    """Number of processes (default: one per core)."""
    yes: bool = False
    """Also run cases that are estimated to take longer than a minute."""
    json: bool = False
    """Print JSON instead of a table."""


@dataclass(frozen=True)
class AnalyseCommand(Overrides):
    """Predict by linear theory: critical open-loop interval, eigenvalues that cross the unit circle, limit cycle.

    For a controller that is not intermittent, the characteristic roots of its loop are computed instead; for one that
    switches, also how fast its motion grows.

    Example: icmj analyse simple-0.8 --json
    """

    run: Annotated[Path, POSITIONAL]
    """Run file, or name of a shipped case."""
    json: bool = False
    """Print JSON instead of a table."""


@dataclass(frozen=True)
class RunCommand(Overrides):
    """Simulate one case, write its log and compare the result with the prediction.

    The log contains this run alone. With --study it also contains what icmj study computes beside a prediction:
    continuous control, growth under clocks, and the amplitude law (MuJoCo) or other attractors (linear plant).

    Example: icmj run three-link-0.9 --plant mujoco --set actual.gain=0.85
    """

    run: Annotated[Path, POSITIONAL]
    """Run file, or name of a shipped case."""
    plant: Literal["linear", "mujoco"] | None = None
    """Plant to simulate (default: mujoco; linear if the run file gives matrices)."""
    out: Annotated[Path, FOLDER] = RESULTS
    """Folder for the log, which is named CASE.PLANT.rrd."""
    study: bool = False
    """Also compute what icmj study computes beside a prediction."""
    yes: bool = False
    """Run the case even if it is estimated to take longer than a minute."""
    json: bool = False
    """Print JSON instead of a table."""


@dataclass(frozen=True)
class CycleCommand(Overrides):
    """Find the periodic orbit, attracting or repelling, and its multipliers by Newton's method.

    Example: icmj cycle runs/simple-1.7.toml --plant mujoco
    """

    run: Annotated[Path, POSITIONAL]
    """Run file, or name of a shipped case."""
    plant: Literal["linear", "mujoco"] | None = None
    """Plant on which the orbit is found (default: mujoco; linear if the run file gives matrices)."""
    start: Literal["auto", "prediction", "simulation"] = "auto"
    """Initial guess: the predicted orbit, or the end of a simulation; auto uses the prediction if there is one."""
    json: bool = False
    """Print JSON instead of a table."""


@dataclass(frozen=True)
class ContinueCommand(Overrides):
    """Follow a cycle as a parameter varies, through folds, up to its end; write the branch and its figure.

    Example: icmj continue runs/simple-1.7.toml --parameter b --from 1.7 --to 1.2 --branches
    """

    run: Annotated[Path, POSITIONAL]
    """Run file, or name of a shipped case."""
    parameter: str
    """Parameter to vary: b (input gain), q_t (threshold), delay, delta_min (refractory period), rho (share of the
    changes of the plant), the factor of a change such as mass:trunk, or a dotted key of the run file.
    """
    to: float
    """Last value of the parameter."""
    from_: Annotated[float | None, Given(name="from")] = None
    """First value of the parameter (default: that of the run file)."""
    plant: Literal["linear", "mujoco"] | None = None
    """Plant whose cycle is followed (default: as for icmj cycle). With mujoco, the linear prediction is drawn, too."""
    start: Literal["auto", "prediction", "simulation"] = "auto"
    """Initial guess of the first cycle, as for icmj cycle."""
    points: int = 40
    """Minimum number of cycles on a branch that spans the whole range."""
    branches: bool = False
    """Also follow the branches that bifurcate from this one."""
    out: Annotated[Path, FOLDER] = RESULTS
    """Folder for the branches (Parquet, logs) and figures (PDF, SVG)."""


@dataclass(frozen=True)
class ReportCommand(Command):
    """Build the comparison report from logs.

    Example: icmj report runs/out/simple-0.8.linear.rrd runs/out/simple-0.8.mujoco.rrd --out report.html
    """

    logs: Annotated[tuple[Path, ...], POSITIONAL]
    """Logs, folders of logs or of sweeps, names of cases with logs in runs/out, or branches of cycles (Parquet). Logs
    of one case on both plants are shown together.
    """
    out: Annotated[Path | None, PAGE] = None
    """HTML page to write; its figures go into a folder beside it (default: report.html, in the folder of logs if one is
    given).
    """
    json: bool = False
    """Print JSON instead of a table."""


@dataclass(frozen=True)
class ReplayCommand(Command):
    """Open a log in the rerun viewer, serve it to a browser on this machine, or render a picture of it.

    Example: icmj replay runs/out/three-link-0.9.mujoco.rrd --screenshot pose.png --time 20
    """

    log: Annotated[Path, POSITIONAL]
    """Log to show, folder of logs, or name of a case with logs in runs/out; a picture is of one log, of a case that in
    MuJoCo. A truncated log is shown as far as it can be read.
    """
    web: bool = False
    """Serve the log to a browser on this machine (loopback address only), and print the address."""
    screenshot: Annotated[Path | None, Given(writes=(".png",))] = None
    """PNG file to render; no screen is needed."""
    time: float | None = None
    """Time of the screenshot [s]."""


@dataclass(frozen=True)
class LiveCommand(Overrides):
    """Write a page that simulates one case live in a browser, with sliders for b, threshold, delay and noise.

    The page is one file that needs no network and no installation. Its sliders start at the values of the run file.

    Example: icmj live three-link-0.9 -o live.html
    """

    run: Annotated[Path, POSITIONAL]
    """Run file, or name of a shipped case."""
    out: Annotated[Path, Given(short="-o", writes=(".html",))] = Path("live.html")
    """HTML page to write."""


GROUPS: dict[str, tuple[type[Command], ...]] = {
    "Begin": (CasesCommand, NewCommand, PersonCommand, LineariseCommand, SchemaCommand),
    "Predict": (AnalyseCommand, CycleCommand, ContinueCommand),
    "Simulate": (RunCommand, StudyCommand, LiveCommand, SweepCommand, ExperimentCommand),
    "Use the logs": (ReportCommand, ReplayCommand, ExportCommand, MeasureCommand, IdentifyCommand, FitCommand),
}


def name_command(cls: type[Command]) -> str:
    """The word by which a command is called."""
    return cls.__name__.removesuffix("Command").lower()


COMMANDS: dict[str, type[Command]] = {name_command(cls): cls for group in GROUPS.values() for cls in group}

DESCRIPTION = """Event-driven intermittent control of human standing: predict limit cycles from the linear theory,
simulate them on the linear plant and in MuJoCo, and compare."""
