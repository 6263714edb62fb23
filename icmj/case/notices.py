"""Notices about a case: what its theory leaves out, limits that its orbit reaches, noise that one run cannot show."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from icmj.case.iosystem import AnyPlant
from icmj.case.plants import keyframe_of
from icmj.engine.corners import find_corners
from icmj.engine.plant import MujocoPlant
from icmj.plant.quality import Notice
from icmj.runfile.schema import RunFile
from icmj.simulation.disturbance import bound_realisation, measure_realisation
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Noise
from icmj.theory.prediction import Prediction

SLOW = 0.25  # of the size of a noise: what a run may fall short of it without a word
MANY = 20.0  # periods of the edge of its spectrum, beyond which no run falls short by so much


def doubts(run: RunFile, assumed: AnyPlant, actual: AnyPlant) -> Iterator[Notice]:
    """The notices about both plants; a notice that applies to both appears once."""
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
    if run.assumed.person and not run.actual.model_dump(exclude_defaults=True):
        words = (
            "the actual person follows the assumed one; there is no model error (to change only one of them, give "
            "[actual.person], with the height and mass of the actual person)"
        )
        yield Notice("person", "warning", words)
    if run.disowned:
        words = (
            "this run differs from the published case in plant, design or rule; published values of [case.paper] are "
            "not shown"
        )
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


def slow_noise(settings: Settings) -> Iterator[Notice]:
    """A notice about noise so slow that its size in one run may differ from the size that was set."""
    slow: dict[float, list[str]] = {}  # by the time that it acts, one for each input and output
    for noise in settings.disturbance:
        if not isinstance(noise, Noise) or noise.start >= settings.duration:
            continue
        edge = noise.bandwidth or noise.corner or 0.0
        if edge * (settings.duration - noise.start) > MANY:
            continue
        low, high = bound_realisation(noise, settings.duration)
        if low > (1 - SLOW) * noise.size:
            continue
        mean, deviation = measure_realisation(noise, settings.duration)
        words = (
            f"{noise.output if noise.input is None else noise.input}, whose SD is {deviation:.2g} about a mean of "
            f"{mean:.2g} with this seed (nominal {noise.size:g}; 95 % of seeds {low:.2g} to {high:.2g})"
        )
        slow.setdefault(settings.duration - noise.start, []).append(words)
    for seconds, each in slow.items():
        words = (
            f"{seconds:g} s are too short for the slow noise on {'; on '.join(each)}; take a longer run, or many seeds"
        )
        yield Notice("slow noise", "warning", words)


def doubt_setpoint(run: RunFile) -> Iterator[Notice]:
    """Notices about a set-point and a sampling delay, which the linear theory does not cover."""
    if run.setpoint:
        words = (
            "the prediction is that of r = 0; intervals and peaks measured in a run include the motion that the "
            "set-point asks for"
        )
        yield Notice("set-point", "warning", words)
    if late := run.intermittent.sampling_delay:
        words = (
            f"the prediction is that of a controller that samples at its threshold, and this one samples {late:g} s "
            "later; intervals and peaks of a run are others"
        )
        yield Notice("sampling delay", "warning", words)


def reach(actual: AnyPlant, prediction: Prediction) -> Iterator[Notice]:
    """Limits that the predicted orbit reaches, and other corners of the plant on it."""
    if prediction.orbit is None or np.isinf(prediction.orbit.gamma) or not isinstance(actual, MujocoPlant):
        return
    orbit, n = prediction.orbit, actual.linearisation.plant.n
    x, u = orbit.X[:, :n], orbit.u
    if orbit.sign < 0:  # the other half is the mirror image
        x, u = np.vstack([x, -x]), np.vstack([u, -u])
    yield from find_corners(actual, x, u)
