"""The amplitude law: the engine's departure from the linear prediction falls with the square of the threshold.

The model is odd-symmetric, so its first departure from linearity is cubic in the state and the relative error of
interval and amplitude is quadratic in q_t (docs/simulation.md). An error that stops falling is a fault of the loop.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from icmj.base.array import Array
from icmj.case.case import Case, expect_theory, simulate
from icmj.case.result import AmplitudeLaw
from icmj.experiments.growth import undriven
from icmj.measurement.measurement import measure

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
