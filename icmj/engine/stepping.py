"""The stepping of a run: adaptive steps to a tolerance, or a fixed timestep with one of MuJoCo's integrators."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco

from icmj.controller.law import Law
from icmj.engine.closed_loop import ComposedLoop
from icmj.engine.model import data_at
from icmj.engine.plant import MujocoPlant
from icmj.engine.schedule import Schedule
from icmj.engine.stages import is_flow, may_constrain
from icmj.engine.tapped import close
from icmj.errors import SimulationError
from icmj.simulation.settings import LEAST_TOLERANCE, Settings

DEFAULT_TOLERANCE = 1e-8


@dataclass(frozen=True)
class Stepping:
    """The steps of a run.

    Attributes:
        timestep: h [s]; with a tolerance a length to begin with.
        tolerance: relative error of an open-loop interval that steps are adapted to; 0 where the timestep is fixed.
        refusal: why steps are not adapted although a tolerance was asked for; empty otherwise.
    """

    timestep: float
    tolerance: float = 0.0
    refusal: str = ""


def stepping_of(loop: ComposedLoop, settings: Settings) -> Stepping:
    """The stepping that the settings request, as far as the model allows it.

    With neither tolerance, timestep nor integrator a model in which nothing can touch, rub or reach a limit is stepped
    adaptively, to 1e-8; any other takes its own timestep and integrator. A tolerance holds for models that *could*
    touch, too, as long as nothing does at the operating point.

    Raises:
        SimulationError: if the timestep is shorter than 1e-9 s or longer than the run.
    """
    asked = settings.tolerance
    if settings.timestep is None and settings.integrator is None:
        refusal = _refusal(loop, asked is not None)
        if not refusal:
            rate = loop.schedule(settings, 1.0).rate
            return Stepping(min(1 / rate, settings.duration), asked or DEFAULT_TOLERANCE)
        return Stepping(timestep_of(loop, settings), refusal=refusal if asked else "")
    return Stepping(timestep_of(loop, settings))


def timestep_of(loop: ComposedLoop, settings: Settings) -> float:
    """The timestep of the settings, or the model's [s].

    Raises:
        SimulationError: if it is shorter than 1e-9 s or longer than the run.
    """
    timestep = float(settings.timestep or loop.model.opt.timestep)
    if not 1e-9 <= timestep <= settings.duration:
        raise SimulationError(f"timestep {timestep} s: expected between 1e-9 s and the duration, {settings.duration} s")
    return timestep


def schedule_of(loop: ComposedLoop, settings: Settings) -> Schedule:
    """The times and steps of a run.

    Raises:
        SimulationError: as for :func:`stepping_of`.
    """
    steps = stepping_of(loop, settings)
    return loop.schedule(settings, steps.timestep, steps.tolerance)


def refined(plant: MujocoPlant, controller: Law, settings: Settings, factor: float) -> Settings:
    """The settings with ``factor`` on the timestep, or its fourth power on the tolerance.

    Raises:
        ModelError, SimulationError: as for :func:`icmj.engine.closed_loop.close_loop` and :func:`stepping_of`.
    """
    steps = stepping_of(close(plant, controller, settings), settings)
    if steps.tolerance:
        return replace(settings, tolerance=max(factor**4 * steps.tolerance, LEAST_TOLERANCE))
    return replace(settings, timestep=factor * steps.timestep, tolerance=None)


def _refusal(loop: ComposedLoop, asked: bool) -> str:
    """Why the motion may not be smooth; empty if it is smooth."""
    model = loop.model
    if not is_flow(model):
        return "an activation that is clamped or taken a step ahead, a body that sleeps or yields, or a flex"
    if not may_constrain(model):
        return ""
    if not asked:
        return "contacts, limits, friction losses or equalities may act"
    data = data_at(model, loop.plant.linearisation.point)
    mujoco.mj_forward(model, data)
    return f"{data.nefc} constraints act at the operating point" if data.nefc else ""
