"""The paper's statements: what each says, and the check that reads its verdict and reason from the runs of a case."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from icmj.base.numbers import eigenvalue, error, number
from icmj.case.comparison import halves
from icmj.plant.linear_plant import transformation
from icmj.report.case_runs import CaseRuns
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
        found = case.prediction.paper
        if found is None:
            return Answer("not reproduced", "No eigenvalue crosses the circle at ±1.")
        why = f"Δ_crit = {number(found.delta)} s, λ = {eigenvalue(found.eigenvalue)}"
        ok = abs(found.delta - delta) <= 0.5 * 10**-digits and abs(found.eigenvalue - sign) < 1e-6
        if not ok:
            why += f"; the paper has {delta:.{digits}f} s and {sign:+d}".replace("-", "−")
        return _answer(ok, why, reservation)

    return check


def further_eigenvalue(delta: float, digits: int) -> Callable[[CaseRuns], Answer]:
    """As :func:`critical_interval` at −1, with another eigenvalue that spoils the cycle."""
    first = critical_interval(delta, digits, -1)

    def check(case: CaseRuns) -> Answer:
        answer = first(case)
        found = case.prediction.paper
        if answer.verdict != "reproduced" or found is None:
            return answer
        why = (
            f"{answer.why.rstrip('.')}; the further eigenvalue has magnitude {found.largest_other:.3f} at this interval"
        )
        if found.largest_other <= 1:
            return Answer("not reproduced", f"{why}, inside the circle.")
        return _answer(True, why, "it lies outside the circle, not on it; the two eigenvalues do not cross −1 together")

    return check


def periodic(sign: int, reservation: str = "") -> Callable[[CaseRuns], Answer]:
    """The output settles to period Δ_crit (λ = +1), or to 2Δ_crit with mirrored halves (λ = −1)."""

    def check(case: CaseRuns) -> Answer:
        parts, ok = [], True
        for plant, result in case.runs.items():
            m = result.motion
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
                mirrored = f", {halves(m, case.prediction)}" if m.mirrored or (settled and m.p == 2) else ""
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
    cycles = [result.motion.kind == "cycle" for result in case.runs.values()]
    ok = not any(cycles) and not case.prediction.by_paper
    parts = [f"{NAME[plant]}: {_lower(result.motion.words)}" for plant, result in case.runs.items()]
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
    values = np.linalg.eigvals(first.actual.A - first.actual.B @ case.controller.design.k @ T_hat).astype(complex)
    worst = values[np.argmax(values.real)]
    why = f"The rightmost eigenvalue of A − Bk is {number(worst.real, 3)} ± {number(abs(worst.imag), 3)}j"
    reservation = ""
    if worst.real > 0 and case.prediction.observer_feedback_stable:
        reservation = "with the observer in the loop the continuous controller is stable"
    return _answer(worst.real > 0, why, reservation)


def require_damping(check: Callable[[CaseRuns], Answer]) -> Callable[[CaseRuns], Answer]:
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


CALIBRATED = (
    "the paper does not print the three-link parameters; this plant was calibrated to the published pair of "
    "intervals and is not the author’s model"
)


@dataclass(frozen=True)
class Statement:
    """One numbered statement of the paper on one figure.

    Attributes:
        figure: the paper's name of the figure, as in the run file's ``case.paper.figure``.
        number: the paper's number in the list for that figure.
        text: what it says, in our words.
        check: answers it from the runs of a case.
        result: whether it states a result; the others name the system, or what a panel shows, and are not counted.
    """

    figure: str
    number: int
    text: str
    check: Callable[[CaseRuns], Answer]
    result: bool = True


@dataclass(frozen=True)
class AnsweredStatement:
    """A statement with the case to which it was applied, and the answer."""

    statement: Statement
    case: CaseRuns
    answer: Answer


def answer(cases: Sequence[CaseRuns]) -> list[AnsweredStatement]:
    """Every statement applied to every case that names its figure."""
    return [
        AnsweredStatement(statement, case, statement.check(case))
        for case in cases
        for statement in STATEMENTS
        if statement.figure == case.first.run.case.paper.figure
    ]


def verdicts_on_results(cases: Sequence[CaseRuns]) -> list[Verdict]:
    """A verdict on each result that the paper states and these cases test.

    Each counts once: if several cases have the same figure, with the case that agrees best.
    """
    order: tuple[Verdict, ...] = ("reproduced", "reproduced with a reservation", "not reproduced")
    found: dict[tuple[str, int], Verdict] = {}
    for item in answer(cases):
        if item.statement.result:
            key, verdict = (item.statement.figure, item.statement.number), item.answer.verdict
            found[key] = min(found.get(key, verdict), verdict, key=order.index)
    return list(found.values())


def in_paper_order(cases: Sequence[CaseRuns]) -> list[CaseRuns]:
    """Cases in the order of the paper's figures; those of no figure last, otherwise as given."""
    order = list(dict.fromkeys(statement.figure for statement in STATEMENTS))

    def place(case: CaseRuns) -> int:
        figure = case.first.run.case.paper.figure
        return order.index(figure) if figure in order else len(order)

    return sorted(cases, key=place)


def find_untested(cases: Sequence[CaseRuns]) -> list[Statement]:
    """Statements on figures that none of the cases names."""
    figures = {case.first.run.case.paper.figure for case in cases}
    return [statement for statement in STATEMENTS if statement.figure not in figures]


PERIOD = "The output becomes periodic with period Δ_crit."

MIRRORED = "The output becomes periodic with period 2Δ_crit, its two halves mirrored."

CONVERGES = "The open-loop interval Δ_ol converges to Δ_crit."

STATEMENTS: tuple[Statement, ...] = (
    Statement("simple-gain=0o8", 1, "The simple system with gain b = 0.8.", gain_is(0.8), False),
    Statement("simple-gain=0o8", 2, "Δ_crit is 1.8 s, with the eigenvalue at +1.", critical_interval(1.8, 1, 1)),
    Statement("simple-gain=0o8", 3, PERIOD, periodic(1)),
    Statement("simple-gain=0o8", 4, CONVERGES, interval_converges()),
    Statement("simple-gain=1o2", 1, "The simple system with gain b = 1.2.", gain_is(1.2), False),
    Statement("simple-gain=1o2", 2, "Δ_crit is 1.53 s, with the eigenvalue at −1.", critical_interval(1.53, 2, -1)),
    Statement("simple-gain=1o2", 3, MIRRORED, periodic(-1)),
    Statement("simple-gain=1o2", 4, CONVERGES, interval_converges()),
    Statement("simple-gain=1o7", 1, "The simple system with gain b = 1.7.", gain_is(1.7), False),
    Statement(
        "simple-gain=1o7",
        2,
        "Δ_crit is 1.1 s, with the eigenvalue at −1 and a further eigenvalue there.",
        further_eigenvalue(1.1, 1),
    ),
    Statement("simple-gain=1o7", 3, "The solution does not converge to a limit cycle.", no_limit_cycle),
    Statement("three=0o9", 1, "The three-link system with gain b = 0.9.", gain_is(0.9, CALIBRATED), False),
    Statement(
        "three=0o9", 2, "Δ_crit is 0.76 s, with the eigenvalue at +1.", critical_interval(0.76, 2, 1, CALIBRATED)
    ),
    Statement("three=0o9", 3, PERIOD, periodic(1)),
    Statement("three=0o9", 4, CONVERGES, interval_converges()),
    Statement(
        "three=0o9", 5, "Panel (d) shows three angular velocities against three angles.", three_phase_planes, False
    ),
    Statement("three=1o1", 1, "The three-link system with gain b = 1.1.", gain_is(1.1, CALIBRATED), False),
    Statement(
        "three=1o1", 2, "Δ_crit is 0.74 s, with the eigenvalue at −1.", critical_interval(0.74, 2, -1, CALIBRATED)
    ),
    Statement("three=1o1", 3, MIRRORED, periodic(-1)),
    Statement("three=1o1", 4, CONVERGES, interval_converges()),
    Statement(
        "simple-neglected", 1, "The simple system with dynamics that the design neglects.", neglected_dynamics, False
    ),
    Statement(
        "simple-neglected",
        2,
        "Δ_crit is 3.6 s, with the eigenvalue at +1.",
        require_damping(critical_interval(3.6, 1, 1)),
    ),
    Statement("simple-neglected", 3, PERIOD, periodic(1)),
    Statement(
        "simple-neglected",
        4,
        "The underlying continuous-time design is unstable.",
        require_damping(continuous_unstable),
    ),
)
