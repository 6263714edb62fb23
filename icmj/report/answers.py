"""Answers to the paper's statements: each check reads a verdict and its reason from the runs of a case."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from icmj.base.numbers import eigenvalue, error, number
from icmj.comparison.verdict import halves
from icmj.plant.linear_plant import transformation
from icmj.report.pairing import CaseRuns
from icmj.report.style import NAME

Verdict = Literal["reproduced", "reproduced with a reservation", "not reproduced"]

PRINTED = 0.5  # damping ratio of the neglected dynamics in the paper


@dataclass(frozen=True)
class Answer:
    """A verdict, and why, with the numbers."""

    verdict: Verdict
    why: str


def gain_is(b: float, reservation: str = "") -> Callable[[CaseRuns], Answer]:
    """The plant's inputs act b times as strongly as the controller assumes."""

    def check(case: CaseRuns) -> Answer:
        B, B_hat = case.first.actual.B, case.first.assumed.B
        if B.shape != B_hat.shape:
            return Answer("not reproduced", f"B is {B.shape[0]} × {B.shape[1]}, B̂ {B_hat.shape[0]} × {B_hat.shape[1]}.")
        ratio = float(np.sum(B * B_hat) / np.sum(B_hat * B_hat))
        why = f"The linearised MuJoCo plant has B = {ratio:.6g} B̂"
        ok = np.allclose(B, b * B_hat, rtol=1e-6, atol=1e-6 * np.abs(B_hat).max())
        return _answer(ok, why, reservation)

    return check


def critical_interval(delta: float, digits: int, sign: int, reservation: str = "") -> Callable[[CaseRuns], Answer]:
    """Δ_crit rounds to the printed value, with the eigenvalue at ±1."""

    def check(case: CaseRuns) -> Answer:
        prediction = case.prediction
        if prediction.delta_crit is None or prediction.eigenvalue is None:
            return Answer("not reproduced", "No eigenvalue crosses the circle at ±1.")
        why = f"Δ_crit = {number(prediction.delta_crit)} s, λ = {eigenvalue(prediction.eigenvalue)}"
        ok = abs(prediction.delta_crit - delta) <= 0.5 * 10**-digits and abs(prediction.eigenvalue - sign) < 1e-6
        if not ok:
            why += f"; the paper has {delta:.{digits}f} s and {sign:+d}".replace("-", "−")
        return _answer(ok, why, reservation)

    return check


def further_eigenvalue(delta: float, digits: int) -> Callable[[CaseRuns], Answer]:
    """As :func:`critical_interval` at −1, with another eigenvalue that spoils the cycle."""
    first = critical_interval(delta, digits, -1)

    def check(case: CaseRuns) -> Answer:
        answer = first(case)
        others = [c.largest_other for c in case.prediction.crossings if c.delta == case.prediction.delta_crit]
        if answer.verdict != "reproduced" or not others:
            return answer
        why = f"{answer.why.rstrip('.')}; the further eigenvalue has magnitude {others[0]:.3f} at this interval"
        if others[0] <= 1:
            return Answer("not reproduced", f"{why}, inside the circle.")
        return _answer(True, why, "it lies outside the circle, not on it; the two eigenvalues do not cross −1 together")

    return check


def periodic(sign: int, reservation: str = "") -> Callable[[CaseRuns], Answer]:
    """The output settles to period Δ_crit (λ = +1), or to 2Δ_crit with mirrored halves (λ = −1)."""

    def check(case: CaseRuns) -> Answer:
        parts, ok = [], True
        for plant, result in case.runs.items():
            m = result.measurement
            settled = case.comparisons[plant].measured.converged
            ok = ok and settled and m.p == (2 if sign < 0 else 1)
            if m.period is None:
                parts.append(f"{NAME[plant]}: {_lower(m.words)}")
            else:
                ratio = (
                    ""
                    if case.prediction.delta_crit is None
                    else f" = {_times(m.period / case.prediction.delta_crit)}Δ_crit"
                )
                mirrored = f", {halves(m)}" if m.mirrored or (settled and m.p == 2) else ""
                parts.append(f"{NAME[plant]}: period {number(m.period, 5)} s{ratio}{mirrored}")
        return _answer(ok, _sentence(parts), reservation)

    return check


def interval_converges(reservation: str = "") -> Callable[[CaseRuns], Answer]:
    """Δ_ol settles at Δ_crit."""

    def check(case: CaseRuns) -> Answer:
        parts, ok = [], True
        for plant, comparison in case.comparisons.items():
            ok = ok and comparison.measured.converged
            parts.append(
                f"{NAME[plant]}: {number(comparison.measured.interval, 5)} s, "
                f"relative error {error(comparison.relative_error.interval)}"
            )
        return _answer(ok, _sentence(parts), reservation)

    return check


def no_limit_cycle(case: CaseRuns) -> Answer:
    """No run settles on a cycle, neither on that of Δ_crit nor on another."""
    cycles = [result.measurement.kind == "cycle" for result in case.runs.values()]
    ok = not any(cycles) and not case.prediction.cycle
    parts = [f"{NAME[plant]}: {_lower(result.measurement.words)}" for plant, result in case.runs.items()]
    multipliers = case.prediction.multipliers
    if multipliers is not None and len(multipliers):
        largest = float(np.abs(multipliers).max())
        side = "repelling" if largest > 1 else "attracting"
        parts.insert(0, f"The orbit at Δ_crit is {side} (largest multiplier {largest:.3f})")
    if any(cycles) and not any(comparison.measured.converged for comparison in case.comparisons.values()):
        parts.append("thus not on the cycle of Δ_crit, but on another one")
    return _answer(ok, _sentence(parts), "")


def three_phase_planes(case: CaseRuns) -> Answer:
    """Panel (d) has three velocities against three angles."""
    outputs = case.first.actual.outputs
    return _answer(len(outputs) == 3, f"Panel (d) draws {', '.join(outputs)}", "")


def neglected_dynamics(case: CaseRuns) -> Answer:
    """The actual plant has dynamics that the assumed one lacks."""
    actual, assumed = case.first.actual, case.first.assumed
    dynprm = case.first.run.actual.dynprm
    values = next(iter(dynprm.values()), None)
    fast = _neglected_pole(case)
    why = f"{actual.n} states; {assumed.n} are assumed"
    if fast is not None:
        why += f"; neglected poles {number(fast.real)} ± {number(fast.imag)}j, ζ = {-fast.real / abs(fast):.3g}"
    elif values:
        why += f"; actuator parameters {values}"
    if not (reservation := _other_damping(case)):
        why += ", as printed in the paper"
    return _answer(actual.n > assumed.n, why, reservation)


def continuous_unstable(case: CaseRuns) -> Answer:
    """A − Bk, the continuous state feedback on the actual plant, is unstable."""
    first = case.first
    T_hat = transformation(first.assumed, first.actual)
    values = np.linalg.eigvals(first.actual.A - first.actual.B @ first.controller.design.k @ T_hat).astype(complex)
    worst = values[np.argmax(values.real)]
    why = f"The rightmost eigenvalue of A − Bk is {number(worst.real, 3)} ± {number(abs(worst.imag), 3)}j"
    reservation = ""
    if worst.real > 0 and case.prediction.observer_feedback_stable:
        reservation = "with the observer in the loop the continuous controller is stable"
    return _answer(worst.real > 0, why, reservation)


def damped(check: Callable[[CaseRuns], Answer]) -> Callable[[CaseRuns], Answer]:
    """As ``check``, with a reservation if the damping ratio of the neglected dynamics is not the printed one."""

    def checked(case: CaseRuns) -> Answer:
        answer, reservation = check(case), _other_damping(case)
        if answer.verdict == "not reproduced" or not reservation:
            return answer
        why = answer.why.rstrip(".")
        joined = "; " if answer.verdict == "reproduced with a reservation" else ". Reservation: "
        return Answer("reproduced with a reservation", f"{why}{joined}{reservation}.")

    return checked


def _neglected_pole(case: CaseRuns) -> complex | None:
    """The upper one of the fast poles that the assumed plant lacks."""
    actual, assumed = case.first.actual, case.first.assumed
    fast = [pole for pole in actual.poles if abs(pole) > 2 * max(abs(assumed.poles)) and pole.imag > 0]
    return complex(fast[0]) if fast else None


def _other_damping(case: CaseRuns) -> str:
    """A reservation if the damping ratio is not the printed one; otherwise empty."""
    pole = _neglected_pole(case)
    damping = None if pole is None else -pole.real / abs(pole)
    if damping is not None and abs(damping - PRINTED) < 1e-3:
        return ""
    given = "another damping ratio" if damping is None else f"ζ = {damping:.3g}"
    return f"with {given}; the paper prints ζ = {PRINTED:g}"


def _times(ratio: float) -> str:
    """A factor before a symbol: nothing for 1, no blank after a whole number."""
    text = f"{ratio:.6g}"
    return "" if text == "1" else text if text.isdigit() else f"{text} "


def _lower(words: str) -> str:
    return words[:1].lower() + words[1:].rstrip(".")


def _sentence(parts: Sequence[str]) -> str:
    """Parts joined into one sentence with a capital, without the full stop."""
    text = "; ".join(part[:1].lower() + part[1:] if part[:2] not in ("Mu", "Δ_") else part for part in parts)
    return text[:1].upper() + text[1:] if text[:1] != "Δ" else text


def _answer(ok: bool, why: str, reservation: str) -> Answer:
    if not ok:
        return Answer("not reproduced", f"{why}.")
    if reservation:
        return Answer("reproduced with a reservation", f"{why}. Reservation: {reservation}.")
    return Answer("reproduced", f"{why}.")
