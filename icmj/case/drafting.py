"""A first run file for a model: its operating point, possible outputs, and weights of suitable size."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from icmj.case.case import expect_prediction, prepare
from icmj.case.draft_text import Draft, draft_text
from icmj.engine.inventory import Inventory, inventory
from icmj.engine.plant import MujocoPlant, load_plant
from icmj.errors import IcmjError, ModelError
from icmj.plant.linear_plant import LinearPlant
from icmj.plant.selection import OperatingKind, OperatingRule, Selection
from icmj.runfile.reading import parse_run

if TYPE_CHECKING:
    from icmj.case.case import PredictedCase

RULES: tuple[OperatingKind, ...] = ("as given", "static control", "balance")
MOTION = ("rad", "m", "rad/s", "m/s", "")  # forces and accelerations jump with the inputs
MOST_KEYFRAMES = 6  # that are tried


@dataclass(frozen=True, eq=False)
class Drafted:
    """A first run file.

    Attributes:
        text: of the run file.
        case: made of it; ``None`` where something is in the way.
        trouble: what that is, in one line; "" if nothing is.
    """

    text: str
    case: PredictedCase | None
    trouble: str


def draft_run(model: Path, out: Path, keyframe: str | None = None) -> Drafted:
    """A commented run file for a model, to be written to ``out``, with the model's own names in it.

    Of the model's keyframes, or its reference configuration, it takes the first at which the model rests by itself,
    else the first at which controls can hold it, else one near which it balances; as outputs all sensors but those that
    jump with the inputs, or joints where sensors leave something unseen. Weights are of the size of the plant's gain.

    Args:
        model: MJCF file.
        out: where the run file will lie; the model's path in it is relative to that, if it is on the way.
        keyframe: the one to take.

    Raises:
        ModelError: if the model cannot be loaded, or has no such keyframe.
    """
    there = inventory(model)
    if keyframe is not None and keyframe not in there.keyframes:
        raise ModelError(f"{model}: no keyframe {keyframe!r}; it has {', '.join(there.keyframes) or 'none'}")
    nothing = Draft(model, out, there, keyframe, "as given", None, "joints", (), 1.0, 1.0)
    best, trouble = None, ""
    for keyed, rule in _attempts(there, keyframe):
        try:
            plant, outputs, drop = _chosen(model, there, keyed, rule)
        except IcmjError as error:
            trouble = str(error)
            continue
        draft = Draft(model, out, there, keyed, rule, plant.linearisation.plant, outputs, drop, *weights(plant))
        text = draft_text(draft)
        try:
            return Drafted(text, expect_prediction(prepare(parse_run(text, out)), "a first run file"), "")
        except IcmjError as error:
            best = best or Drafted(text, None, str(error).removeprefix(f"{out}: "))
    return best or Drafted(draft_text(nothing), None, trouble)


def weights(plant: MujocoPlant) -> tuple[float, float]:
    """R_c and R_o for which the costs of control and of outputs are of similar size.

    |G|² of the plant's response from inputs to outputs about its fastest unstable rate, a tenth and a hundredth of it.
    """
    linear: LinearPlant = plant.linearisation.plant
    rates = linear.poles.real
    fastest = float(rates.max()) if rates.max() > 1e-3 else float(np.median(np.abs(linear.poles)))
    s = complex(0.1, 1.0) * max(fastest, 0.1)
    G = linear.C @ np.linalg.solve(s * np.eye(linear.n) - linear.A, linear.B.astype(complex))
    size = float(np.abs(G).max()) ** 2
    return _rounded(0.1 * size), _rounded(0.01 * size)


def _rounded(value: float) -> float:
    """Round to one digit, within the range that a run file accepts."""
    return float(f"{min(max(value, 1e-12), 1e12):.0e}") if np.isfinite(value) else 1.0


def _attempts(there: Inventory, keyframe: str | None) -> Iterator[tuple[str | None, OperatingKind]]:
    keyframes: list[str | None] = [keyframe] if keyframe else [*there.keyframes[:MOST_KEYFRAMES], None]
    for rule in RULES:
        for keyed in keyframes:
            yield keyed, rule


def _chosen(
    model: Path, there: Inventory, keyframe: str | None, rule: OperatingKind
) -> tuple[MujocoPlant, tuple[str, ...] | str, tuple[str, ...]]:
    """The plant at one operating point, its outputs, and the states that affect neither outputs nor other states.

    Raises:
        ModelError: if it does not rest there, or has no outputs.
    """
    # sensors of places and rates, if any tells where anything is
    outputs: tuple[str, ...] | str = "joints"
    if {"rad", "m"} & set(there.outputs.values()):
        outputs = tuple(name for name, unit in there.outputs.items() if unit in MOTION)
    drop: tuple[str, ...] = ()
    for _ in range(4):
        plant = load_plant(
            model, keyframe=keyframe, selection=Selection(outputs=outputs, drop=drop), operating=OperatingRule(rule)
        )
        quality = plant.quality
        errors = [notice for notice in quality.notices if notice.severity == "error"]
        for notice in errors:
            if notice.kind == "not at rest":
                raise ModelError(notice.words)
        lost = {name for mode in quality.uncontrollable if not mode.stable for name in mode.states} & {*quality.idle}
        unseen = any(not mode.stable for mode in quality.unobservable)
        if lost - {*drop}:
            drop = (*drop, *sorted(lost - {*drop}))
            seen = tuple(there.joints) if outputs == "joints" else outputs
            outputs = tuple(name for name in seen if name not in drop)
        elif quality.feedthrough and outputs != "joints":
            outputs = tuple(name for name in outputs if name not in quality.feedthrough) or "joints"
        elif unseen and outputs != "joints" and outputs != tuple(there.joints):
            outputs = tuple(name for name in there.joints if name not in drop) if drop else "joints"
        else:
            break
    return plant, outputs, drop
