"""The command that follows a branch of cycles; importing this registers it with :func:`icmj.cli.commands.execute`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from icmj.base.numbers import amount
from icmj.cli import arguments
from icmj.cli.commands import execute
from icmj.cli.printing import say_changes
from icmj.cli.progress import Working
from icmj.cli.table import Column, show_table
from icmj.cli.terminal import ERR, OUT

if TYPE_CHECKING:
    from icmj.cycle.branch import Branch
    from icmj.cycle.return_map import PlantKind


@execute.register
def continue_(command: arguments.ContinueCommand) -> None:
    """Follow a branch, and what branches off; store and list them."""
    from icmj.base.files import replaceable, write_bytes
    from icmj.case.notices import doubt_setpoint
    from icmj.cli.printing import show_branch
    from icmj.cycle.branch import write_branch
    from icmj.cycle.continuation import BRANCHING, branch_off, follow
    from icmj.errors import CycleError
    from icmj.log.branch import write_branch_log
    from icmj.report import style
    from icmj.report.branch import branch_figure
    from icmj.runfile.reading import load_run
    from icmj.runfile.schema import overridden
    from icmj.study.study import open_folder, plants_of

    run = overridden(load_run(command.run, allow_code=command.allow_code), command.set)
    if not run.has_events:
        show_branch(command, run)
        return
    main_plant = command.plant or plants_of(run)[-1]
    name = f"{run.case.name}.{command.parameter.replace(':', '-')}"
    kinds = ("parquet", "rrd", "pdf", "svg")
    with Working(name, ERR) as working:

        def walked(plant: PlantKind, what: str) -> Branch:
            return follow(
                run, command.parameter, command.to, start_at=command.from_, plant=plant, start=command.start,
                points=command.points, progress=lambda done: working.tell(what, done),
            )  # fmt: skip

        replaceable(*(command.out / f"{name}.{main_plant}.{kind}" for kind in kinds))
        found, off = [walked(main_plant, f"{name}, {main_plant}")], list[str]()
        for special in found[0].specials if command.branches else ():
            if special.kind in BRANCHING:
                working.tell(f"branch at {special.value:.4g}", 0.0)
                try:
                    found.append(branch_off(found[0], special, points=command.points))
                except CycleError as error:
                    off.append(str(error))
        beneath = []
        if main_plant == "mujoco":
            try:
                beneath = [walked("linear", f"{name}, linear")]
            except CycleError as error:
                off.append(f"no linear prediction beneath: {error}")
        open_folder(command.out)
        files = []
        for i, branch in enumerate(found):
            files.append(command.out / f"{name}{f'.{i}' if i else ''}.{main_plant}.parquet")
            write_branch(branch, files[-1])
            files.append(files[-1].with_suffix(".rrd"))
            write_branch_log(branch, files[-1])
        working.tell("drawing", 0.99)
        with style.apply():
            figure = branch_figure(found, beneath)
            for kind in kinds[2:]:
                files.append(command.out / f"{name}.{main_plant}.{kind}")
                write_bytes(files[-1], style.save(figure, kind))
    for branch in found:
        _show_branch(branch)
    for words in (*off, *doubt_setpoint(run)):
        OUT.note(words)
    for file in files:
        OUT.say(f"{'figure' if file.suffix in ('.pdf', '.svg') else 'branch'}   {file}")


def _show_branch(branch: Branch) -> None:
    from icmj.cycle.parameter import with_unit

    columns = (
        Column(with_unit(branch.parameter), "right"),
        Column("interval (s)", "right"),
        Column("period (s)", "right", 1),
        *(Column(f"peak of {name}", "right", 2) for name in branch.outputs),
        Column("|μ|", "right"),
        Column(""),
    )
    marks = {special.index for special in branch.specials}
    shown = sorted({*marks, *np.linspace(0, len(branch) - 1, min(len(branch), 12)).astype(int).tolist()})
    rows = []
    for i in shown:
        intervals = ", ".join(f"{interval:.6g}" for interval in branch.intervals[i])
        peaks = (amount(peak, unit, 4) for peak, unit in zip(branch.y_peak[i], branch.units, strict=True))
        rows.append((
            f"{branch.value[i]:.6g}", intervals, f"{branch.period[i]:.6g}", *peaks, amount(branch.largest[i], "", 4),
            "attracting" if branch.attracting[i] else "repelling",
        ))  # fmt: skip
    title = f"{branch.run.title}: {branch.name} ({branch.plant})"
    show_table(columns, rows, OUT, title=title, sections=[row for row, i in enumerate(shown) if i in marks])
    say_changes(branch.run, OUT)
    for special in branch.specials:
        OUT.say(special.words)
    if not branch.specials or branch.specials[-1].words != branch.end:
        OUT.say(f"The branch {branch.end}.")
