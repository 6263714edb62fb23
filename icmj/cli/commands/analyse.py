"""``icmj analyse``: what linear theory predicts of a case."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from icmj.cli.arguments import POSITIONAL
from icmj.cli.overrides import Overrides, say_changes
from icmj.cli.progress import Working
from icmj.cli.table import Column, show_table
from icmj.errors import prefix_errors

if TYPE_CHECKING:
    from icmj.case.case import Case
    from icmj.cli.terminal import Terminal
    from icmj.plant.quality import Notice
    from icmj.theory.prediction import Prediction
    from icmj.theory.spread import Spread


CROSSINGS = (
    Column("Δ (s)"), Column("eigenvalue"), Column("kind", rank=2), Column("direction", rank=1),
    Column("largest other |λ|"),
)  # fmt: skip
ORBITS = (
    Column("Δ (s)"), Column("λ"), Column("period (s)", rank=2), Column("γ", rank=2), Column("peaks", rank=1),
    Column("largest multiplier"), Column("verdict"),
)  # fmt: skip


@dataclass(frozen=True)
class AnalyseCommand(Overrides):
    """Predict by linear theory: critical open-loop interval, eigenvalues that cross the unit circle, limit cycle.

    For a controller that is not intermittent, the characteristic roots of its loop are computed instead; for one that
    switches, also how fast its motion grows.

    Example: icmj analyse simple-0.8 --json
    """

    group = "Predict"

    run: Annotated[Path, POSITIONAL]
    """Run file, or name of a shipped case."""
    json: bool = False
    """Print JSON instead of a table."""

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Print the prediction for one run file."""
        from icmj.base.numbers import amount, amounts, number, root
        from icmj.case.case import prepare
        from icmj.cli.spread import find_spread, say_spread
        from icmj.cli.standing import say_standing
        from icmj.theory.prediction import PREDICTION

        run = self.load(self.run)
        with Working(label := f"analysing {run.case.name}", err) as working:
            case = prepare(run, progress=lambda done: working.tell(label, done))
        prediction, plant = case.prediction, case.assumed.linearisation.plant
        if prediction is None:
            _show_roots(case, self.json, out, err)
            return
        outputs, units = plant.outputs, plant.output_units or ("",) * plant.n_y
        if self.json:
            out.show(_plain_prediction(prediction, outputs, case.notices) | _plain_spread(find_spread(case)))
            return
        rows = []
        for fact in PREDICTION:
            value = fact.value(prediction)
            if fact.kind != "outputs":
                rows.append((fact.label, fact.shown(value)))
            elif value is not None:
                each = zip(outputs, value, units, strict=True)
                rows += [(fact.label_of(name), amount(float(peak), unit)) for name, peak, unit in each]
        show_table((Column(""), Column("")), rows, out, title=run.title)
        say_changes(run, out)
        found = [
            (number(c.delta, 6), root(c.eigenvalue), c.kind, c.direction, amount(c.largest_other, figures=4))
            for c in prediction.crossings
        ]
        if found:
            show_table(CROSSINGS, found, out, title=f"Unit-circle crossings up to {prediction.delta_max:g} s")
        else:
            out.say(f"No unit-circle crossing up to {prediction.delta_max:g} s.")
        if prediction.others:
            orbits = [
                (
                    number(one.orbit.delta, 6), root(one.crossing.eigenvalue), number(one.orbit.period, 6),
                    number(one.orbit.gamma), amounts(one.orbit.y_peak, outputs, units), number(one.multiplier),
                    f"{one.verdict}: {one.orbit.reason}" if one.orbit.reason else one.verdict,
                )
                for one in prediction.orbits
            ]  # fmt: skip
            show_table(ORBITS, orbits, out, title="Orbits, one for each crossing at ±1")
        if prediction.beyond is not None:
            out.say(f"A quick look further shows one at {prediction.beyond.delta:.4g} s: raise analysis.delta_max.")
        out.say(say_standing(prediction))
        if spread := say_spread(find_spread(case)):
            out.say(spread)
        for words in prediction.remarks:
            out.say(words[0].upper() + words[1:] + ".")
        for notice in case.notices:
            if not (self.set and notice.kind == "paper") and notice.words not in prediction.remarks:
                out.note(notice)


def _plain_prediction(prediction: Prediction, outputs: tuple[str, ...], notices: Iterable[Notice]) -> dict[str, Any]:
    """What ``icmj analyse --json`` prints: the prediction and the notices about its plants."""
    from icmj.base.numbers import collect_facts, pick, plain
    from icmj.case.comparison import finite
    from icmj.theory.prediction import PREDICTION

    return plain(
        {
            "notices": list(notices),
            **collect_facts(PREDICTION, prediction, "record"),
            "outputs": outputs,
            "missing": prediction.missing or None,
            "multipliers": prediction.multipliers,
            "crossings": [
                pick(c, "delta", "eigenvalue", "kind", "direction", "largest_other", "multiplicity")
                for c in prediction.crossings
            ],
            "orbits": [
                {
                    "delta": one.orbit.delta,
                    "eigenvalue": one.crossing.eigenvalue,
                    "direction": one.crossing.direction,
                    "period": one.orbit.period,
                    "gamma": finite(one.orbit.gamma),
                    "amplitude": one.orbit.y_peak if one.family is None else None,
                    "multipliers": one.multipliers,
                    "verdict": one.verdict,
                    "reason": one.orbit.reason or None,
                    "family": None if one.family is None else one.family.words,
                }
                for one in prediction.orbits
            ],
            **pick(prediction, "delta_max", "unresolved"),
            "beyond": None if prediction.beyond is None else prediction.beyond.delta,
            "neutral": prediction.neutral,
            "family": None if prediction.family is None else prediction.family.words,
            "continuous_stable": {
                "state_feedback": prediction.state_feedback_stable,
                "observer_feedback": prediction.observer_feedback_stable,
            },
        }
    )


def _plain_spread(spread: Spread | str) -> dict[str, Any]:
    """The same as ``icmj analyse --json`` prints it: numbers or ``null``, and the reason; nothing without noise."""
    from icmj.base.numbers import pick, plain

    if isinstance(spread, str):
        return {"spread": None, "no_spread": spread} if spread else {}
    return {"spread": plain(pick(spread, "deviation", "correlation", "shift", "epsilon"))}


def _show_roots(case: Case, json: bool, out: Terminal, err: Terminal) -> None:
    """Print the characteristic roots of a loop that stays in each mode, and its rounds if it has any."""
    from icmj.base.numbers import pairs, plain
    from icmj.case.case import mode_roots
    from icmj.case.plants import linear_plant
    from icmj.experiments.switching_rounds import rounds_without_dead_zone

    run = case.run
    with Working(f"analysing {run.case.name}", err), prefix_errors(run.path):
        roots = mode_roots(case)
        rounded = rounds_without_dead_zone(case.controller, linear_plant(case.actual, case.settings))
    if json:
        told = None if rounded is None else vars(rounded) | {"verdict": rounded.verdict}
        notices = [vars(notice) for notice in case.notices]
        out.show(plain({"control": case.controller.kind, "roots": roots, "rounds": told, "notices": notices}))
        return
    rows = [(mode, "stable" if found[0].real < 0 else "unstable", pairs(found)) for mode, found in roots.items()]
    show_table(
        (Column("mode"), Column("loop"), Column("rightmost characteristic roots (rad/s)")), rows, out,
        title=f"{run.title}: the linear loop that stays in a mode", keys=1,
    )  # fmt: skip
    say_changes(run, out)
    if rounded is not None:
        out.say(f"Without a dead zone: {rounded.words[0].lower()}{rounded.words[1:]}")
    for notice in case.notices:
        out.note(notice)


COMMAND = AnalyseCommand
