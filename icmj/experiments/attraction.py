"""Where a loop goes from many starts: growth, the amplitude law, attractors, rounds.

Growth per interval under a clock: measured in simulation, for comparison with the prediction of panel (a).

The amplitude law: the engine's departure from the linear prediction falls with the square of the threshold.

The model is odd-symmetric, so its first departure from linearity is cubic in the state and the relative error of
interval and amplitude is quadratic in q_t (docs/simulation.md). An error that stops falling is a fault of the loop.

Coexisting attractors: the motions that the closed loop settles on from many starts, each reported separately.

Rounds of a switched controller: the factor by which the motion grows or shrinks in a round, and its cycle.

A feedback of delayed outputs that is switched on and off in their plane (:mod:`icmj.controller.switching`) and has no
dead zone is homogeneous: a motion scaled at the start is scaled throughout. So it settles on rounds, each of which is
the one before times a factor, and that factor is the verdict: below 1 the body stands, above 1 it falls. With a dead
zone rounds of factor 1 are a cycle, whose size is in proportion to the zone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import singledispatch

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array, between
from icmj.base.blas_threads import limit_to_one_thread
from icmj.case.case import Case, PlantKind, expect_rule, expect_theory, open_loop, simulate
from icmj.case.result import AmplitudeLaw, Attractor, Growth
from icmj.controller.controller import Controller, Law
from icmj.controller.switching import SwitchingPD
from icmj.controller.trigger import ClockTrigger
from icmj.errors import AnalysisError, SimulationError, expect
from icmj.linear.run import simulate as simulate_exactly
from icmj.measurement.measurement import Measurement, event_states, growth_per_interval, measure, reduced_states
from icmj.plant.linear_plant import LinearPlant, Match, expect_linear, match_ports, transformation
from icmj.simulation.settings import Settings
from icmj.simulation.simulation import Simulation
from icmj.theory.error_system import ErrorSystem

SIZE = 1e-6  # of the start state: small enough that the engine's plant is linear, far above rounding
LEAST_INTERVALS = 6  # the least that a growth is measured from


def undriven(case: Case) -> Case:
    """The same case without set-point and disturbances: the loop itself, of which eigenvalues and orbits are."""
    controller = replace(expect_rule(case, "a loop without set-point"), setpoint=None)
    settings = replace(case.settings, disturbance=())
    run = case.run.with_(**{"setpoint": None, "simulation.disturbance": None})
    return replace(case, run=run, controller=controller, settings=settings)


def measure_growth(case: Case, plant: PlantKind, points: int) -> Growth | None:
    """Simulate the case under clocks with intervals around Δ_crit, and measure the growth of x̄ from event to event.

    Each run starts along the dominant eigenvector of φ(Δ), so that the growth appears immediately. Like φ(Δ), it is of
    the loop itself: set-point and disturbances of the case are left out.

    Returns:
        The points; ``None`` if ``points`` is 0. If Δ_crit is undefined, they are spread over the interval searched.
        Values that overflow are NaN.
    """
    theory, case = expect_theory(case, "growth under a clock"), undriven(case)
    if points == 0:
        return None
    delta_crit = theory.prediction.delta_crit
    end = 1.25 * delta_crit if delta_crit is not None else case.run.analysis.delta_max
    t_d = theory.system.delay.t_d  # a clock faster than the delay is another map
    deltas = t_d + np.linspace((end - t_d) / points, end - t_d, points)
    measured, predicted = zip(*(_growth(case, theory.system, plant, float(delta)) for delta in deltas), strict=True)
    return Growth(deltas, np.array(measured), np.array(predicted))


def _growth(case: Case, system: ErrorSystem, plant: PlantKind, delta: float) -> tuple[float, float]:
    with np.errstate(over="ignore", invalid="ignore"):
        phi = system.phi(delta)
    if not np.isfinite(phi).all():  # something grows so fast that no number holds it
        return float("nan"), float("nan")
    eigenvalues, vectors = np.linalg.eig(phi)
    dominant = int(np.argmax(np.abs(eigenvalues)))
    w = SIZE * np.real(vectors[:, dominant]) / np.linalg.norm(np.real(vectors[:, dominant]))
    try:
        fly = open_loop(case, plant, trigger=ClockTrigger(delta), duration=(LEAST_INTERVALS + 0.5) * delta)
    except SimulationError:  # six intervals are shorter than a timestep
        return float("nan"), float(np.abs(eigenvalues[dominant]))
    x, x_o, x_h = system.start(w)
    states = []
    for i in range(LEAST_INTERVALS):
        flight = fly(x, x_o, x_h, i * delta)
        if flight.outcome is not None:
            break
        x, x_o, x_h = flight.x, flight.x_o, flight.x_h if system.delay else flight.x_o
        states.append(reduced_states(x, x_o, system.T_hat, x_h if system.delay else None))
    return growth_per_interval(np.array(states).reshape(-1, len(w))), float(np.abs(eigenvalues[dominant]))


INTERVALS = 40  # the linear orbit is near the engine's; the difference dies out well within these
REFINEMENT = 0.5  # of the run file's timestep: at the smallest thresholds the error sought is 1e-8


def measure_law(case: Case, q_t: Sequence[float]) -> AmplitudeLaw | None:
    """Simulate the case in MuJoCo at each threshold, starting on the predicted orbit, and fit the slopes.

    Like the predicted orbit, it is of the loop itself: set-point and disturbances of the case are left out.

    Returns:
        The law; ``None`` if no attracting cycle is predicted or there are fewer than two thresholds. A threshold at
        which the run does not settle has NaN errors and is left out of the fit.
    """
    theory, case = expect_theory(case, "the amplitude law"), undriven(case)
    orbit, trigger, system = theory.prediction.orbit, theory.rule, theory.system
    if len(q_t) < 2 or orbit is None or theory.prediction.verdict != "attracting":
        return None
    errors = []
    for threshold in q_t:
        run = simulate(
            case,
            "mujoco",
            trigger=trigger.resized(threshold),
            start=system.start(orbit.x_bar * (threshold / trigger.size)),
            duration=INTERVALS * orbit.delta,
            refinement=REFINEMENT,
        )
        measured = measure(run, T_hat=system.T_hat)
        if measured.interval is None or measured.kind != "cycle":
            errors.append((np.nan, np.nan))
            continue
        peak = orbit.y_peak * (threshold / trigger.size)
        errors.append((abs(measured.interval / orbit.delta - 1), float(np.abs(measured.amplitude / peak - 1).max())))
    interval, amplitude = np.array(errors).T
    q = np.array(q_t, dtype=float)
    return AmplitudeLaw(q, interval, amplitude, _slope(q, interval), _slope(q, amplitude))


def _slope(q_t: Array, error: Array) -> float:
    good = np.isfinite(error) & (error > 0)
    if good.sum() < 2:
        return float("nan")
    return float(np.polyfit(np.log(q_t[good]), np.log(error[good]), 1)[0])


MAGNITUDES = (0.3, 1.0, 3.0, 10.0)
_EXTENSIONS = 4


@limit_to_one_thread()
def attractors(
    plant: LinearPlant,
    controller: Controller,
    settings: Settings,
    *,
    starts: int = 40,
    seed: int = 0,
    magnitudes: tuple[float, ...] = MAGNITUDES,
    tolerance: float = 1e-4,
    progress: Callable[[int], None] | None = None,
    match: Match = "name",
) -> tuple[Attractor, ...]:
    """The motions that the linear closed loop reaches from ``starts`` random initial states, the most frequent first.

    Plant state and observer error are drawn at random; each entry is scaled by its largest value in the run that
    ``settings`` describes, and by the ``magnitudes`` in turn. A motion that has not settled is continued for up to
    eight times the duration. Two cycles are one attractor if their states at the events agree up to a shift along the
    cycle, or up to the sign (the loop is odd, so the mirror image of a motion is a motion); other motions are grouped
    by their kind. The limit on positions is not applied, because the loop is linear. The search may miss attractors
    with a small basin.

    Args:
        plant: the actual plant.
        controller: a controller with any trigger.
        settings: duration, disturbances, and the run that sets the scale.
        starts: number of initial states.
        seed: seed of the random initial states.
        magnitudes: factors on the scale, used in turn.
        tolerance: relative agreement of two cycles.
        progress: called with the number of starts done.
        match: how inputs and outputs of the plant are assigned to those of the controller's model, as for
            :func:`icmj.case.case.simulate_plant`.

    Raises:
        AnalysisError: if they do not correspond, or the controller is not intermittent.
        SimulationError: as :func:`icmj.linear.run.simulate`, or if the run that sets the scale stays at zero.
    """
    expect(controller, Controller, "the search for attractors", "simulate other controllers from starts of your own")
    plant = match_ports(plant, controller.design.plant, match)
    T_hat = transformation(controller.design.plant, plant)
    settings = replace(settings, limit=1e9, record_interval=settings.duration / 50)
    scale_x, scale_o = _scales(simulate_exactly(plant, controller, settings), T_hat)
    random = np.random.default_rng(seed)
    found: list[Attractor] = []
    for i in range(starts):
        magnitude = magnitudes[i % len(magnitudes)]
        x0 = magnitude * scale_x * random.standard_normal(plant.n)
        x_o0 = T_hat @ x0 + magnitude * scale_o * random.standard_normal(len(T_hat))
        measurement, states = _settle(plant, controller, settings, T_hat, x0, x_o0)
        new = Attractor(measurement, states, 1, 1 / starts, x0, x_o0)
        for j, known in enumerate(found):
            if _same(known, new, tolerance):
                count = known.count + 1
                found[j] = Attractor(known.measurement, known.states, count, count / starts, known.x0, known.x_o0)
                break
        else:
            found.append(new)
        if progress is not None:
            progress(i + 1)
    return tuple(sorted(found, key=lambda attractor: -attractor.count))


def _scales(run: Simulation, T_hat: Array) -> tuple[Array, Array]:
    scale = np.abs(reduced_states(run.x, run.x_o, T_hat)).max(axis=0)
    scale_x, scale_o = np.split(scale, [run.x.shape[1]])
    if not (scale_x.max() > 0 and np.isfinite(scale_x).all()):
        raise SimulationError("the run that sets the scale of the starts stays at zero; give it an initial state")
    return scale_x, scale_o


def _settle(
    plant: LinearPlant,
    controller: Controller,
    settings: Settings,
    T_hat: Array,
    x: Array,
    x_o: Array,
) -> tuple[Measurement, Array]:
    """The motion from (x, x_o), run again for twice as long while it has not settled."""
    for extension in range(_EXTENSIONS):
        longer = replace(settings, duration=settings.duration * 2**extension)
        run = simulate_exactly(plant, controller, longer, x0=x, x_o0=x_o)
        measurement = measure(run, T_hat=T_hat)
        # anything bounded that has not closed may still be a transient
        if measurement.kind in ("cycle", "homoclinic", "growth"):
            break
    states = event_states(run, T_hat)
    return measurement, states[len(states) - (measurement.p or 0) :]


def _same(known: Attractor, new: Attractor, tolerance: float) -> bool:
    if known.measurement.kind != new.measurement.kind or len(known.states) != len(new.states):
        return False
    if len(new.states) == 0:
        return True
    size = np.abs(known.states).max()
    return any(
        np.abs(known.states - sign * np.roll(new.states, shift, axis=0)).max() < tolerance * size
        for shift in range(len(new.states))
        for sign in (1, -1)
    )


MOST = 12  # switches of a round that are looked for
CLOSED = 1e-6  # relative: rounds that differ by less are the same but for their size
EDGE = 1e-6  # of a factor: nearer to 1 it is on the edge
_TOLD, _FEWEST = (1e-9, 1e-2), 4  # departures that are small, and no rounding; how many of them tell how fast they go
_START, _LIMIT = 1e-6, 1e8  # sizes of a motion that is followed, in units of its plant


@dataclass(frozen=True)
class Rounds:
    """The rounds of a motion under a switched controller; see the glossary for this term.

    Attributes:
        factor: size of a round divided by that of the previous round; NaN if no rounds are found.
        period: duration of a round [s]; NaN if no rounds are found.
        switches: number of switches in a round; 0 if no rounds are found.
        mirrored: whether each round is the mirror image of the previous one.
        growth: growth rate of the size [1/s]: log factor / period or, without rounds, that of the whole motion.
        closure: relative difference of the last two rounds, apart from their size.
        multiplier: factor by which a deviation from the settled rounds changes in one round: the largest |multiplier|,
            estimated from the approach of the run to them; NaN if the approach was too fast for an estimate.
    """

    factor: float
    period: float
    switches: int
    mirrored: bool
    growth: float
    closure: float
    multiplier: float = float("nan")

    @property
    def verdict(self) -> str:
        """``stands``, ``falls``, ``on the edge``, or ``not settled`` if the motion switches without rounds so far."""
        if np.isfinite(self.closure) and self.switches == 0:
            return "not settled"
        size = self.growth if np.isnan(self.period) else self.factor - 1
        return "on the edge" if abs(size) <= EDGE else "stands" if size < 0 else "falls"

    @property
    def words(self) -> str:
        """The result in one sentence."""
        if self.switches == 0:
            return f"No rounds were found; the size changes by {self.growth:+.3g} 1/s: {self.verdict}."
        mirrored = ", mirrored" if self.mirrored else ""
        if self.verdict == "on the edge":
            return f"It settles on a cycle of {self.period:.6g} s ({self.switches} switches{mirrored})."
        return (
            f"Each round of {self.period:.6g} s ({self.switches} switches{mirrored}) is the one before times "
            f"{self.factor:.8g}: {self.verdict}."
        )


def rounds_of(run: Simulation) -> Rounds:
    """The rounds on which a run under a switched controller has settled, from its last switches.

    Args:
        run: a run on either plant; its events are the switches.
    """
    x, interval = run.events.x, run.events.interval
    size = np.linalg.norm(x, axis=1)
    if len(x) < 3 or size[-1] == 0:
        rows = np.linalg.norm(run.x, axis=1)
        half = len(rows) // 2
        there = rows[half] > 0 and rows[-1] > 0 and run.t[-1] > run.t[half]
        growth = np.log(rows[-1] / rows[half]) / (run.t[-1] - run.t[half]) if there else np.nan
        return Rounds(np.nan, np.nan, 0, False, float(growth), np.nan)
    closure = np.inf
    for q in range(1, min(MOST, (len(x) - 1) // 2) + 1):
        now, before = x[-q:], x[-2 * q : -q]
        factor = float(np.sum(now * before) / np.sum(before * before))
        apart = np.abs(now - factor * before).max() / np.abs(now).max()
        late = np.abs(interval[-q:] - interval[-2 * q : -q]).max() / interval[-q:].max()
        closure = min(closure, float(max(apart, late)))
        if max(apart, late) < CLOSED:
            period = float(interval[-q:].sum())
            growth = float(np.log(abs(factor)) / period)
            left = _deviation_factor(x[(len(x) - 1) % q :: q], factor)
            return Rounds(abs(factor), period, q, factor < 0, growth, float(max(apart, late)), left)
    later = between(run.events.t, run.events.t[-1] / 2) & (size > 0)
    growth = np.polyfit(run.events.t[later], np.log(size[later]), 1)[0] if later.sum() > 1 else np.nan
    return Rounds(np.nan, np.nan, 0, False, float(growth), closure)


def _deviation_factor(x: Array, factor: float) -> float:
    """The factor per round of a deviation from x ↦ factor · x, estimated from the ends of rounds."""
    departure = np.linalg.norm(x[1:] - factor * x[:-1], axis=1) / np.linalg.norm(x[1:], axis=1)
    told = np.flatnonzero((departure > _TOLD[0]) & (departure < _TOLD[1]))
    return float(np.exp(np.polyfit(told, np.log(departure[told]), 1)[0])) if len(told) >= _FEWEST else float("nan")


@singledispatch
def rounds_without_dead_zone(law: Law, plant: LinearPlant) -> Rounds | None:
    """The rounds of a controller whose dead zone is taken away; ``None`` of one that has none to be taken, or does not
    switch.
    """
    return None


@rounds_without_dead_zone.register
def _(law: SwitchingPD, plant: LinearPlant) -> Rounds | None:
    return rounds(plant, replace(law, dead_zone=0.0)) if law.switches else None


def rounds(
    plant: LinearPlant, law: SwitchingPD, *, duration: float = 40.0, direction: ArrayLike | None = None
) -> Rounds:
    """The rounds of a switched loop without a dead zone on the linear plant, simulated exactly.

    Args:
        plant: a plant with the inputs and outputs of the law's plant.
        law: a controller without a dead zone.
        duration: duration of the simulated motion [s].
        direction: direction of the initial state, shape (n,); by default that of the first state.

    Raises:
        AnalysisError: if the law has a dead zone.
    """
    expect_linear(plant, "the plant")
    expect(law, SwitchingPD, "the analysis of rounds")
    if law.dead_zone:
        raise AnalysisError(
            f"the dead zone is {law.dead_zone:g}; only without one are rounds in proportion: give dead_zone=0, or "
            "simulate the run and take rounds_of(run)"
        )
    start = np.eye(plant.n)[0] if direction is None else np.asarray(direction, float)
    settings = Settings(duration=duration, limit=_LIMIT, record_interval=duration / 50)
    return rounds_of(simulate_exactly(plant, law, settings, x0=_START * start / np.linalg.norm(start)))


@dataclass(frozen=True, eq=False)
class Attraction:
    """The map of the gains with which a switched controller keeps a body upright.

    Attributes:
        P, D: gains, shapes (p,) and (d,).
        factor: factor per round, NaN if no rounds are found, shape (d, p).
        growth: growth rate of the size [1/s], shape (d, p).
    """

    P: Array
    D: Array
    factor: Array
    growth: Array

    @property
    def stands(self) -> Array:
        """Whether the size decreases, shape (d, p)."""
        return np.asarray(self.growth < 0)


def attraction(
    plant: LinearPlant,
    law: SwitchingPD,
    P: ArrayLike,
    D: ArrayLike,
    *,
    duration: float = 40.0,
    progress: Callable[[float], None] | None = None,
) -> Attraction:
    """The map of attraction over gains: the factor per round for every pair of gains (:func:`icmj.experiments.rounds`).

    Args:
        plant, law, duration: as for :func:`icmj.experiments.rounds`; the gains of the law are replaced.
        P, D: gains, shapes (p,) and (d,).
        progress: called repeatedly with the completed fraction, 0–1.
    """
    P, D = np.asarray(P, float), np.asarray(D, float)
    factor, growth = np.empty((len(D), len(P))), np.empty((len(D), len(P)))
    for j, d in enumerate(D):
        for i, p in enumerate(P):
            found = rounds(plant, replace(law, P=p, D=d), duration=duration)
            factor[j, i], growth[j, i] = found.factor, found.growth
        if progress is not None:
            progress((j + 1) / len(D))
    return Attraction(P, D, factor, growth)
