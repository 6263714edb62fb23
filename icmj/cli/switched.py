"""What ``icmj cycle`` and ``icmj continue`` say of a switched delayed feedback on the linear plant: exact cycles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array
from icmj.base.card import plain
from icmj.base.numbers import pairs
from icmj.cli.tables import Column, show_table
from icmj.cli.terminal import ERR, OUT
from icmj.cli.working import Working
from icmj.errors import named

if TYPE_CHECKING:
    from icmj.case.case import Case
    from icmj.cli.arguments import Continue
    from icmj.controller.switching import SwitchingPD
    from icmj.cycle.switched import SwitchedCycle
    from icmj.plant.linear_plant import LinearPlant
    from icmj.runfile.schema import RunFile

SHOWN = 12  # rows of a branch


def show_cycle(case: Case, json: bool) -> None:
    """Find the cycle that the run settles on, and print it.

    Raises:
        CycleError: if there is none.
    """
    from icmj.cycle.switched import find_switched_cycle

    run = case.run
    with Working(f"cycle of {run.case.name}", ERR):
        plant, law, x0 = _loop(case)
        with named(run.path):
            found = find_switched_cycle(plant, law, x0)
    if json:
        OUT.show(_plain(found))
        return
    OUT.say(f"{run.case.title} (linear): {found.words}")
    for name, high, spread in zip(law.plant.outputs, found.y_peak, found.y_range, strict=True):
        OUT.say(f"{name}: peak {high:.6g}, peak to peak {spread:.6g}")
    shown = ", ".join(f"{mu.real:.6f}" if abs(mu.imag) < 1e-9 else f"{mu:.6f}" for mu in found.multipliers)
    OUT.say(f"multipliers {shown}; it closes to {found.closure:.0e}.")


def show_branch(command: Continue, run: RunFile) -> None:
    """Follow the cycle along a parameter of the controller, and list it.

    Raises:
        CycleError: if there is none, or what was asked for is not the linear plant's, or not the controller's.
    """
    from icmj.case.case import prepare
    from icmj.cycle.switched import has_exact_cycle
    from icmj.cycle.switched_branch import follow_switched, varied
    from icmj.errors import CycleError

    name = command.parameter.removeprefix("controller.")
    with Working(f"{run.case.name}.{name}", ERR):
        case = prepare(run)
        if command.plant == "mujoco" or not has_exact_cycle(case.controller):
            raise CycleError(
                f"{run.path}: branches are followed of intermittent control, and of switched feedback of one joint "
                "with a dead zone on the linear plant (--plant linear); icmj cycle tells what other runs settle on"
            )
        plant, law, x0 = _loop(case)
        with named(run.path):
            if command.from_ is not None:
                law = varied(law, name)[0](command.from_)
            branch = follow_switched(plant, law, name, command.to, points=command.points, x0=x0)
    columns = (
        Column(name, "right"), Column("period (s)", "right"), Column("switches", "right"),
        Column(f"peak of {law.position} / r", "right"), Column("|μ|", "right"), Column(""),
    )  # fmt: skip
    at = np.unique(np.linspace(0, len(branch.cycles) - 1, min(len(branch.cycles), SHOWN)).astype(int))
    rows = [
        (
            f"{branch.value[i]:.6g}", f"{c.period:.6g}", f"{len(c.switches) * (2 if c.mirrored else 1)}",
            f"{c.peak:.5g}", f"{abs(c.multipliers[0]):.4g}", "attracting" if c.attracting else "repelling",
        )
        for i in at
        for c in [branch.cycles[i]]
    ]  # fmt: skip
    show_table(columns, rows, OUT, title=f"{run.case.title}: cycles along {name} (linear)")
    for value in branch.changes:
        OUT.say(f"Stability changes at {name} = {value:.7g}.")
    OUT.say(f"The branch {branch.end}.")


def _loop(case: Case) -> tuple[LinearPlant, SwitchingPD, Array | None]:
    """The actual plant with the controller's inputs and outputs, the controller, and where the run starts."""
    from icmj.case.plants import linear_plant
    from icmj.plant.matching import matched
    from icmj.simulation.settings import plant_start

    law = case.controller
    plant = matched(linear_plant(case.actual, case.settings), law.plant, "position")
    x0 = plant_start(plant, case.settings, None)
    return plant, law, (x0 if x0.any() else None)  # type: ignore[return-value]


def show_roots(case: Case, json: bool) -> None:
    """Print the characteristic roots of a loop that stays in each mode, and its rounds if it has any."""
    from icmj.case.case import mode_roots
    from icmj.case.plants import linear_plant
    from icmj.experiments.rounds import rounds_without_dead_zone

    run = case.run
    with Working(f"analysing {run.case.name}", ERR), named(run.path):
        roots = mode_roots(case)
        rounded = rounds_without_dead_zone(case.controller, linear_plant(case.actual, case.settings))
    if json:
        told = None if rounded is None else vars(rounded) | {"verdict": rounded.verdict}
        notices = [vars(notice) for notice in case.notices]
        OUT.show(plain({"control": case.controller.kind, "roots": roots, "rounds": told, "notices": notices}))
        return
    rows = [(mode, "stable" if found[0].real < 0 else "unstable", pairs(found)) for mode, found in roots.items()]
    show_table(
        (Column("mode"), Column("loop"), Column("rightmost characteristic roots (rad/s)")), rows, OUT,
        title=f"{run.case.title}: the linear loop that stays in a mode", keys=1,
    )  # fmt: skip
    if rounded is not None:
        OUT.say(f"Without a dead zone: {rounded.words[0].lower()}{rounded.words[1:]}")
    for notice in case.notices:
        OUT.note(notice)


def _plain(found: SwitchedCycle) -> dict[str, Any]:
    return plain(
        {
            "plant": "linear",
            "period": found.period,
            "mirrored": found.mirrored,
            "attracting": found.attracting,
            "switches": len(found.switches) * (2 if found.mirrored else 1),
            "times": found.switches,
            "outputs": found.law.plant.outputs,
            "peak": found.y_peak,
            "range": found.y_range,
            "multipliers": found.multipliers,
            "multiplier_errors": found.multiplier_errors,
            "states": found.states,
            "closure": found.closure,
            "words": found.words,
        }
    )
