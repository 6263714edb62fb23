"""The commands to begin with: ``icmj cases``, ``icmj new`` and ``icmj schema``."""

from __future__ import annotations

import json
import os
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

from icmj.base.text import one_line
from icmj.cli.starting_arguments import Cases, New, Schema
from icmj.cli.terminal import ERR, OUT
from icmj.cli.working import Working
from icmj.errors import RunFileError

if TYPE_CHECKING:
    from icmj.case.drafting import Drafted


LISTED = {
    "cases": "Cases of the study: icmj run NAME, icmj analyse NAME",
    "rivals": "Cases under other controllers: icmj run NAME",
    "joystick": "Plants that a person controls by a joystick, for experiments: icmj run NAME",
    "sweeps": "Sweeps: icmj sweep NAME",
    "experiments": "Experiments: icmj experiment NAME",
    "families": "Families of controllers: icmj fit RECORDING --model NAME",
}


def cases(command: Cases) -> None:
    """List what comes with icmj, by name, with title and one sentence each."""
    from icmj.work.shipped import described

    found = described()
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


def new(command: New) -> None:
    """Write the run file, and say what is in it and what may be done with it."""
    from icmj.work.shipped import RUNS, model_file

    given = command.model
    shipped = RUNS.meant(given)
    if shipped != given:
        files = _copy(shipped, command.out or Path(f"{given.name}.toml"))
        models = ", ".join(map(str, files[1:]))
        _tell(f"run file  {files[0]}", f"model     {models}", f"next      icmj analyse {files[0]}")
        return
    model = model_file(given)
    out = command.out or Path(f"{model.stem}.toml")
    _free(out)

    from icmj.base.files import write_text
    from icmj.case.drafting import draft_run

    with Working(f"looking at {model.name}", ERR):
        draft = draft_run(model, out, command.keyframe)
    write_text(out, draft.text)
    _tell(f"run file  {out}", *_found(draft), *_shipped_with(model), f"next      icmj analyse {out}")


def schema(command: Schema) -> None:
    """Print the JSON Schema of a kind of file, or write it."""
    from icmj.base.files import replaceable, write_text
    from icmj.runfile.json_schema import json_schema

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


def _found(draft: Drafted) -> list[str]:
    """Lines on what the drafted run file contains and what the theory predicts for it."""
    if draft.case is None:
        return [f"note: it does not run as written: {one_line(draft.trouble)}"]
    case = draft.case
    plant, prediction = case.actual.linearisation.plant, case.prediction
    table = case.run.assumed
    where = f"keyframe {table.keyframe}" if table.keyframe else "its reference configuration"
    how = {"static control": ", held there by its controls", "balance": ", moved to where it balances"}
    lines = [
        f"at        {where}{how.get(table.operating_point or '', '')}",
        f"inputs    {', '.join(plant.inputs)}",
        f"outputs   {', '.join(plant.outputs)}",
        f"weights   R_c = {case.run.design.R_c}, R_o = {case.run.design.R_o}, from the gain of the plant",
    ]
    if prediction.delta_crit is not None and prediction.cycle:
        lines.append(f"predicted a limit cycle, Δ_crit = {prediction.delta_crit:.4g} s, {prediction.verdict}")
    else:
        lines.append("predicted no limit cycle")
    return lines + [f"note: {one_line(notice)}" for notice in case.notices]


def _shipped_with(model: Path) -> list[str]:
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
    from icmj.engine.soundness import MOST_BYTES
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


def _free(out: Path) -> None:
    if os.path.lexists(out):
        raise RunFileError(f"{out}: exists already; choose another name with --out")
    if not out.parent.is_dir():
        raise RunFileError(f"{out}: no such folder; make it first")
