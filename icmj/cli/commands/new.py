"""``icmj new``: a commented file to begin with, or a copy of a shipped one."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from icmj.base.text import one_line
from icmj.cli.arguments import POSITIONAL, Command, Given
from icmj.cli.progress import Working
from icmj.errors import FitError, IcmjError, RunFileError
from icmj.study.kinds import KINDS

if TYPE_CHECKING:
    from icmj.case.drafting import FirstRunFile
    from icmj.cli.terminal import Terminal
    from icmj.study.experiment_file import ExperimentFile
    from icmj.study.first_file import Kind

    Stimulus = str
else:
    Stimulus = Literal[KINDS.names]


FILES: dict[str, str] = {
    "sweep": "icmj sweep", "experiment": "icmj experiment", "family": "icmj fit RECORDING --model"
}  # fmt: skip
"""The kinds of files for a run file, and the command that takes each."""
TABLE = """# Recordings of standing people, for icmj fit --table {name} --model event --model switching
# A line is a file, beside this table: {more}
#   column     that holds the front-to-back centre of pressure; may be empty if it is the only one, or named so
#   person     whose recording it is; several lines of one person and condition are trials that are fitted together
#   group      to be compared with others, such as young; may be empty
#   condition  such as eyes closed; may be empty
file,column,person,group,condition
"""


@dataclass(frozen=True)
class NewCommand(Command):
    """Write a commented file to begin with, or copy a shipped one and its models.

    A run file for a model; a sweep, experiment or family file for a run file; a table of recordings for icmj fit.

    Example: icmj new body.xml --out body.toml
    """

    group = "Begin"

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

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Write a file, and say what is in it and what may be done with it."""
        kind, of = str(self.what), self.of
        if kind not in ("run", *FILES, "recordings"):
            kind, of = "run", (self.what, *of)
        if kind != "recordings" and len(of) > 1:
            raise RunFileError(f"{one_line(of[1], 80)}: one too many; icmj new takes one model or run file")
        if kind == "recordings":
            lines = _write_table(of, self.out or Path("recordings.csv"), err)
        elif kind == "run":
            lines = _write_run(of[0] if of else Path("pendulum"), self, err)
        else:
            lines = _write_file(kind, of[0] if of else None, self, err)  # type: ignore[arg-type]  # it is in FILES
        for line in lines:
            out.say(line, wrap=False)


def _write_run(given: Path, command: NewCommand, err: Terminal) -> list[str]:
    """A run file for a model, or a copy of a shipped file; returns what is said of it."""
    from icmj.base.files import write_text
    from icmj.work.shipped import EXPERIMENTS, FAMILIES, RUNS, SWEEPS, model_file

    for shelf in (RUNS, SWEEPS, EXPERIMENTS, FAMILIES):
        if (shipped := shelf.meant(given)) != given:
            out = command.out or Path(f"{given.name}.toml")
            files = _copy(shipped, out)
            beside = ", ".join(map(str, files[1:]))
            does = {"runs": "icmj analyse", "sweeps": FILES["sweep"], "experiments": FILES["experiment"]}
            return [
                f"{'run file' if shelf is RUNS else 'file':<10}{files[0]}",
                *([f"{'model' if shelf is RUNS else 'run file':<10}{beside}"] if beside else []),
                f"next      {does.get(shelf.kind, FILES['family'])} {files[0]}",
            ]
    model = model_file(given)
    out = command.out or Path(f"{model.stem}.toml")
    _refuse_existing(out)
    from icmj.case.drafting import draft_run  # which takes long

    with Working(f"looking at {model.name}", err):
        draft = draft_run(model, out, command.keyframe)
    write_text(out, draft.text)
    return [f"run file  {out}", *_describe_draft(draft), *_note_shipped(model), f"next      icmj analyse {out}"]


def _write_file(kind: Kind, given: Path | None, command: NewCommand, err: Terminal) -> list[str]:
    """A sweep, experiment or family file with every key, for a run file."""
    from icmj.base.files import write_text
    from icmj.case.case import prepare
    from icmj.case.drafting import case_name
    from icmj.runfile.reading import load_run, parse_toml
    from icmj.study.experiment_file import ExperimentFile
    from icmj.study.file_kinds import schema_of
    from icmj.study.first_file import draft_file, shipped_run
    from icmj.study.kind import Names

    out = command.out or Path(f"{kind}.toml")
    _refuse_existing(out)
    given = given or Path(shipped_run(kind, command.stimulus))
    with Working(f"looking at {given.name}", err):
        base = load_run(given)
        plant = prepare(base).actual.linearisation.plant
        run = given.name if not given.is_file() else Path(os.path.relpath(given, out.parent)).as_posix()
        names = Names(plant.inputs, plant.outputs, plant.states)
        text = draft_file(kind, out.name, case_name(out), run, base, names, command.stimulus)
        trouble = ""
        try:
            data = parse_toml(text, out)
            schema: Any = schema_of(kind)
            file = schema.validated(data, out, text)
            if isinstance(file, ExperimentFile):
                _expect_startable(file)
        except IcmjError as error:
            trouble = f"note: it does not run as written; {one_line(error).removeprefix(f'{out}: ')}"
    write_text(out, text)
    told = [f"{'file':<10}{out}", f"run file  {run}", *([trouble] if trouble else [])]
    return [*told, f"next      {FILES[kind]} {out}"]


def _expect_startable(file: ExperimentFile) -> None:
    """See that every case of an experiment takes its stimulus.

    Raises:
        IcmjError: if one does not.
    """
    from icmj.case.case import prepare
    from icmj.study.experiment import conditions_of

    for one in conditions_of(file):
        prepare(file.settings.stimulate(one.run, file.experiment.seed))


def _write_table(recordings: tuple[Path, ...], out: Path, err: Terminal) -> list[str]:
    """A table of recordings, each of which can be fitted as it is listed, or has a note why not."""
    import csv
    import io

    from icmj.base.files import write_text
    from icmj.fits.recordings import read_trials

    _refuse_existing(out)
    if not recordings:
        raise FitError("no recording to list; give files, such as icmj new recordings anna-1.csv anna-2.csv")
    text, notes = io.StringIO(), []
    rows = csv.writer(text, lineterminator="\n")
    with Working("reading recordings", err) as working:
        for i, path in enumerate(recordings):
            working.tell(f"reading {path.name}", i / len(recordings))
            try:
                read_trials(path)
            except FitError as error:
                notes.append(f"note: {one_line(error)}")
            rows.writerow((Path(os.path.relpath(path, out.parent)).as_posix(), "", path.stem, "", ""))
    write_text(out, TABLE.format(name=out.name, more="CSV, Parquet, npz or C3D") + text.getvalue())
    return [f"table     {out}", *notes, f"next      icmj fit --table {out} --model event"]


def _describe_draft(draft: FirstRunFile) -> list[str]:
    """Lines on what the drafted run file contains and what the theory predicts for it."""
    from icmj.cli.standing import say_standing

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
        f"stands?   {say_standing(prediction)}",
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
    """A shipped file, and side by side what it names: models of a case, the run file of a family without a name."""
    from icmj.base.files import expect_replaceable, write_bytes, write_text
    from icmj.work.folder import digest_of

    _refuse_existing(out)
    text = shipped.read_text(encoding="utf-8").replace(f"runs/{shipped.name}", str(out))
    named = re.findall(r'^(run|model) = "([^"]+/[^"]+)"', text, re.MULTILINE)
    copies = {name: (key, out.parent / Path(name).name) for key, name in named}
    expect_replaceable(*(target for _, target in copies.values()))
    for name, (key, target) in copies.items():
        if target.exists() and digest_of(target) != digest_of(shipped.parent / name):
            what = {"run": "run file"}.get(key, key)
            raise RunFileError(f"{target}: exists already and is another {what}; choose another folder with --out")
        text = text.replace(f'"{name}"', f'"{target.name}"')
    for name, (_, target) in copies.items():
        write_bytes(target, (shipped.parent / name).read_bytes())
    write_text(out, text)
    return [out, *(target for _, target in copies.values())]


def _refuse_existing(out: Path) -> None:
    """See that a file is new, and its folder there."""
    if os.path.lexists(out):
        raise RunFileError(f"{out}: exists already; choose another name with --out")
    if not out.parent.is_dir():
        raise RunFileError(f"{out}: no such folder; make it first")


COMMAND = NewCommand
