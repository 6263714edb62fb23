"""Doubts about a case before it runs, and what of its run file its plants do not have."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from icmj.base.text import did_you_mean
from icmj.case.plants import AnyPlant, keyframe_of
from icmj.engine.corners import corners
from icmj.engine.plant import MujocoPlant
from icmj.errors import RunFileError
from icmj.plant.linear_plant import LinearPlant
from icmj.plant.notice import Notice
from icmj.runfile.schema import RunFile
from icmj.runfile.setpoint_tables import SetpointTable
from icmj.simulation.disturbance import expected, realised
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
    """Notices about noise so slow that its size in one run may differ from the size that was set."""
    for noise in settings.disturbance:
        if not isinstance(noise, Noise) or noise.start >= settings.duration:
            continue
        edge = noise.bandwidth or noise.corner or 0.0
        if edge * (settings.duration - noise.start) > MANY:
            continue
        low, high = expected(noise, settings.duration)
        if low > (1 - SLOW) * noise.size:
            continue
        mean, deviation = realised(noise, settings.duration)
        words = (
            f"{settings.duration - noise.start:g} s are too short for the slow noise on "
            f"{noise.output if noise.input is None else noise.input}, whose SD is {deviation:.2g} about a mean of "
            f"{mean:.2g} with this seed (nominal {noise.size:g}; 95 % of seeds {low:.2g} to {high:.2g}); take a longer "
            "run, or many seeds"
        )
        yield Notice("slow noise", "warning", words)


def followed(run: RunFile) -> Iterator[Notice]:
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
    yield from corners(actual, x, u)


def check_names(run: RunFile, assumed: LinearPlant, plant: AnyPlant) -> None:
    """Names in the run file are checked before anything is computed from them."""
    settings, actual = run.simulation, plant.linearisation.plant
    bodies = plant.bodies if isinstance(plant, MujocoPlant) else ()
    wanted = [("simulation.initial", name, actual.states) for name in settings.initial]
    wanted += [("simulation.observer", name, assumed.states) for name in settings.observer]
    if isinstance(settings.limit, dict):
        wanted += [("simulation.limit", name, actual.states) for name in settings.limit]
    for which, there in (("input", actual.inputs), ("output", actual.outputs), ("body", bodies)):
        named = (getattr(source, which, None) for source in settings.disturbance)
        wanted += [("simulation.disturbance", name, there) for name in named if name is not None]
    for key, name, known in wanted:
        if name not in known:
            hint = did_you_mean(name, known) or f"; expected {'one of ' + ', '.join(known) if known else 'none'}"
            raise RunFileError(f"{run.path}: {key}: no {name!r} in the model{hint}")


def expect_known(run: RunFile, duration: float, end: float, setpoints: Sequence[SetpointTable] = ()) -> None:
    """Refuse a duration [s] beyond the ``end`` [s] to which what came from code or a file, or is a sequence, is known.

    Raises:
        RunFileError: if it is longer, and there is such a disturbance in the run file, or such a set-point.
    """
    made_by = (vars(table).get("made_by") for table in run.simulation.disturbance)
    known = [f"disturbance from {origin}" for origin in made_by if origin]
    known += [f"set-point of kind {table.kind!r}" for table in setpoints if table.kind in ("ternary", "file")]
    if known and duration > end:
        raise RunFileError(
            f"{run.path}: its {known[0]} is known for a run of {end:g} s, not of {duration:g} s; set "
            "simulation.duration in the run file"
        )
