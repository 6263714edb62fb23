"""What there is to doubt of a case before it runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from icmj.case.plants import AnyPlant, keyframe_of
from icmj.engine.plant import MujocoPlant
from icmj.plant.notice import Notice
from icmj.runfile.schema import RunFile
from icmj.theory.prediction import Prediction


def doubts(run: RunFile, assumed: AnyPlant, actual: AnyPlant) -> Iterator[Notice]:
    """What there is to tell of both plants; what holds for both is told once."""
    yield from assumed.told
    told = {notice.kind for notice in assumed.told}
    yield from (_of(notice, "actual") for notice in actual.told if notice.kind not in told)
    common = [notice for notice in assumed.quality.notices if notice in actual.quality.notices]
    yield from common
    for which, plant in (("assumed", assumed), ("actual", actual)):
        yield from (_of(notice, which) for notice in plant.quality.notices if notice not in common)
    if run.on_engine and keyframe_of(run) is None and run.assumed.keyframe is not None:
        words = (
            f"the actual model has no keyframe {run.assumed.keyframe!r} and is taken at its reference configuration; "
            "name one in [actual] keyframe"
        )
        yield Notice("keyframe", "warning", words)
    if run.disowned:
        words = "[case.paper] speaks of another plant, design or rule than this run file has; it is left out"
        yield Notice("paper", "warning", words)
    if not isinstance(actual, MujocoPlant):
        return
    biased = [
        name
        for name, beta in zip(actual.linearisation.plant.outputs, actual.linearisation.ports.beta, strict=True)
        if beta
    ]
    if biased:
        words = f"the bias of {', '.join(biased)} acts in MuJoCo only; the linear theory and plant have no offset"
        yield Notice("sensor bias", "warning", words)


def _of(notice: Notice, which: str) -> Notice:
    return replace(notice, words=f"{notice.words} ({which} plant)")


def reach(actual: AnyPlant, prediction: Prediction) -> Iterator[Notice]:
    """Inputs that saturate, and joints that reach the ends of their ranges, on the predicted orbit itself."""
    if prediction.orbit is None or not isinstance(actual, MujocoPlant):
        return
    plant, ports = actual.linearisation.plant, actual.linearisation.ports
    peaks = dict(zip(plant.inputs, np.abs(prediction.orbit.u).max(axis=0) * np.abs(ports.b), strict=True))
    for margin in actual.quality.margins:
        room, peak = min(margin.down, margin.up), peaks[margin.of]
        if peak > room:
            words = (
                f"the predicted orbit moves {margin.of} by {peak:.3g}, and its ctrlrange leaves {room:.3g}; the linear "
                "theory knows no limits"
            )
            yield Notice("saturation", "warning", words)
    peaks = dict(zip(plant.states, prediction.orbit.x_peak, strict=True))
    for joint in actual.quality.room:
        room, peak = min(joint.down, joint.up), peaks[joint.of]
        if peak > room:
            words = (
                f"the predicted orbit moves {joint.of} by {peak:.3g}, and {max(room, 0):.3g} are left to an end of its "
                "range; the linear theory knows no limits"
            )
            yield Notice("joint limit", "warning", words)
