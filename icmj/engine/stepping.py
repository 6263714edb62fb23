"""The steps of a run: a timestep that is given, or one that is chosen for a tolerance.

All steps are of one length, shortened where something is due. A timestep that is chosen is for the classical method of
Runge and Kutta, which errs in one step of y' = λy by |λh|⁵/120 of y. What dies out errs most at t = −1/Re λ, by
h⁴|λ|⁵ t/(120 e) of its size at the start; what grows goes on to err as long as an interval lasts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from icmj.base.array import Array
from icmj.controller.law import Law
from icmj.engine.closed_loop import ComposedLoop, close_loop, refuse_choice
from icmj.engine.plant import MujocoPlant
from icmj.engine.schedule import Schedule, compute_rates
from icmj.errors import SimulationError
from icmj.simulation.settings import LEAST_TOLERANCE, Settings

DEFAULT_TOLERANCE = 1e-8
SHORTEST = 1e-9  # s, of all steps
ROWS = 1000  # rows within a step; there is room for them
WITHIN = 10.0  # error allowed of any state at a row over the tolerance
AIM = 3.0  # what is chosen for, of what dies out fast: states are sums of modes
SLOWLY = 0.4  # of that, for what an interval is made of
TIME_CONSTANTS = 3.0  # of what grows, in an interval
RETURNING = 0.1  # of that, where errors come back
SLOW, STILL = 1e-3, 1e-9  # of the fastest rate: of the slowest mode that counts, and of one that moves by rounding
SIMPSON = 24.0  # a sinusoid that only drives is summed by Simpson's rule, which errs by (ωh)⁴/2880


@dataclass(frozen=True)
class Stepping:
    """The steps of a run.

    Attributes:
        timestep: h [s].
        tolerance: relative error of an open-loop interval that h is chosen for; 0 where it is given.
        refusal: why it is not chosen although a tolerance was asked for; empty otherwise.
    """

    timestep: float
    tolerance: float = 0.0
    refusal: str = ""


def choose_stepping(loop: ComposedLoop, settings: Settings) -> Stepping:
    """The steps that the settings request, as far as the model allows it.

    With neither tolerance, timestep nor integrator the step is chosen for 1e-8 in a model in which nothing can touch,
    rub or reach a limit; any other takes its own timestep and integrator. A tolerance holds for models that *could*
    touch, too, as long as nothing does at the operating point.

    Raises:
        SimulationError: if the timestep is shorter than 1e-9 s or longer than the run.
    """
    if settings.timestep is not None or settings.integrator is not None:
        return Stepping(get_timestep(loop, settings))
    if refusal := refuse_choice(loop, settings):
        return Stepping(get_timestep(loop, settings), refusal=refusal if settings.tolerance else "")
    tolerance = settings.tolerance or DEFAULT_TOLERANCE
    return Stepping(choose_step(loop, settings, tolerance), tolerance)


def get_timestep(loop: ComposedLoop, settings: Settings) -> float:
    """The timestep of the settings, or the model's [s].

    Raises:
        SimulationError: if it is shorter than 1e-9 s or longer than the run.
    """
    timestep = float(settings.timestep or loop.model.opt.timestep)
    if not SHORTEST <= timestep <= settings.duration:
        raise SimulationError(f"timestep {timestep} s: expected between 1e-9 s and the duration, {settings.duration} s")
    return timestep


def choose_step(loop: ComposedLoop, settings: Settings, tolerance: float) -> float:
    """The timestep for a tolerance [s]: of all modes of the controller, and of all that drives the loop."""
    law, real = loop.controller, loop.controller.realisation
    omega = np.append(loop.acting.omega, real.signals[:, 2])
    returning = not loop.by_steps or real.delay > 0 or len(omega) > 0
    step = step_for(compute_rates(loop.plant.linearisation.plant, law), omega, tolerance, returning=returning)
    most = ROWS * settings.record_interval  # rows of a step
    return max(min(round_step(step), settings.duration, most), SHORTEST)


def step_for(rates: np.ndarray, omega: Array, tolerance: float, *, returning: bool = False) -> float:
    """The longest step [s] of a loop with eigenvalues ``rates`` under sinusoids ``omega`` that errs by a tolerance.

    Less than the inverse of what is fastest, beyond which the estimate of its error says nothing. What dies out much
    faster than the rest moves or grows adds less to that, in proportion, and may err by more. Where errors are
    ``returning``, through delays or in noise that goes on, the rest may by a tenth.
    """
    rates, omega = rates[np.abs(rates) > STILL * np.abs(rates).max(initial=0.0)], np.abs(omega)
    size, dying = np.abs(rates), np.minimum(rates.real, 0.0)
    # an interval lasts some time constants of what grows; what only swings is followed over some periods
    lasting = TIME_CONSTANTS / np.maximum(np.abs(rates.real), size / (2 * np.pi))
    worst = np.minimum(lasting, 1 / np.maximum(-dying, 1e-300))
    spans = worst * np.exp(dying * worst)
    slowest = size.min(initial=np.inf, where=size > SLOW * size.max(initial=0.0))
    rest = max(float(slowest), float(rates.real.max(initial=0.0)))
    share = SLOWLY * (RETURNING if returning else 1.0)
    spans = spans / np.clip(share * -dying / rest, share, 1.0)
    terms = np.append(size**5 * spans, omega**4 / (SIMPSON * RETURNING))
    fastest = float(np.append(size, omega).max(initial=0.0))
    if fastest == 0:
        return math.inf
    step = min((120 * AIM * tolerance / float(terms.max())) ** 0.25, 1 / fastest)
    return step / (1 + step * fastest) ** 0.25  # the order after the fifth, relative to what is left after a step


def round_step(step: float) -> float:
    """The step, down to five binary digits: rates carry rounding errors, which must not show in the step."""
    if math.isinf(step):
        return step
    mantissa, exponent = math.frexp(step)
    return math.ldexp(math.floor(mantissa * 32) / 32, exponent)


def make_schedule(loop: ComposedLoop, settings: Settings) -> Schedule:
    """The times and steps of a run.

    Raises:
        SimulationError: as for :func:`choose_stepping`.
    """
    steps = choose_stepping(loop, settings)
    return loop.schedule(settings, steps.timestep, steps.tolerance)


def refine(plant: MujocoPlant, controller: Law, settings: Settings, factor: float) -> Settings:
    """The settings with ``factor`` on the timestep, or its fourth power on the tolerance.

    Raises:
        ModelError, SimulationError: as for :func:`icmj.engine.closed_loop.close_loop` and :func:`choose_stepping`.
    """
    steps = choose_stepping(close_loop(plant, controller, settings), settings)
    if steps.tolerance:
        return replace(settings, tolerance=max(factor**4 * steps.tolerance, LEAST_TOLERANCE))
    return replace(settings, timestep=factor * steps.timestep, tolerance=None)
