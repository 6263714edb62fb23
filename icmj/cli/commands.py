"""What each command does and shows; see :mod:`icmj.cli.arguments` for their arguments.

What ``icmj identify`` does and shows.

What ``icmj sweep`` does and shows.
"""

from __future__ import annotations

from collections import Counter
from contextlib import nullcontext
from functools import singledispatch
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from icmj.base.files import discard_if_failed, replaceable, write_text
from icmj.base.interruption import interrupt_once
from icmj.base.numbers import amount, amounts, count, lapse, number, plain, root
from icmj.base.process import meanwhile
from icmj.cli import arguments, files
from icmj.cli.printing import plain_runs, say_changes, show_comparisons, spread_in_words, spread_of
from icmj.cli.progress import Working
from icmj.cli.table import Column, show_table
from icmj.cli.terminal import ERR, OUT
from icmj.errors import IdentificationError, RunFileError, SweepError

if TYPE_CHECKING:
    from icmj.base.array import Array
    from icmj.case.case import PlantKind
    from icmj.case.result import PredictedResult, Result
    from icmj.cli.arguments import IdentifyCommand, SweepCommand
    from icmj.cli.terminal import Terminal
    from icmj.fitting.identification import Identification
    from icmj.fitting.observed import Observed
    from icmj.fitting.unknown import Unknown
    from icmj.runfile.schema import RunFile
    from icmj.study.page import Page
    from icmj.study.plan import Plan
    from icmj.study.sweep import Progress

CROSSINGS = (
    Column("Δ (s)"), Column("eigenvalue"), Column("kind", rank=2), Column("direction", rank=1),
    Column("largest other |λ|"),
)  # fmt: skip
ORBITS = (
    Column("Δ (s)"), Column("λ"), Column("period (s)", rank=2), Column("γ", rank=2), Column("peaks", rank=1),
    Column("largest multiplier"), Column("verdict"),
)  # fmt: skip
TOLD = 10.0  # s of estimated work that is announced


@singledispatch
def execute(command: object) -> None:
    """Carry out one parsed command."""
    raise TypeError(f"no command {type(command).__name__}")


execute.register(files.cases)
execute.register(files.new)
execute.register(files.schema)
execute.register(files.measure)
execute.register(files.experiment)
execute.register(files.fit)


@execute.register
def study(command: arguments.StudyCommand) -> None:
    """Run the study with a progress bar; print the table and where the files are."""
    from icmj.study.estimate import LONGEST
    from icmj.study.run_files import find_runs
    from icmj.study.study import run_study

    if command.jobs is not None and command.jobs < 1:
        raise RunFileError(f"--jobs {command.jobs}: expected at least 1")
    runs = find_runs(command.runs, command.set, allow_code=command.allow_code)
    with Working("study", ERR) as working:
        longest = None if command.yes else LONGEST
        outputs = run_study(runs, command.out, jobs=command.jobs, progress=working.tell, longest=longest)
    if command.json:
        record = plain_runs((*outputs.page.comparisons, *outputs.page.others), logs=outputs.logs, report=outputs.report)
        OUT.show(record | {"summary": str(outputs.summary)})
        return
    _tell_page(outputs.page, bool(command.set))
    size = sum(log.stat().st_size for log in outputs.logs) / 1e6
    count = f"{len(outputs.logs)} logs, {size:.0f} MB together," if len(outputs.logs) > 1 else f"1 log, {size:.0f} MB,"
    OUT.say(f"{count} in {command.out}", wrap=False)
    OUT.say(f"report   {outputs.report}", wrap=False)
    OUT.say(f"summary  {outputs.summary}", wrap=False)


@execute.register
def analyse(command: arguments.AnalyseCommand) -> None:
    """Print the prediction for one run file."""
    from icmj.case.case import prepare
    from icmj.cli.printing import plain_prediction, plain_spread, show_roots, standing_in_words
    from icmj.runfile.reading import load_run
    from icmj.runfile.schema import overridden
    from icmj.theory.prediction import PREDICTION

    run = overridden(load_run(command.run, allow_code=command.allow_code), command.set)
    with Working(label := f"analysing {run.case.name}", ERR) as working:
        case = prepare(run, progress=lambda done: working.tell(label, done))
    prediction, plant = case.prediction, case.assumed.linearisation.plant
    if prediction is None:
        show_roots(case, command.json)
        return
    outputs, units = plant.outputs, plant.output_units or ("",) * plant.n_y
    if command.json:
        OUT.show(plain_prediction(prediction, outputs, case.notices) | plain_spread(spread_of(case)))
        return
    rows = []
    for fact in PREDICTION:
        value = fact.value(prediction)
        if fact.kind != "outputs":
            rows.append((fact.label, fact.shown(value)))
        elif value is not None:
            each = zip(outputs, value, units, strict=True)
            rows += [(fact.label_of(name), amount(float(peak), unit)) for name, peak, unit in each]
    show_table((Column(""), Column("")), rows, OUT, title=run.title)
    say_changes(run, OUT)
    found = [
        (number(c.delta, 6), root(c.eigenvalue), c.kind, c.direction, amount(c.largest_other, figures=4))
        for c in prediction.crossings
    ]
    if found:
        show_table(CROSSINGS, found, OUT, title=f"Unit-circle crossings up to {prediction.delta_max:g} s")
    else:
        OUT.say(f"No unit-circle crossing up to {prediction.delta_max:g} s.")
    if prediction.others:
        orbits = [
            (
                number(one.orbit.delta, 6), root(one.crossing.eigenvalue), number(one.orbit.period, 6),
                number(one.orbit.gamma), amounts(one.orbit.y_peak, outputs, units), number(one.multiplier),
                f"{one.verdict}: {one.orbit.reason}" if one.orbit.reason else one.verdict,
            )
            for one in prediction.orbits
        ]  # fmt: skip
        show_table(ORBITS, orbits, OUT, title="Orbits, one for each crossing at ±1")
    if prediction.beyond is not None:
        OUT.say(f"A quick look further shows one at {prediction.beyond.delta:.4g} s: raise analysis.delta_max.")
    OUT.say(standing_in_words(prediction))
    if spread := spread_in_words(spread_of(case)):
        OUT.say(spread)
    for words in prediction.remarks:
        OUT.say(words[0].upper() + words[1:] + ".")
    for notice in case.notices:
        if not (command.set and notice.kind == "paper") and notice.words not in prediction.remarks:
            OUT.note(notice)


@execute.register
def run(command: arguments.RunCommand) -> None:
    """Simulate one case, write its log, and print the result beside the prediction if there is one."""
    from icmj.case.case import prepare
    from icmj.runfile.reading import load_run
    from icmj.runfile.schema import overridden
    from icmj.study.estimate import LONGEST
    from icmj.study.study import admit, open_folder, plants_of, run_case

    run_file = overridden(load_run(command.run, allow_code=command.allow_code), command.set)
    name, plant = run_file.case.name, command.plant or plants_of(run_file)[-1]
    with Working(name, ERR) as working:
        case = prepare(run_file)
        seconds = admit(case, plant, None if command.yes else LONGEST, study=command.study)
        if seconds > TOLD:
            ERR.say(f"icmj: about {lapse(seconds)} of work")
        log = command.out / f"{name}.{plant}.rrd"
        meanwhile("icmj.log.writer")
        with discard_if_failed(command.out), interrupt_once() as heard:
            open_folder(command.out, log.name)
            result = run_case(case, plant, lambda done: working.tell(name, done), study=command.study)
            working.tell("writing the log", 0.95)
            from icmj.log.writer import write_log  # by now it has been imported meanwhile

            with heard.postpone():
                write_log(result, log)
    outcome = result.simulation.outcome
    if command.json:
        OUT.show(plain_runs([result], logs=(log,)) | {"outcome": plain({"kind": outcome.kind, "t": outcome.t})})
    else:
        spread = spread_of(case)
        _tell_run(result, log, bool(command.set), "" if isinstance(spread, str) else spread_in_words(spread))
    if outcome.kind == "interrupted":
        raise KeyboardInterrupt


def _tell_page(page: Page, changed: bool = False) -> None:
    """Print the contents of a report: a table of runs with a prediction, and one sentence for each other run."""
    if page.comparisons:
        show_comparisons(page.comparisons, OUT, changed=changed)
    for other in page.others:
        changes = f" {other.run.changes_in_words}" if other.run.changes else ""
        OUT.say(f"{other.run.case.name} ({other.simulation.plant}): {other.words}{changes}")


def _tell_run(result: Result, log: Path, changed: bool, spread: str = "") -> None:
    """What a run did, in a table and in words, beside the predicted spread of its intervals if there is one."""
    from icmj.case.comparison import compare
    from icmj.case.result import has_prediction
    from icmj.simulation.simulation import relative_error

    if has_prediction(result):
        show_comparisons([compare(result)], OUT, changed=changed)
        OUT.say(f"The run {result.simulation.outcome.message}, with {count(len(result.simulation.events), 'event')}.")
        OUT.say(result.words)
        if spread:
            OUT.say(spread)
        OUT.say(_peaks(result))
    else:
        for notice in result.notices:
            OUT.note(notice)
        OUT.say(f"{result.words} {result.run.changes_in_words}".strip())
    for name, value in result.measures.items():
        OUT.say(f"{name}: {amount(value)}")
    for words in result.simulation.pressure.words if result.simulation.pressure else ():
        OUT.say(f"{words[0].upper()}{words[1:]}.")
    if (error := relative_error(result.simulation)) > 0:
        OUT.say(f"Relative error by the step: {error:.1g}.")
    OUT.say(f"log   {log}", wrap=False)
    OUT.say(f"show  icmj replay {log}", wrap=False)


def _peaks(result: PredictedResult) -> str:
    """The largest values of the outputs, with those of the predicted cycle, if there is one, in brackets."""
    from icmj.case.laid_orbit import beside
    from icmj.case.quantity import quantities

    def shown(values: Array, i: int) -> str:
        unit = units[i].unit
        text = amount(units[i].factor * float(values[i]), "" if unit == "deg" else unit, 4)
        return f"{text}°" if unit == "deg" else text

    units, names = quantities(result.actual), result.actual.outputs
    found, prediction = result.measurement.amplitude, beside(result.prediction, result.measurement)
    cycle = prediction.amplitude if prediction.cycle else None
    peaks = [
        f"{name} {shown(found, i)}" + ("" if cycle is None else f" ({shown(cycle, i)})") for i, name in enumerate(names)
    ]
    return f"Peaks{'' if cycle is None else ', predicted ones in brackets'}: {', '.join(peaks)}."


@execute.register
def live(command: arguments.LiveCommand) -> None:
    """Write the page of one case."""
    from icmj.case.case import prepare
    from icmj.report.live import build_live
    from icmj.runfile.reading import load_run
    from icmj.runfile.schema import overridden

    replaceable(command.out)
    run = overridden(load_run(command.run, allow_code=command.allow_code), command.set)
    with Working(label := f"predicting {run.case.name}", ERR) as working:
        build_live(prepare(run), command.out, progress=lambda done: working.tell(label, done))
    OUT.say(f"page  {command.out}", wrap=False)


@execute.register
def report(command: arguments.ReportCommand) -> None:
    """Build the report page from logs."""
    from icmj.cycle.branch import branches_among
    from icmj.log.selection import find_logs
    from icmj.study.page import report as build
    from icmj.work.workers import Workers, processors

    swept = [path for path in command.logs if (path / "sweep.json").exists()]
    others = [path for path in command.logs if path not in swept]
    home = others[0] if len(others) == 1 and others[0].is_dir() else Path()
    out = home / "report.html" if command.out is None else command.out
    replaceable(out)
    with Working(label := "building the report", ERR) as working, Workers(processors()) as workers:
        sweeps = []
        if swept:
            from icmj.study.sweep_folder import read_sweep

            sweeps = [read_sweep(folder) for folder in swept]
        branches, logs = branches_among(find_logs(others, arguments.RESULTS))
        page = build(
            logs, out, sweeps=sweeps, branches=branches, workers=workers,
            progress=lambda done: working.tell(label, done),
        )  # fmt: skip
    if command.json:
        OUT.show(plain_runs((*page.comparisons, *page.others), report=out))
        return
    _tell_page(page)
    OUT.say(f"report  {out}", wrap=False)


@execute.register
def export(command: arguments.ExportCommand) -> None:
    """Write rows and events of logs, say where they are."""
    from icmj.errors import DataError
    from icmj.log.selection import find_logs

    logs = find_logs([command.log], arguments.RESULTS)
    if len(logs) > 1 and command.out is not None:
        raise DataError(
            f"--out {command.out}: {len(logs)} logs are exported, each beside itself; give one, or no --out"
        )
    for log in logs:
        _export(log, command)


def _export(log: Path, command: arguments.ExportCommand) -> None:
    from icmj.errors import DataError
    from icmj.log.reader import read_log
    from icmj.series.writing import find_writers, write_series

    out = log.with_suffix(f".{command.to or 'csv'}") if command.out is None else command.out
    if out.suffix not in ([f".{command.to}"] if command.to else find_writers()):
        expected = f".{command.to}, as --to says" if command.to else ", ".join(find_writers())
        raise DataError(f"--out {out}: expected a name that ends in {expected}")
    events_out = out.with_suffix(f".events{out.suffix}")
    replaceable(out, events_out)
    with Working(f"exporting {log.name}", ERR):
        result = read_log(log)
        rows, events = result.to_series(command.rate), result.events_to_series()
        write_series(rows, out)
        write_series(events, events_out)
    for what, series, path in (("rows", rows, out), ("events", events, events_out)):
        size = f"{len(series)} rows, {len(series.names)} signals"
        OUT.say(f"{what:<7} {path}  {size}", wrap=False)


@execute.register
def replay(command: arguments.ReplayCommand) -> None:
    """Open or serve logs, or picture one."""
    from icmj.log.replay import replay as show
    from icmj.log.selection import find_log, find_logs

    logs = (
        [find_log(command.log, arguments.RESULTS)]
        if command.screenshot
        else find_logs([command.log], arguments.RESULTS)
    )
    with Working(f"rendering {command.screenshot}", ERR) if command.screenshot else nullcontext():
        show(*logs, web=command.web, screenshot=command.screenshot, time=command.time, say=ERR.say)


@execute.register
def person(command: arguments.PersonCommand) -> None:
    """Write a person's model and say what it is."""
    from icmj.engine.plant import shape_to_person
    from icmj.plant.person import Person
    from icmj.work.shipped import model_file

    replaceable(command.out)
    measures = Person(command.height, command.mass)
    write_text(command.out, shape_to_person(model_file(command.model), measures))
    G = ", ".join(f"{value:.4g}" for value in measures.toppling_stiffness())
    OUT.say(f"toppling stiffness of ankle, knee and hip {G} N m/rad")
    OUT.say(f"model    {command.out}")


@execute.register
def linearise(command: arguments.LineariseCommand) -> None:
    """Linearise an MJCF model and print it."""
    from icmj.cli.printing import plain_linearisation, save_plant, show_plant
    from icmj.engine.plant import load_plant
    from icmj.plant.body import OperatingRule, Selection
    from icmj.work.shipped import model_file

    if command.out is not None:
        replaceable(command.out)
    chosen = "joints" if command.outputs == ("joints",) else command.outputs or None
    kind = command.operating_point or ("as given" if command.keyframe else "found")
    with Working(f"linearising {command.model.name}", ERR):
        loaded = load_plant(
            model_file(command.model),
            keyframe=command.keyframe,
            selection=Selection(outputs=chosen),
            operating=OperatingRule(kind, command.free),
        )
    linearisation = loaded.linearisation
    plant = linearisation.plant
    if command.out is not None:
        save_plant(plant, command.out)
    if command.json:
        OUT.show(plain_linearisation(linearisation, loaded.quality, loaded.told), indent=None)
        return
    show_plant(plant, OUT, full=command.full)
    for notice in (*loaded.told, *loaded.quality.notices):
        OUT.note(notice)
    if command.out is not None:
        OUT.say(f"matrices  {command.out}")


@execute.register
def sweep(command: arguments.SweepCommand) -> None:
    """Compute a case at very many points."""
    carry_out_sweep(command, OUT, ERR)


@execute.register
def identify(command: arguments.IdentifyCommand) -> None:
    """Estimate a model error from measured motion."""
    carry_out_identification(command, OUT, ERR)


def carry_out_identification(command: IdentifyCommand, out: Terminal, err: Terminal) -> None:
    """Say of each motion which value of the unknown made it."""
    from icmj.fitting.identification import identify
    from icmj.log.selection import find_logs

    if not command.motions:
        raise IdentificationError("no motion given: expected logs, or files of event times or outputs")
    found, motions = [], find_logs(command.motions, arguments.RESULTS)
    with Working("identifying", err) as working:
        for i, path in enumerate(motions):
            working.tell(f"identifying from {path.name}", i / len(motions))
            unknown, observed, plant = _read(command, path)
            observed = observed.with_errors(command.timing, command.reading)
            result = identify(unknown, observed, plant=plant)
            found.append((path, result))
    if command.json:
        out.show([_record(path, result) for path, result in found])
        return
    for path, result in found:
        name = f"{path.name}: " if len(found) > 1 else ""
        out.say(f"{name}{result.words}", wrap=False)


def _read(command: IdentifyCommand, path: Path) -> tuple[Unknown, Observed, PlantKind]:
    """The known run file, the observed motion, and its plant."""
    from icmj.fitting.observed import Observed, read_observed
    from icmj.log.reader import read_log
    from icmj.runfile.reading import load_run
    from icmj.runfile.schema import overridden

    given = (
        None if command.run is None else overridden(load_run(command.run, allow_code=command.allow_code), command.set)
    )
    if path.suffix == ".rrd":
        result = read_log(path)
        run = given or overridden(result.run, command.set)
        plant = command.plant or result.simulation.plant
        return _unknown(command, run), Observed.of_simulation(result.simulation), plant
    if given is None:
        raise IdentificationError(f"{path}: no log, so --run must say what is known of plant and controller")
    unknown = _unknown(command, given)
    outputs = unknown.checked().assumed.linearisation.plant.outputs
    return unknown, read_observed(path, tuple(outputs)), command.plant or "mujoco"


def _unknown(command: IdentifyCommand, run: RunFile) -> Unknown:
    from icmj.errors import ModelError
    from icmj.fitting.unknown import Unknown
    from icmj.plant.body import Change, What

    what, _, of = command.unknown.partition(" ")
    if not of and what not in get_args(What):
        return Unknown(run, what, low=command.low, high=command.high)
    try:
        change = Change(what, of.strip() or None, 1.0)  # type: ignore[arg-type]
    except ModelError as error:
        raise IdentificationError(f"--unknown {command.unknown}: {error}") from error
    return Unknown(run, "", change, command.low, command.high)


def _record(path: Path, result: Identification) -> dict[str, object]:
    return {
        "motion": str(path),
        "unknown": result.name,
        "value": result.value,
        "intervals": result.intervals,
        "way": result.way,
        "probability": result.probability,
        "edge": result.edge,
        "words": result.words,
    }


def carry_out_sweep(command: SweepCommand, out: Terminal, err: Terminal) -> None:
    """Carry out a sweep, or say what it would cost; what was finished stays, however it ends."""
    from icmj.study.sweep import carry_out as compute
    from icmj.study.sweep import make_plan

    if command.jobs is not None and command.jobs < 1:
        raise SweepError(f"--jobs {command.jobs}: expected at least 1")
    if command.jobs is not None and command.dask is not None:
        raise SweepError("--jobs and --dask: give one; the workers of a cluster are started with it")
    with Working("sweep", err) as working:
        plan = make_plan(command.sweep, allow_code=command.allow_code)
        folder = command.out or arguments.RESULTS / plan.file.sweep.name
        if command.dry_run:
            _cost(plan, out)
            return

        begun: list[Progress] = []

        def tell(progress: Progress) -> None:
            begun[:] = [progress]
            working.tell(_words(progress), progress.done / progress.points)

        try:
            done = compute(plan, folder, jobs=command.jobs, dask=command.dask, progress=tell)
        except BaseException as error:
            if begun or not isinstance(error, SweepError):  # else it refuses the folder, and goes on with nothing
                _report_left(plan, folder, err)
            raise
    _show(folder, done, out)


def _cost(plan: Plan, out: Terminal) -> None:
    from icmj.study.sweep_cost import estimate

    cost = estimate(plan)
    out.say(f"{cost.points} points in {cost.chunks} chunks of {plan.chunk}")
    out.say(
        f"about {lapse(cost.seconds)} of one core ({1e3 * cost.seconds / cost.points:.3g} ms a point), "
        f"{cost.size / 1e6:.3g} MB"
    )


def _report_left(plan: Plan, folder: Path, err: Terminal) -> None:
    """Say what an interrupted sweep left, if it had begun."""
    count = len(list((folder / "points").glob("*.parquet")))
    if count:
        err.say(f"icmj: {count} of {plan.chunks} chunks are finished in {folder}; the same command goes on", wrap=False)


def _show(folder: Path, done: Progress, out: Terminal) -> None:
    from icmj.study.sweep_folder import statuses

    found: Counter[str] = statuses(folder)
    bad = ", ".join(f"{count} {status}" for status, count in sorted(found.items()) if status != "ok")
    out.say(f"{done.points} points{f', of which {bad}' if bad else ''}")
    size = sum(path.stat().st_size for path in (folder / "points").iterdir()) / 1e6
    _show_rows(folder, out)
    out.say(f"dataset  {folder / 'points'} ({size:.3g} MB, Parquet; icmj.read_sweep or pandas.read_parquet reads it)")
    out.say(f"columns  their meanings are in {folder / 'sweep.json'}")
    out.say(f"next     icmj report {folder} --out {folder.name}.html", wrap=False)


SHOWN = 6  # points of a sweep that are printed
SUFFIXES = ("delta_crit", "verdict", "outcome", "interval", "error")


def _show_rows(folder: Path, out: Terminal) -> None:
    """The first points of a sweep, in the columns that matter most."""
    from itertools import islice

    from icmj.study.sweep_folder import Dataset

    dataset = Dataset(folder)
    facts = dataset.facts
    chunks = (table.slice(0, SHOWN).to_pylist() for _, table in dataset.chunks())
    rows = list(islice((row for chunk in chunks for row in chunk), SHOWN))
    matter = ("root_real", *(f"{of}_{suffix}" for of in ("predicted", "linear", "mujoco") for suffix in SUFFIXES))
    names = [name for name in matter if any(row.get(name) is not None for row in rows)]
    columns = [*map(Column, facts.varies), *(Column(name, rank=rank) for rank, name in enumerate(names, 1))]
    cells = [[_cell(row[name]) for name in (*facts.varies, *names)] for row in rows]
    title = facts.title or facts.name
    more = "" if len(rows) == facts.points else f"; the first {len(rows)} of {facts.points} points"
    show_table(columns, cells, out, title=f"{title}{more}", keys=len(facts.varies))


def _cell(value: object) -> str:
    if value is None or isinstance(value, float):
        return number(value)
    return str(value)


def _words(progress: Progress) -> str:
    failed = f", {progress.failed} failed" if progress.failed else ""
    return f"{progress.done} of {progress.points} points, {progress.rate:.3g}/s{failed}"
