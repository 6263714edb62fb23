"""``icmj continue``: a branch of cycles along a parameter, and what branches off."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from icmj.cli.arguments import FOLDER, POSITIONAL, RESULTS, Given
from icmj.cli.overrides import Overrides, say_changes
from icmj.cli.progress import Working
from icmj.cli.table import Column, show_table
from icmj.errors import prefix_errors

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal
    from icmj.cycle.branch import Branch
    from icmj.cycle.return_map import PlantKind
    from icmj.runfile.schema import RunFile


ROWS = 12  # rows of a branch


@dataclass(frozen=True)
class ContinueCommand(Overrides):
    """Follow a cycle as a parameter varies, through folds, up to its end; write the branch and its figure.

    Example: icmj continue runs/simple-1.7.toml --parameter b --from 1.7 --to 1.2 --branches
    """

    group = "Predict"

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

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Follow a branch, and what branches off; store and list them."""
        from icmj.base.files import expect_replaceable, write_bytes
        from icmj.case.notices import doubt_setpoint
        from icmj.cycle.branch import write_branch
        from icmj.cycle.continuation import BRANCHING, branch_off, follow
        from icmj.errors import CycleError
        from icmj.log.branch import write_branch_log
        from icmj.report import style
        from icmj.report.branch import branch_figure
        from icmj.study.study import open_folder, plants_of

        run = self.load(self.run)
        if not run.has_events:
            _show_switched_branch(self, run, out, err)
            return
        main_plant = self.plant or plants_of(run)[-1]
        name = f"{run.case.name}.{self.parameter.replace(':', '-')}"
        drawn = "pdf", "svg"
        with Working(name, err) as working:

            def walk(plant: PlantKind, what: str) -> Branch:
                return follow(
                    run, self.parameter, self.to, start_at=self.from_, plant=plant, start=self.start,
                    points=self.points, progress=lambda done: working.tell(what, done),
                )  # fmt: skip

            endings = (".parquet", ".rrd", *(f".{kind}" for kind in drawn))
            expect_replaceable(*(self.out / f"{name}.{main_plant}{ending}" for ending in endings))
            found, off = [walk(main_plant, f"{name}, {main_plant}")], list[str]()
            for special in found[0].specials if self.branches else ():
                if special.kind in BRANCHING:
                    working.tell(f"branch at {special.value:.4g}", 0.0)
                    try:
                        found.append(branch_off(found[0], special, points=self.points))
                    except CycleError as error:
                        off.append(str(error))
            beneath = []
            if main_plant == "mujoco":
                try:
                    beneath = [walk("linear", f"{name}, linear")]
                except CycleError as error:
                    off.append(f"no linear prediction beneath: {error}")
            open_folder(self.out)
            files = []
            for i, branch in enumerate(found):
                files.append(self.out / f"{name}{f'.{i}' if i else ''}.{main_plant}.parquet")
                write_branch(branch, files[-1])
                files.append(files[-1].with_suffix(".rrd"))
                write_branch_log(branch, files[-1])
            working.tell("drawing", 0.99)
            with style.apply():
                figure = branch_figure(found, beneath)
                for kind in drawn:
                    files.append(self.out / f"{name}.{main_plant}.{kind}")
                    write_bytes(files[-1], style.save(figure, kind))
        for branch in found:
            _show_branch(branch, out)
        for words in (*off, *doubt_setpoint(run)):
            out.note(words)
        for file in files:
            out.say(f"{'figure' if file.suffix in ('.pdf', '.svg') else 'branch'}   {file}")


def _show_branch(branch: Branch, out: Terminal) -> None:
    import numpy as np

    from icmj.base.numbers import amount
    from icmj.cycle.parameter import name_with_unit

    columns = (
        Column(name_with_unit(branch.parameter), "right"),
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
            ("family" if branch.alternating[i] else "attracting") if branch.attracting[i] else "repelling",
        ))  # fmt: skip
    title = f"{branch.run.title}: {branch.name} ({branch.plant})"
    show_table(columns, rows, out, title=title, sections=[row for row, i in enumerate(shown) if i in marks])
    say_changes(branch.run, out)
    for special in branch.specials:
        out.say(special.words)
    if not branch.specials or branch.specials[-1].words != branch.end:
        out.say(f"The branch {branch.end}.")


def _show_switched_branch(command: ContinueCommand, run: RunFile, out: Terminal, err: Terminal) -> None:
    """Follow the cycle along a parameter of the controller, and list it.

    Raises:
        CycleError: if there is none, or what was asked for is not the linear plant's, or not the controller's.
    """
    import numpy as np

    from icmj.case.case import prepare
    from icmj.cycle.switched import has_exact_cycle, make_loop
    from icmj.cycle.switched_branch import follow_switched, vary
    from icmj.errors import CycleError

    name = command.parameter.removeprefix("controller.")
    with Working(f"{run.case.name}.{name}", err):
        case = prepare(run)
        if command.plant == "mujoco" or not has_exact_cycle(case.controller):
            raise CycleError(
                f"{run.path}: only branches of intermittent control, and of switched feedback of one joint with a "
                "dead zone on the linear plant (--plant linear), are followed; for other runs see icmj cycle"
            )
        plant, law, x0 = make_loop(case)
        with prefix_errors(run.path):
            if command.from_ is not None:
                law = vary(law, name)[0](command.from_)
            branch = follow_switched(plant, law, name, command.to, points=command.points, x0=x0)
    columns = (
        Column(name, "right"), Column("period (s)", "right"), Column("switches", "right"),
        Column(f"peak of {law.position} / r", "right"), Column("|μ|", "right"), Column(""),
    )  # fmt: skip
    at = np.unique(np.linspace(0, len(branch.cycles) - 1, min(len(branch.cycles), ROWS)).astype(int))
    rows = [
        (
            f"{branch.value[i]:.6g}", f"{c.period:.6g}", f"{len(c.switches) * (2 if c.mirrored else 1)}",
            f"{c.peak:.5g}", f"{abs(c.multipliers[0]):.4g}", "attracting" if c.attracting else "repelling",
        )
        for i in at
        for c in [branch.cycles[i]]
    ]  # fmt: skip
    show_table(columns, rows, out, title=f"{run.title}: cycles along {name} (linear)")
    say_changes(run, out)
    for value in branch.changes:
        out.say(f"Stability changes at {name} = {value:.7g}.")
    out.say(f"The branch {branch.end}.")


COMMAND = ContinueCommand
