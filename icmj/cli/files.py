"""Commands that write a first run file, and those that read recordings, logs and experiment files.

The commands to begin with: ``icmj cases``, ``icmj new`` and ``icmj schema``.

What ``icmj measure`` does and shows.

What ``icmj experiment`` does and shows.

What ``icmj fit`` does and shows.
"""

from __future__ import annotations

import json
import os
import re
import textwrap
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.numbers import amount, count
from icmj.base.text import one_line
from icmj.cli import arguments
from icmj.cli.arguments import CasesCommand, ExperimentCommand, FitCommand, NewCommand, SchemaCommand
from icmj.cli.progress import Working
from icmj.cli.table import Column, show_table
from icmj.cli.terminal import ERR, OUT, Terminal
from icmj.errors import FitError, IcmjError, RunFileError, StudyError

if TYPE_CHECKING:
    from collections.abc import Callable

    from icmj.case.drafting import FirstRunFile
    from icmj.measurement.sway import Sway
    from icmj.series.series import Series
    from icmj.study.experiment import Experiment as Done
    from icmj.study.experiment_file import ExperimentFile
    from icmj.study.first_file import Kind
    from icmj.study.fit import Fit as DoneFit
    from icmj.study.fit import Subject

LISTED = {
    "cases": "Cases of the study: icmj run NAME, icmj analyse NAME",
    "rivals": "Cases under other controllers: icmj run NAME",
    "joystick": "Plants that a person controls by a joystick, for experiments: icmj run NAME",
    "sweeps": "Sweeps: icmj sweep NAME",
    "experiments": "Experiments: icmj experiment NAME",
    "families": "Families of controllers: icmj fit RECORDING --model NAME",
}


def cases(command: CasesCommand) -> None:
    """List what comes with icmj, by name, with title and one sentence each."""
    from icmj.work.shipped import describe_shipped

    found = describe_shipped()
    if command.json:
        keys = ("name", "title", "about", "file")
        OUT.show(
            {kind: [{key: str(getattr(one, key)) for key in keys} for one in ones] for kind, ones in found.items()}
        )
        return
    for kind, ones in found.items():
        OUT.say(LISTED.get(kind, kind), style="bold")
        for one in ones:
            _paragraph(f"{one.name}: {one.title}", "  ")
            _paragraph(one.about, "      ", style="dim")
        OUT.say("")


def _paragraph(words: str, indent: str, style: str | None = None) -> None:
    """Print words wrapped to the terminal, at most 100 columns wide."""
    width = min(OUT.width, 100)
    for line in textwrap.wrap(words, width, initial_indent=indent, subsequent_indent=" " * 6, break_on_hyphens=False):
        OUT.say(line, style=style, wrap=False)


def new(command: NewCommand) -> None:
    """Write a file, and say what is in it and what may be done with it."""
    kind, of = str(command.what), command.of
    if kind not in ("run", *FILES, "recordings"):
        kind, of = "run", (command.what, *of)
    if kind != "recordings" and len(of) > 1:
        raise RunFileError(f"{one_line(of[1], 80)}: one too many; icmj new takes one model or run file")
    if kind == "recordings":
        _new_table(of, command.out or Path("recordings.csv"))
    elif kind == "run":
        _new_run(of[0] if of else Path("pendulum"), command)
    else:
        _new_file(kind, of[0] if of else None, command)  # type: ignore[arg-type]  # it is in FILES


FILES: dict[str, str] = {
    "sweep": "icmj sweep", "experiment": "icmj experiment", "family": "icmj fit RECORDING --model"
}  # fmt: skip


def _new_run(given: Path, command: NewCommand) -> None:
    """A run file for a model, or a copy of a shipped file."""
    from icmj.work.shipped import EXPERIMENTS, FAMILIES, RUNS, SWEEPS, model_file

    for shelf in (RUNS, SWEEPS, EXPERIMENTS, FAMILIES):
        if (shipped := shelf.meant(given)) != given:
            out = command.out or Path(f"{given.name}.toml")
            files = _copy(shipped, out) if shelf is RUNS else _copy_file(shipped, out)
            beside = ", ".join(map(str, files[1:]))
            does = {"runs": "icmj analyse", "sweeps": FILES["sweep"], "experiments": FILES["experiment"]}
            _tell(
                f"{'run file' if shelf is RUNS else 'file':<10}{files[0]}",
                *([f"{'model' if shelf is RUNS else 'run file':<10}{beside}"] if beside else []),
                f"next      {does.get(shelf.kind, FILES['family'])} {files[0]}",
            )
            return
    model = model_file(given)
    out = command.out or Path(f"{model.stem}.toml")
    _free(out)

    from icmj.base.files import write_text
    from icmj.case.drafting import draft_run

    with Working(f"looking at {model.name}", ERR):
        draft = draft_run(model, out, command.keyframe)
    write_text(out, draft.text)
    _tell(f"run file  {out}", *_describe_draft(draft), *_note_shipped(model), f"next      icmj analyse {out}")


def _new_file(kind: Kind, given: Path | None, command: NewCommand) -> None:
    """A sweep, experiment or family file with every key, for a run file."""
    from icmj.base.files import write_text
    from icmj.case.case import prepare
    from icmj.case.drafting import case_name
    from icmj.runfile.family_tables import FamilyFile
    from icmj.runfile.reading import load_run, parse_toml
    from icmj.runfile.sweep_tables import SweepFile
    from icmj.study.experiment_file import ExperimentFile
    from icmj.study.first_file import draft_file, shipped_run
    from icmj.study.kind import Names

    out = command.out or Path(f"{kind}.toml")
    _free(out)
    given = given or Path(shipped_run(kind, command.stimulus))
    with Working(f"looking at {given.name}", ERR):
        base = load_run(given)
        plant = prepare(base).actual.linearisation.plant
        run = given.name if not given.is_file() else Path(os.path.relpath(given, out.parent)).as_posix()
        names = Names(plant.inputs, plant.outputs, plant.states)
        text = draft_file(kind, out.name, case_name(out), run, base, names, command.stimulus)
        trouble = ""
        try:
            data = parse_toml(text, out)
            if kind == "experiment":
                _expect_startable(ExperimentFile.validated(data, out, text))
            else:
                (SweepFile if kind == "sweep" else FamilyFile).validated(data, out, text)
        except IcmjError as error:
            trouble = f"note: it does not run as written; {one_line(error).removeprefix(f'{out}: ')}"
    write_text(out, text)
    _tell(f"{'file':<10}{out}", f"run file  {run}", *([trouble] if trouble else []), f"next      {FILES[kind]} {out}")


def _expect_startable(file: ExperimentFile) -> None:
    """See that every case of an experiment takes its stimulus.

    Raises:
        IcmjError: if one does not.
    """
    from icmj.case.case import prepare
    from icmj.study.experiment import conditions_of

    for one in conditions_of(file):
        prepare(file.settings.stimulate(one.run, file.experiment.seed))


TABLE = """# Recordings of standing people, for icmj fit --table {name} --model event --model switching
# A line is a file, beside this table: {more}
#   column     that holds the front-to-back centre of pressure; may be empty if it is the only one, or named so
#   person     whose recording it is; several lines of one person and condition are trials that are fitted together
#   group      to be compared with others, such as young; may be empty
#   condition  such as eyes closed; may be empty
file,column,person,group,condition
"""


def _new_table(recordings: tuple[Path, ...], out: Path) -> None:
    """A table of recordings, each of which can be fitted as it is listed, or has a note why not."""
    import csv
    import io

    from icmj.base.files import write_text
    from icmj.fitting.recordings import read_trials

    _free(out)
    if not recordings:
        raise FitError("no recording to list; give files, such as icmj new recordings anna-1.csv anna-2.csv")
    text, notes = io.StringIO(), []
    rows = csv.writer(text, lineterminator="\n")
    with Working("reading recordings", ERR) as working:
        for i, path in enumerate(recordings):
            working.tell(f"reading {path.name}", i / len(recordings))
            try:
                read_trials(path)
            except FitError as error:
                notes.append(f"note: {one_line(error)}")
            rows.writerow((Path(os.path.relpath(path, out.parent)).as_posix(), "", path.stem, "", ""))
    write_text(out, TABLE.format(name=out.name, more="CSV, Parquet, npz or C3D") + text.getvalue())
    _tell(f"table     {out}", *notes, f"next      icmj fit --table {out} --model event")


def schema(command: SchemaCommand) -> None:
    """Print the JSON Schema of a kind of file, or write it."""
    from icmj.base.files import replaceable, write_text
    from icmj.study.file_kinds import json_schema

    record = json_schema(command.kind)
    if command.out is None:
        OUT.show(record)
        return
    replaceable(command.out)
    write_text(command.out, json.dumps(record, indent=2) + "\n")
    OUT.say(f"schema   {command.out}", wrap=False)


def _tell(*lines: str) -> None:
    for line in lines:
        OUT.say(line, wrap=False)


def _describe_draft(draft: FirstRunFile) -> list[str]:
    """Lines on what the drafted run file contains and what the theory predicts for it."""
    from icmj.cli.printing import standing_in_words

    if draft.case is None or draft.case.theory is None:
        return [f"note: it does not run as written; {one_line(draft.trouble)}"]
    case = draft.case
    plant, prediction, table = case.actual.linearisation.plant, draft.case.theory.prediction, case.run.assumed
    where = f"keyframe {table.keyframe}" if table.keyframe else "its reference configuration"
    how = {"static control": ", held there by its controls", "balance": ", moved to where it balances"}
    lines = [
        f"at        {where}{how.get(table.operating_point or '', '')}",
        f"inputs    {', '.join(plant.inputs)}",
        f"outputs   {', '.join(plant.outputs)}",
        f"weights   R_c = {case.run.design.R_c}, R_o = {case.run.design.R_o}, from the gain of the plant",
    ]
    at = f"a limit cycle, Δ_crit = {prediction.delta_crit or 0.0:.4g} s, {prediction.verdict}"
    b, cycle = case.run.actual.gain, at if prediction.cycle else "no limit cycle"
    lines += [
        f"b         {b}, an example: the actual inputs do {b} of what the controller assumes (actual.gain)",
        f"predicted {cycle}",
        f"stands?   {standing_in_words(prediction)}",
    ]
    return lines + [f"note: {one_line(notice)}" for notice in case.notices]


def _note_shipped(model: Path) -> list[str]:
    """A note if a shipped case uses this model with other weights."""
    from icmj.runfile.reading import load_run
    from icmj.work.shipped import RUNS

    for name, file in RUNS.files.items():
        run = load_run(file)
        same = run.assumed.model is not None and run.assumed_path.resolve() == model.resolve()
        if same and not run.simulation.disturbance and not run.assumed.delay:
            weights = f"R_c = {run.design.R_c} and R_o = {run.design.R_o}"
            return [
                f"note: the shipped case {name} has this model with {weights}, and so another Δ_crit; "
                f"icmj new {name} copies it"
            ]
    return []


def _copy(shipped: Path, out: Path) -> list[Path]:
    """The run file of a shipped case, and the models that it names, side by side."""
    from icmj.base.files import read_bytes, replaceable, write_bytes, write_text
    from icmj.engine.model_files import MOST_BYTES
    from icmj.runfile.reading import load_run

    run = load_run(shipped)
    _free(out)
    text = run.text.replace(f"runs/{shipped.name}", str(out))
    models: dict[str, Path] = {}
    for name in filter(None, (run.assumed.model, run.actual.model)):
        models[name] = out.parent / Path(name).name
        text = text.replace(f'"{name}"', f'"{Path(name).name}"')
    replaceable(*models.values())
    for name, target in models.items():
        source = shipped.parent / name
        if target.exists() and read_bytes(target, MOST_BYTES) != source.read_bytes():
            raise RunFileError(f"{target}: exists already and is another model; choose another folder with --out")
    for name, target in models.items():
        write_bytes(target, (shipped.parent / name).read_bytes())
    write_text(out, text)
    return [out, *models.values()]


def _copy_file(shipped: Path, out: Path) -> list[Path]:
    """A shipped sweep, experiment or family, and the run file of a family, which has no name of its own."""
    from icmj.base.files import replaceable, write_bytes, write_text

    _free(out)
    text, beside = shipped.read_text(encoding="utf-8"), list[Path]()
    for name in dict.fromkeys(re.findall(r'^run = "(runs/[^"]+)"', text, re.MULTILINE)):
        target, source = out.parent / Path(name).name, shipped.parent / name
        replaceable(target)
        if target.exists() and target.read_bytes() != source.read_bytes():
            raise RunFileError(f"{target}: exists already and is another run file; choose another folder with --out")
        write_bytes(target, source.read_bytes())
        text, beside = text.replace(f'"{name}"', f'"{target.name}"'), [*beside, target]
    write_text(out, text)
    return [out, *beside]


def _free(out: Path) -> None:
    if os.path.lexists(out):
        raise RunFileError(f"{out}: exists already; choose another name with --out")
    if not out.parent.is_dir():
        raise RunFileError(f"{out}: no such folder; make it first")


MOST = 6  # signals in one table
RATE = 100.0  # Hz: at which a log is measured


def measure(command: arguments.MeasureCommand) -> None:
    """Print the measures of sway in logs or a file."""
    from icmj.cli.printing import record, show_sway
    from icmj.errors import DataError
    from icmj.log.selection import find_logs

    if (command.torque is None) != (command.weight is None):
        raise DataError("--torque and --weight go together: the centre of pressure is torque over weight")
    found = [(path, *_measure(path, command)) for path in find_logs([command.file], arguments.RESULTS)]
    if command.json:
        records = [{**record(sway), "notices": notes} for _, sway, notes in found]
        OUT.show(records[0] if len(records) == 1 else records)
        return
    for path, sway, notes in found:
        filtered = "" if sway.low_pass is None else f", low-pass {sway.low_pass:g} Hz"
        show_sway(sway, f"{path.name}: {sway.duration:.6g} s at {sway.rate:.6g} Hz{filtered}", OUT)
        for note in notes:
            OUT.note(note)


def _measure(path: Path, command: arguments.MeasureCommand) -> tuple[Sway, tuple[str, ...]]:
    from icmj.errors import DataError
    from icmj.measurement.measures import find_measure, list_options
    from icmj.measurement.sway import from_torque, measure_sway
    from icmj.work.own_code import Code

    further = [find_measure(name, Code(Path.cwd(), command.allow_code)) for name in command.measure]
    given = {name: getattr(command, name) for name in list_options()}
    options: dict[str, Any] = {name: value for name, value in given.items() if value is not None}

    with Working(f"measuring {path.name}", ERR):
        series, notes = _signals(path, command)
        # a log is in SI units; of an actuator's own they are not known, and its torque is in N m
        unit = command.unit or ("N m" if command.torque is not None and path.suffix == ".rrd" else "")
        series = replace(series, units=tuple(own or unit for own in series.units))
        if command.torque is not None and command.weight is not None:
            if not series.units[series.place(command.torque)]:
                raise DataError(f"{path}: {command.torque} has no unit; say it with --unit, such as 'N m' or 'N mm'")
            series = from_torque(series, command.torque, command.weight)
        if len(series.names) > MOST and not command.json:
            some = ", ".join(series.names[:4])
            raise DataError(f"{path}: {len(series.names)} signals ({some}, ...); name up to {MOST} by --columns")
        try:
            sway = measure_sway(series, low_pass=command.low_pass, measures=further, **options)
        except DataError as error:
            raise DataError(f"{path}: {error}") from error
    return sway, (*notes, *sway.series.remarks)


def _signals(path: Path, command: arguments.MeasureCommand) -> tuple[Series, tuple[str, ...]]:
    """The series to be measured, from a log or a file, evenly sampled for a log or with a rate; and notes."""
    from icmj.errors import DataError
    from icmj.series.even_rows import even_series
    from icmj.series.plausibility import doubt
    from icmj.series.reading import cut_rows, read_series

    columns = command.columns if command.torque is None else (*command.columns, command.torque)
    if path.suffix == ".rrd":
        from icmj.log.reader import read_log

        result = read_log(path)
        notes = tuple(notice for notice in result.notices if notice.startswith("slow noise"))
        series = result.to_series(RATE if command.rate is None else command.rate)
        try:
            series = cut_rows(series, command.since, command.until)
        except DataError as error:
            raise DataError(f"{path}: {error}") from error
        ground = result.simulation.pressure
        moving = () if ground is None else tuple(f"cop.{axis}" for axis in ground.axes)
        series = series.chosen(columns or moving or [name for name in series.names if name.startswith("y.")])
        return replace(series, facts={k: v for k, v in series.facts.items() if k != "resampled"}), notes
    series = read_series(path, columns=columns, rate=command.rate, since=command.since, until=command.until)
    series = doubt(series)
    return (series if command.rate is None else even_series(series, command.rate)), ()


def experiment(command: ExperimentCommand) -> None:
    """Carry out an experiment, or analyse recordings as it says; what was finished stays, however it ends."""
    from icmj.study.estimate import LONGEST
    from icmj.study.experiment import FIGURE, PAGE, RESULTS, analyse_recordings, run_experiment, summary
    from icmj.study.experiment_file import load_experiment

    if command.jobs is not None and command.jobs < 1:
        raise StudyError(f"--jobs {command.jobs}: expected at least 1")
    for option in ("rate", "since", "until"):
        if getattr(command, option) is not None and not command.recording:
            raise StudyError(f"--{option} is of recordings; give --recording, or leave it out")
    file = load_experiment(command.experiment, allow_code=command.allow_code)
    name = file.experiment.name
    whose = [f"-{command.recording[0].stem}"] if command.recording else []
    whose += [f"-and-{len(command.recording) - 1}-more"] if len(command.recording) > 1 else []
    folder = command.out or arguments.RESULTS / "".join([name, *whose])
    with Working(name, ERR) as working:
        if command.recording:
            done = analyse_recordings(
                file, command.recording, folder, rate=command.rate, since=command.since, until=command.until
            )
        else:
            longest = None if command.yes else LONGEST
            done = run_experiment(file, folder, jobs=command.jobs, progress=working.tell, longest=longest)
    if command.json:
        OUT.show({**summary(done), "folder": str(folder)})
        return
    _show_experiment(done, OUT)
    for what, path in (("results", RESULTS), ("figure", f"{FIGURE}.svg"), ("page", PAGE)):
        OUT.say(f"{what:<8} {folder / path}", wrap=False)


def _show_experiment(done: Done, out: Terminal) -> None:
    """One table, cases and plants as columns; then what was found, in words."""
    from icmj.report.experiment import plant_name

    found = [told for told in done.found if told.finding is not None]
    names = list(dict.fromkeys(name for told in found if told.finding for name in told.finding.numbers))
    columns = (Column(""), *(Column(f"{told.case}, {plant_name(told.plant)}", "right") for told in found))
    rows = [
        (name, *(amount((told.finding.numbers if told.finding else {}).get(name), figures=4) for told in found))
        for name in names
    ]
    if rows:
        show_table(columns, rows, out, title=done.file.experiment.title or done.file.experiment.name)
    for told in done.found:
        out.say(f"{told.case}, {plant_name(told.plant)}, {count(told.trials, 'trial')}: {told.words}")
    for note in done.notes:
        out.note(note)


_COLUMNS, _REQUIRED = ("file", "column", "person", "group", "condition"), ("file", "person")


def fit(command: FitCommand) -> None:
    """Fit families to recordings; whatever is finished stays, however it ends."""
    from icmj.fitting.family import DELAY, load_family
    from icmj.fitting.network import library
    from icmj.study.fit import fit as fitted
    from icmj.study.fit_page import PAGE, RESULTS, summary, write_fit

    if command.jobs is not None and command.jobs < 1:
        raise FitError(f"--jobs {command.jobs}: expected at least 1")
    for name, value, least in (
        ("simulations", command.simulations, 200), ("draws", command.draws, 100), ("hold-out", command.hold_out, 0),
        ("seed", command.seed, 0),
    ):  # fmt: skip
        if value < least:
            raise FitError(f"--{name} {value}: expected at least {least}")
    if not command.model:
        raise FitError("no family; give --model, such as --model event")
    if bool(command.recordings) == (command.table is not None):
        raise FitError("give either recordings or --table")
    with Working("reading recordings", ERR) as working:
        people = people_of(command, working.tell)
    families = [load_family(path, allow_code=command.allow_code) for path in command.model]
    if delayed := [family.name for family in families if family.has_delay]:
        ERR.note(f"{', '.join(delayed)}: {DELAY}")  # before hours of simulation
    library()
    with Working("fit", ERR) as working:
        done = fitted(
            people,
            families,
            command.out,
            trained=command.trained,
            simulations=command.simulations,
            draws=command.draws,
            seed=command.seed,
            jobs=command.jobs,
            dask=command.dask,
            progress=working.tell,
        )
        working.tell("writing", 1.0)
        write_fit(done, command.out)
    if command.json:
        OUT.show({**summary(done), "folder": str(command.out)})
        return
    _show_fit(done, OUT)
    for what, path in (("results", RESULTS), ("page", PAGE)):
        OUT.say(f"{what:<8} {command.out / path}", wrap=False)


def people_of(command: FitCommand, progress: Callable[[str, float], None] = lambda what, done: None) -> list[Subject]:
    """Those whose recordings were given, or whom a table lists; the trials of a person and condition are one.

    Raises:
        FitError: one line, if a recording or the table cannot be used, or a recording is listed twice for one person.
    """
    from hashlib import sha256

    from icmj.fitting.recordings import MOST, TrialOf, read_trials
    from icmj.study.fit import Subject

    if command.table is None:
        rows = [{"file": str(path), "person": command.recordings[0].stem} for path in command.recordings]
        base = Path()
    else:
        rows, base = _rows(command.table), command.table.parent
    listed: set[tuple[str, ...]] = set()
    found: dict[tuple[str, ...], list[tuple[str, TrialOf]]] = {}
    same: dict[tuple[tuple[str, ...], bytes], str] = {}
    count = 0
    for i, row in enumerate(rows):
        columns = (row["column"],) if row.get("column") else command.columns
        key = row["person"], row.get("group", ""), row.get("condition", "")
        recording = *key, os.path.abspath(base / row["file"]), *columns
        if recording in listed:
            raise FitError(f"{command.table or row['file']}: {row['file']} is given twice for {row['person']}")
        listed.add(recording)
        part = {"since": command.since, "until": command.until}
        trials = read_trials(base / row["file"], columns, unit=command.unit, rate=command.rate, **part)
        count += len(trials)
        if count > MOST:
            raise FitError(f"{base / row['file']}: the recordings hold more than {MOST} trials; fit them in parts")
        for one in trials:
            if (other := same.setdefault((key, sha256(one.cop.tobytes()).digest()), row["file"])) != row["file"]:
                raise FitError(f"{base / row['file']}: holds the same values as {other}; a copy is no further trial")
        found.setdefault(key, []).extend((row["file"], one) for one in trials)
        progress("reading recordings", (i + 1) / len(rows))
    return [
        Subject(
            person,
            tuple(one.cop for _, one in trials),
            command.hold_out,
            group,
            condition,
            tuple(f"{file}, {one.name}: {note}" for file, one in trials for note in one.notes),
        )
        for (person, group, condition), trials in found.items()
    ]


def _rows(path: Path) -> list[dict[str, str]]:
    """The rows of a table of people, or of the public data set's own table."""
    from icmj.fitting.recordings import INFO, public_trials, read_table

    if path.name == INFO:
        return [
            {
                "file": one.file.name,
                "person": one.person,
                "group": one.group,
                "condition": f"eyes {one.vision}, {one.surface}".lower(),
            }
            for one in public_trials(path.parent)
        ]
    names, rows = read_table(path, _COLUMNS, required=_REQUIRED)
    unknown = [name for name in names if name not in _COLUMNS]
    missing = [name for name in _REQUIRED if name not in names]
    if unknown or missing:
        wrong = f"no column {missing[0]!r}" if missing else f"unknown column {one_line(unknown[0], 40)!r}"
        raise FitError(f"{path}: {wrong}; expected {', '.join(_COLUMNS)}, of which file and person are required")
    if not rows:
        raise FitError(f"{path}: lists no people")
    return rows


def _show_fit(done: DoneFit, out: Terminal) -> None:
    """A table of numbers for each person and family, then what else was found, in words."""
    from icmj.fitting.choice import say_probability
    from icmj.study.fit_page import caveats, words_of

    for one in done.people:
        for note in one.notes:
            out.say(f"note: {note}")
    for each in done.trained.values():
        out.say(each.words)
    for found in done.fitted:
        trained = done.trained[found.family]
        low, median, high = np.quantile(found.theta, (0.05, 0.5, 0.95), axis=0)
        prior, verdicts = trained.family.prior, trained.calibration.judge(found.contraction)
        rows = [
            (name, prior.units[i], *(amount(of[i], figures=4) for of in (median, low, high)), verdicts[i])
            for i, name in enumerate(prior.names)
        ]
        columns = (
            Column("number"), Column("unit", rank=1), Column("median", "right"), Column("5 %", "right"),
            Column("95 %", "right"), Column("verdict"),
        )  # fmt: skip
        show_table(columns, rows, out, title=f"{found.person.label}: {trained.family.title}")
        out.say(words_of(found))
    if done.confusion is not None and done.probabilities is not None:
        head = (Column("probability"), *(Column(name, "right") for name in done.trained))
        shares = [
            (one.label, *map(say_probability, each)) for one, each in zip(done.people, done.probabilities, strict=True)
        ]
        show_table(head, shares, out, title="Which family")
        out.say(done.confusion.words + ".")
    for said in caveats(done):
        out.say(said)
    for name, differences in done.differences.items():
        for difference in differences:
            out.say(f"{name}: {difference.words}")
