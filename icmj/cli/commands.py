"""What each command does and shows; see :mod:`icmj.cli.arguments` for their arguments."""

from __future__ import annotations

from functools import singledispatch
from typing import TYPE_CHECKING

from icmj.base.card import plain
from icmj.base.files import emptied, replaceable, write_text
from icmj.base.imports import meanwhile
from icmj.base.numbers import amount, count, lapse, number, root
from icmj.base.signals import heard_once
from icmj.cli import arguments, experimenting, fitting, series_commands, starting, starting_arguments
from icmj.cli.comparison_table import show_comparisons
from icmj.cli.records import plain_runs
from icmj.cli.tables import Column, show_table
from icmj.cli.terminal import ERR, OUT
from icmj.cli.working import Working
from icmj.errors import RunFileError

if TYPE_CHECKING:
    from pathlib import Path

    from icmj.base.array import Array
    from icmj.result.result import PredictedResult, Result
    from icmj.study.page import Page

CROSSINGS = (
    Column("Δ (s)"), Column("eigenvalue"), Column("kind", rank=2), Column("direction", rank=1),
    Column("largest other |λ|"),
)  # fmt: skip
TOLD = 10.0  # s of estimated work that is announced


@singledispatch
def execute(command: object) -> None:
    """Carry out one parsed command."""
    raise TypeError(f"no command {type(command).__name__}")


execute.register(starting.cases)
execute.register(starting.new)
execute.register(starting.schema)
execute.register(series_commands.export)
execute.register(series_commands.measure)
execute.register(series_commands.replay)
execute.register(experimenting.experiment)
execute.register(fitting.fit)


@execute.register
def study(command: arguments.Study) -> None:
    """Run the study with a progress bar; print the table and where the files are."""
    from icmj.study.estimate import LONGEST
    from icmj.study.study import find_runs, run_study

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
def analyse(command: arguments.Analyse) -> None:
    """Print the prediction for one run file."""
    from icmj.case.case import prepare
    from icmj.cli.records import plain_prediction
    from icmj.cli.switched import show_roots
    from icmj.runfile.overrides import overridden
    from icmj.runfile.reading import load_run
    from icmj.theory.facts import PREDICTION

    run = overridden(load_run(command.run, allow_code=command.allow_code), command.set)
    with Working(label := f"analysing {run.case.name}", ERR) as working:
        case = prepare(run, progress=lambda done: working.tell(label, done))
    prediction, plant = case.prediction, case.assumed.linearisation.plant
    if prediction is None:
        show_roots(case, command.json)
        return
    outputs, units = plant.outputs, plant.output_units or ("",) * plant.n_y
    if command.json:
        OUT.show(plain_prediction(prediction, outputs, case.notices))
        return
    rows = []
    for fact in PREDICTION:
        value = fact.value(prediction)
        if fact.kind != "outputs":
            rows.append((fact.label, fact.shown(value)))
        elif value is not None:
            each = zip(outputs, value, units, strict=True)
            rows += [(fact.label_of(name), amount(float(peak), unit)) for name, peak, unit in each]
    show_table((Column(""), Column("")), rows, OUT, title=run.case.title)
    found = [
        (number(c.delta, 6), root(c.eigenvalue), c.kind, c.direction, amount(c.largest_other, figures=4))
        for c in prediction.crossings
    ]
    if found:
        show_table(CROSSINGS, found, OUT, title=f"Unit-circle crossings up to {prediction.delta_max:g} s")
    else:
        OUT.say(f"No unit-circle crossing up to {prediction.delta_max:g} s.")
    if prediction.beyond is not None:
        OUT.say(f"A quick look further shows one at {prediction.beyond.delta:.4g} s: raise analysis.delta_max.")
    for words in prediction.remarks:
        OUT.say(words[0].upper() + words[1:] + ".")
    for notice in case.notices:
        if not (command.set and notice.kind == "paper"):
            OUT.note(notice)


@execute.register
def run(command: arguments.Run) -> None:
    """Simulate one case, write its log, and print the result beside the prediction if there is one."""
    from icmj.case.case import prepare
    from icmj.runfile.overrides import overridden
    from icmj.runfile.reading import load_run
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
        with emptied(command.out), heard_once() as heard:
            open_folder(command.out, log.name)
            result = run_case(case, plant, lambda done: working.tell(name, done), study=command.study)
            working.tell("writing the log", 0.95)
            from icmj.log.writer import write_log  # by now it has been imported meanwhile

            with heard.postponed():
                write_log(result, log)
    outcome = result.simulation.outcome
    if command.json:
        OUT.show(plain_runs([result], logs=(log,)) | {"outcome": plain({"kind": outcome.kind, "t": outcome.t})})
    else:
        _tell_run(result, log, bool(command.set))
    if outcome.kind == "interrupted":
        raise KeyboardInterrupt


def _tell_page(page: Page, changed: bool = False) -> None:
    """Print the contents of a report: a table of runs with a prediction, and one sentence for each other run."""
    if page.comparisons:
        show_comparisons(page.comparisons, OUT, changed=changed)
    for other in page.others:
        OUT.say(f"{other.run.case.name} ({other.simulation.plant}): {other.words}")


def _tell_run(result: Result, log: Path, changed: bool) -> None:
    """What a run did, in a table and in words."""
    from icmj.comparison.comparison import compare
    from icmj.result.result import has_prediction
    from icmj.simulation.remarks import relative_error

    if has_prediction(result):
        show_comparisons([compare(result)], OUT, changed=changed)
        OUT.say(f"The run {result.simulation.outcome.message}, with {count(len(result.simulation.events), 'event')}.")
        OUT.say(result.words)
        OUT.say(_peaks(result))
    else:
        for notice in result.notices:
            OUT.note(notice)
        OUT.say(result.words)
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
    from icmj.view.quantity import quantities

    def shown(values: Array, i: int) -> str:
        unit = units[i].unit
        text = amount(units[i].factor * float(values[i]), "" if unit == "deg" else unit, 4)
        return f"{text}°" if unit == "deg" else text

    units, names = quantities(result.actual), result.actual.outputs
    found, cycle = result.measurement.amplitude, result.prediction.amplitude if result.prediction.cycle else None
    peaks = [
        f"{name} {shown(found, i)}" + ("" if cycle is None else f" ({shown(cycle, i)})") for i, name in enumerate(names)
    ]
    return f"Peaks{'' if cycle is None else ', predicted ones in brackets'}: {', '.join(peaks)}."


@execute.register
def live(command: arguments.Live) -> None:
    """Write the page of one case."""
    from icmj.case.case import prepare
    from icmj.report.live import build_live
    from icmj.runfile.overrides import overridden
    from icmj.runfile.reading import load_run

    replaceable(command.out)
    run = overridden(load_run(command.run, allow_code=command.allow_code), command.set)
    with Working(label := f"predicting {run.case.name}", ERR) as working:
        build_live(prepare(run), command.out, progress=lambda done: working.tell(label, done))
    OUT.say(f"page  {command.out}", wrap=False)


@execute.register
def report(command: arguments.Report) -> None:
    """Build the report page from logs."""
    from icmj.cycle.branch import branches_among
    from icmj.study.page import report as build
    from icmj.work.workers import Workers, processors

    replaceable(command.out)
    with Working(label := "building the report", ERR) as working, Workers(processors()) as workers:
        folders = [path for path in command.logs if path.is_dir()]
        sweeps = []
        if folders:
            from icmj.sweeps.dataset import read_sweep

            sweeps = [read_sweep(folder) for folder in folders]
        branches, logs = branches_among([path for path in command.logs if path not in folders])
        page = build(
            logs, command.out, sweeps=sweeps, branches=branches, workers=workers,
            progress=lambda done: working.tell(label, done),
        )  # fmt: skip
    if command.json:
        OUT.show(plain_runs((*page.comparisons, *page.others), report=command.out))
        return
    _tell_page(page)
    OUT.say(f"report  {command.out}", wrap=False)


@execute.register
def person(command: starting_arguments.Person) -> None:
    """Write a person's model and say what it is."""
    from icmj.engine.plant import shaped
    from icmj.plant.person import Person
    from icmj.work.shipped import model_file

    replaceable(command.out)
    measures = Person(command.height, command.mass)
    write_text(command.out, shaped(model_file(command.model), measures))
    G = ", ".join(f"{value:.4g}" for value in measures.toppling_stiffness())
    OUT.say(f"toppling stiffness of ankle, knee and hip {G} N m/rad")
    OUT.say(f"model    {command.out}")


@execute.register
def linearise(command: starting_arguments.Linearise) -> None:
    """Linearise an MJCF model and print it."""
    from icmj.cli.matrices import save_plant, show_plant
    from icmj.cli.records import plain_linearisation
    from icmj.engine.plant import load_plant
    from icmj.plant.selection import OperatingRule, Selection
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
def sweep(command: arguments.Sweep) -> None:
    """Compute a case at very many points."""
    from icmj.cli.sweeping import carry_out

    carry_out(command, OUT, ERR)


@execute.register
def identify(command: arguments.Identify) -> None:
    """Estimate a model error from measured motion."""
    from icmj.cli.identifying import carry_out

    carry_out(command, OUT, ERR)
