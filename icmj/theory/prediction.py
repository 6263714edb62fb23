"""The prediction: what the linear eigen-analysis says of the closed loop (paper, section 3; docs/theory.md)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.controller.controller import Controller
from icmj.controller.hold import system_matched
from icmj.controller.trigger import ClockTrigger, EventRule
from icmj.theory.clocked import is_stable
from icmj.theory.crossings import Crossing, search
from icmj.theory.eigenstructure import eigenstructure
from icmj.theory.error_system import ErrorSystem
from icmj.theory.flow import flow
from icmj.theory.orbit import Orbit
from icmj.theory.orbit import orbit as orbit_at
from icmj.theory.return_map import jacobian, multipliers

Verdict = Literal["attracting", "repelling", "not admissible", "none"]


@dataclass(frozen=True, eq=False)
class Prediction:
    """Everything that the linear analysis says of one controller on one plant.

    Attributes:
        delta_crit: Δ_crit [s], or ``None`` where undefined: the first rising crossing at ±1 with all other
            eigenvalues inside the circle (a cycle is predicted); failing that the first at ±1 (none is);
            else undefined.
        eigenvalue: λ_crit, or ``None``.
        cycle: whether a limit cycle is predicted by the paper's argument.
        period: Δ_crit for λ = +1, 2Δ_crit for −1; ``None`` if no cycle is predicted.
        gamma: γ, ``None`` where there is no orbit.
        amplitude: peak of every output over the orbit, shape (n_y,), or ``None``.
        crossings: all unit-circle crossings on the interval searched, by rising Δ.
        delta_max: end of the interval searched [s].
        orbit: the orbit at Δ_crit (also where no cycle is predicted, to show why), or ``None``.
        multipliers: eigenvalues of the return map's Jacobian J under the event rule, or ``None``.
        verdict: ``attracting``, ``repelling``, ``not admissible`` or ``none``.
        v_condition: condition number of the eigenvector matrix V of φ(Δ_crit); NaN if undefined.
        V_inv: rows map x̄ to χ; shape (n + n̂, n + n̂); row 0 is the critical one. ``None`` where undefined.
            (If V is too ill-conditioned, row 0 is the left eigenvector and the rest an orthonormal basis of
            the complementary invariant subspace's annihilator, from a Schur form.)
        state_feedback_stable: whether A − Bk is stable (full state feedback on the actual plant, without a delay).
        observer_feedback_stable: whether plant + observer under continuous control is stable; with a delay, under a
            clock of a twentieth of it, which is the continuous predictor controller nearly.
    """

    delta_crit: float | None
    eigenvalue: complex | None
    cycle: bool
    period: float | None
    gamma: float | None
    amplitude: Array | None
    crossings: tuple[Crossing, ...]
    delta_max: float
    orbit: Orbit | None
    multipliers: NDArray[np.complex128] | None
    verdict: Verdict
    v_condition: float
    V_inv: NDArray[np.complex128] | None
    state_feedback_stable: bool
    observer_feedback_stable: bool


def predict(system: ErrorSystem, trigger: EventRule, *, delta_max: float = 3.0) -> Prediction:
    """The whole linear analysis of one controller on one plant.

    Args:
        system: the error system of the actual plant.
        trigger: the event rule, with its Δ_min.
        delta_max: end of the interval of Δ searched [s].

    Raises:
        AnalysisError: if ``delta_max`` is not positive and finite, or the rule does not fit.
    """
    prepared = flow(system.A_C)
    found = search(system, delta_max, prepared=prepared)
    critical, cycle = critical_crossing(found.crossings)
    orbit, multiplier, V_inv, condition = None, None, None, float("nan")
    verdict: Verdict = "none"
    if critical is not None:
        sign = 1 if critical.kind == "+1" else -1
        orbit = orbit_at(system, trigger, critical.delta, sign, prepared=prepared)
        structure = eigenstructure(system.phi(critical.delta), sign)
        V_inv, condition = structure.V_inv, structure.condition
        J = jacobian(system, trigger, orbit, prepared=prepared)
        multiplier = multipliers(J) if np.isfinite(J).all() else None
        if not orbit.admissible or multiplier is None:
            verdict = "not admissible"
        else:
            verdict = "attracting" if np.abs(multiplier[0]) < 1 else "repelling"
    return Prediction(
        delta_crit=critical.delta if critical else None,
        eigenvalue=critical.eigenvalue if critical else None,
        cycle=cycle,
        period=orbit.period if orbit and cycle else None,
        gamma=orbit.gamma if orbit else None,
        amplitude=orbit.y_peak if orbit else None,
        crossings=found.crossings,
        delta_max=found.delta_end,
        orbit=orbit,
        multipliers=multiplier,
        verdict=verdict,
        v_condition=condition,
        V_inv=V_inv,
        state_feedback_stable=_stable(system.actual.A - system.actual.B @ system.k),
        observer_feedback_stable=_observer_feedback_stable(system),
    )


def critical_crossing(crossings: tuple[Crossing, ...]) -> tuple[Crossing | None, bool]:
    """The crossing that defines Δ_crit, and whether it predicts a cycle (docs/theory.md)."""
    real = [c for c in crossings if c.kind != "complex"]
    for c in real:
        if c.direction == "rising" and c.largest_other < 1:
            return c, True
    return (real[0], False) if real else (None, False)


def _observer_feedback_stable(system: ErrorSystem) -> bool:
    """Whether plant and observer are stable under continuous control; with a delay, under its limit, a fast clock."""
    if not system.delay:
        return _stable(system.T @ system.A_C @ system.T_bar)  # φ'(0)
    hold = system.hold or system_matched(system.design)
    clock = ClockTrigger(system.delay.t_d / 20)
    return is_stable(system.actual, Controller(system.design, hold, clock, system.delay))


def _stable(A: Array) -> bool:
    return bool(np.linalg.eigvals(A).real.max(initial=-np.inf) < 0)
