"""What there is to doubt of a case before it runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from icmj.case.plants import AnyPlant, keyframe_of
from icmj.engine.corners import corners
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
    """Limits that the predicted orbit reaches, and other corners of the plant on it."""
    if prediction.orbit is None or np.isinf(prediction.orbit.gamma) or not isinstance(actual, MujocoPlant):
        return
    orbit, n = prediction.orbit, actual.linearisation.plant.n
    x, u = orbit.X[:, :n], orbit.u
    if orbit.sign < 0:  # the other half is the mirror image
        x, u = np.vstack([x, -x]), np.vstack([u, -u])
    yield from corners(actual, x, u)
