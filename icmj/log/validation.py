"""Checks of a result beyond its types: matching shapes, increasing times, finite numbers.

A log is believed only as far as this: the digest in it says that nothing has changed since it was written, not that
what was written makes sense.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from icmj.base.array import Array
from icmj.case.result import Result
from icmj.controller.controller import expect_intermittent
from icmj.errors import AnalysisError, LogError
from icmj.log.conformity import conform
from icmj.simulation.simulation import Simulation
from icmj.theory.orbit import Orbit
from icmj.theory.prediction import Prediction

MOST_EVENTS = 64  # of one period; eight are looked for


def validate(result: Result) -> None:
    """Check everything that readers of a result rely on.

    Raises:
        LogError: at the first thing that is not as promised, by its dotted place.
    """
    conform(result)
    actual, assumed, controller = result.actual, result.controller.plant, result.controller
    _require((actual.n_u, actual.n_y) == (assumed.n_u, assumed.n_y), "actual", "has other inputs or outputs")
    observed = controller.observed
    _simulation(result, "simulation", result.simulation, assumed.n if observed else 0)
    if result.prediction is None:
        for name in ("continuous", "measurement", "growth", "law", "statistics"):
            _require(getattr(result, name) is None, name, "is there without a prediction")
        _require(not result.attractors, "attractors", "are there without a prediction")
        return
    _require(observed, "prediction", f"is there for a {controller.kind} controller")
    _require(result.measurement is not None, "measurement", "is missing beside a prediction")
    _plants(result)
    if (beside := result.continuous) is not None:
        _simulation(result, "continuous", beside, result.assumed.n)
        _require(result.simulation.plant == beside.plant, "continuous.plant", "is not that of the simulation")
    _measurement(result)
    _prediction(result, result.prediction)
    _experiments(result)
    _statistics(result)


def _plants(result: Result) -> None:
    assumed, controller = result.assumed, expect_intermittent(result.controller)
    delayed, design = bool(result.simulation.delay) == bool(controller.delay), controller.design
    _require(delayed, "simulation.delay", "and the controller's are not one: only one of them is none")
    mine, theirs = (design.plant.n, design.plant.n_u, design.plant.n_y), (assumed.n, assumed.n_u, assumed.n_y)
    _require(mine == theirs, "controller.design.plant", f"has the sizes {mine}, expected {theirs}")
    _finite("controller.design.k", design.k)
    _finite("controller.design.L", design.L)
    _shape("controller.hold.A_h", controller.hold.A_h, assumed.n, assumed.n)
    _finite("controller.hold.A_h", controller.hold.A_h)
    try:
        controller.trigger.faces(design)
    except (AnalysisError, ValueError, IndexError) as error:
        raise LogError(f"controller.trigger does not fit the design: {error}") from error


def _simulation(result: Result, name: str, simulation: Simulation, m: int) -> None:
    n, n_u, n_y = result.actual.n, result.actual.n_u, result.actual.n_y
    N = _rising(f"{name}.t", simulation.t, least=1)
    _shapes(name, simulation, x=(N, n), y=(N, n_y), u=(N, n_u), x_o=(N, m), x_h=(N, m), E=(N,))
    if simulation.applied.size:
        _shape(f"{name}.applied", simulation.applied, N, n_u)
    acting = simulation.applied.shape[1] + simulation.pushed.shape[1] + (m + 1 if m else 0)
    for which, sides, more in (("jumps", simulation.jumps, 0), ("leads", simulation.leads, acting)):
        if sides.size:
            _shape(f"{name}.{which}", sides, None, 1 + n_u + more)
            _rising(f"{name}.{which}", sides[:, 0], least=0)
    if simulation.pushes or simulation.pushed.size:
        _shape(f"{name}.pushed", simulation.pushed, N, len(simulation.pushes))
    if simulation.qpos.size:
        _shape(f"{name}.qpos", simulation.qpos, N, None)
    _require(simulation.qpos.ndim == 2, f"{name}.qpos", f"has shape {simulation.qpos.shape}")
    _pressure(f"{name}.pressure", simulation)
    for key, width in (("states", n), ("inputs", n_u), ("outputs", n_y), ("assumed", result.assumed.n)):
        for kind in (key, f"{key.removesuffix('s')}_units"):
            count = len(getattr(simulation.labels, kind))
            _require(count in (0, width), f"{name}.labels.{kind}", f"has {count} words for {width} columns")
    events, end = simulation.events, simulation.outcome.t
    _require(np.isfinite(end) and end >= 0, f"{name}.outcome.t", f"is {end}; expected a time")
    if (followed := simulation.setpoint) is not None:
        r = len(followed.names)
        _shapes(f"{name}.setpoint", followed, x_ss=(result.assumed.n, r), u_ss=(n_u, r), terms=(None, 6))
    _rising(f"{name}.edges", simulation.edges, least=0)
    K = _rising(f"{name}.events.t", events.t, least=0)
    _require(K == 0 or events.t[-1] <= simulation.t[-1] * (1 + 1e-9), f"{name}.events.t", "ends after the run")
    widths = {"x": n, "x_o": m, "x_h": m, "y_max": n_y, "y_min": n_y}
    _shapes(f"{name}.events", events, **{key: (K, width if K else None) for key, width in widths.items()})


def _pressure(name: str, simulation: Simulation) -> None:
    pressure, N = simulation.pressure, len(simulation.t)
    if pressure is None:
        return
    K, G = len(pressure.t_after), len(pressure.geoms)
    _require(K in (0, len(simulation.events)), f"{name}.t_after", f"has {K} times for {len(simulation.events)} events")
    _shapes(name, pressure, t=(N,), centre=(N, 2), at_rest=(2,), load=(N, G), load_at_rest=(G,))
    _shapes(name, pressure, t_after=(K,), centre_after=(K, 2), load_after=(K, G))


def _measurement(result: Result) -> None:
    measured = result.motion
    for where, told in (("measurement", measured), ("prediction", result.prediction)):
        for key in ("outputs", "output_units"):
            count = len(getattr(told, key))
            _require(count in (0, result.actual.n_y), f"{where}.{key}", f"has {count} words")
    _shape("measurement.amplitude", measured.amplitude, result.actual.n_y)
    _require(measured.intervals.ndim == 1, "measurement.intervals", f"has shape {measured.intervals.shape}")
    _require(bool((measured.intervals > 0).all()), "measurement.intervals", "holds one that is not positive")
    if measured.p is not None:
        _require(1 <= measured.p <= MOST_EVENTS, "measurement.p", f"is {measured.p}")
    if measured.kind == "cycle":
        for key in ("p", "interval", "period"):
            _require(getattr(measured, key) is not None, f"measurement.{key}", "is missing, though there is a cycle")
        _shape("measurement.intervals", measured.intervals, measured.p)
        _require(len(result.simulation.events) >= (measured.p or 0), "measurement.p", "is more than there are events")
    for key in ("interval", "period"):
        _positive(f"measurement.{key}", getattr(measured, key))


def _prediction(result: Result, prediction: Prediction) -> None:
    size = _at_events(result)
    for key in ("delta_crit", "period", "delta_max"):
        _positive(f"prediction.{key}", getattr(prediction, key))
    for i, crossing in enumerate(prediction.crossings):
        _positive(f"prediction.crossings.{i}.delta", crossing.delta)
    _shapes("prediction", prediction, amplitude=(result.actual.n_y,), V_inv=(size, size), multipliers=(None,))
    if prediction.delta_crit is not None:
        missing = [key for key in ("eigenvalue", "orbit", "gamma") if getattr(prediction, key) is None]
        _require(not missing, "prediction", f"has a Δ_crit, but no {', '.join(missing)}")
    _require(not prediction.cycle or prediction.period is not None, "prediction.cycle", "is true without a period")
    if prediction.orbit is not None:
        _require(prediction.delta_crit is not None, "prediction.orbit", "is there without a Δ_crit")
        _orbit(result, "prediction.orbit", prediction.orbit)
    for i, other in enumerate(prediction.others):
        where = f"prediction.others.{i}"
        _positive(f"{where}.crossing.delta", other.crossing.delta)
        _orbit(result, f"{where}.orbit", other.orbit)
        _shapes(where, other, V_inv=(size, size), multipliers=(None,))


def _orbit(result: Result, where: str, orbit: Orbit) -> None:
    n, m, n_u, n_y = result.actual.n, result.assumed.n, result.actual.n_u, result.actual.n_y
    M = _rising(f"{where}.t", orbit.t, least=2, twice=1 if result.simulation.delay else 0)  # the action
    _positive(f"{where}.delta", orbit.delta)
    _positive(f"{where}.period", orbit.period)
    _require(orbit.sign in (1, -1), f"{where}.sign", f"is {orbit.sign}; expected 1 or -1")
    _shapes(where, orbit, x_bar=(_at_events(result),), X=(M, n + 2 * m), y=(M, n_y), u=(M, n_u), e_hp=(M, m), E=(M,))
    for key, width in (("y", n_y), ("u", n_u), ("x", n)):
        for what in ("peak", "range"):
            _shape(f"{where}.{key}_{what}", getattr(orbit, f"{key}_{what}"), width)


def _experiments(result: Result) -> None:
    n, m = result.actual.n, result.assumed.n
    if result.growth is not None:
        points = _rising("growth.delta", result.growth.delta, least=1)
        _shapes("growth", result.growth, measured=(points,), predicted=(points,))
    if (law := result.law) is not None:
        _shape("law.q_t", law.q_t, None)
        _require(
            bool(len(law.q_t) and (law.q_t > 0).all() and np.isfinite(law.q_t).all()), "law.q_t", "is no threshold"
        )
        _shapes("law", law, interval_error=(len(law.q_t),), amplitude_error=(len(law.q_t),))
    for i, attractor in enumerate(result.attractors):
        where = f"attractors.{i}"
        _shapes(where, attractor, states=(None, _at_events(result)), x0=(n,), x_o0=(m,))
        _require(attractor.count >= 1 and 0 <= attractor.share <= 1, where, "has no sensible count or share")


def _statistics(result: Result) -> None:
    told, n_y = result.statistics, result.actual.n_y
    if told is None:
        return
    _require(0 <= told.start <= told.end, "statistics.start", f"is {told.start:g} s, the end {told.end:g} s")
    bins = len(told.counts)
    _shapes("statistics", told, counts=(bins,), edges=(bins + 1 if bins else 0,))
    for key in ("mean", "rms"):
        found = len(getattr(told, key))
        _require(found == n_y, f"statistics.{key}", f"has {found} numbers for {n_y} outputs")
    F = _rising("statistics.spectrum.frequency", told.spectrum.frequency, least=2)
    _shapes("statistics.spectrum", told.spectrum, power=(F, n_y), low=(F, n_y), high=(F, n_y))


def _at_events(result: Result) -> int:
    """Length of the state that the map from event to event acts on; with a delay it includes the hold."""
    n, m = result.actual.n, result.assumed.n
    return n + 2 * m if result.simulation.delay else n + m


def _rising(where: str, t: Array, least: int, twice: int = 0) -> int:
    """The number of times in ``t``, which increase from zero or later; at most ``twice`` are repeated, for jumps."""
    _require(t.ndim == 1 and len(t) >= least, where, f"has shape {t.shape}; expected at least {least} times")
    gaps = np.diff(t)
    good = np.isfinite(t).all() and (t[:1] >= 0).all() and (gaps >= 0).all() and (gaps == 0).sum() <= twice
    _require(bool(good), where, "does not rise, or holds what is no time")
    return len(t)


def _shapes(where: str, thing: Any, **expected: tuple[int | None, ...]) -> None:
    """The shapes of attributes by their names, of those that are there."""
    for key, shape in expected.items():
        if (values := getattr(thing, key)) is not None:
            _shape(f"{where}.{key}", values, *shape)


def _shape(where: str, values: Any, *expected: int | None) -> None:
    fits = values.ndim == len(expected) and all(
        want is None or have == want for have, want in zip(values.shape, expected, strict=False)
    )
    wanted = ", ".join("any" if want is None else str(want) for want in expected)
    _require(fits, where, f"has shape {values.shape}; expected ({wanted})")


def _finite(where: str, values: Array) -> None:
    _require(bool(np.isfinite(values).all()), where, "holds a NaN or an infinity")


def _positive(where: str, value: float | None) -> None:
    if value is not None:
        _require(bool(np.isfinite(value) and value > 0), where, f"is {value}; expected a positive number")


def _require(good: bool, where: str, otherwise: str) -> None:
    if not good:
        raise LogError(f"the archive is not that of a run: {where} {otherwise}")
