"""The paper's statements, answered, and what differs from the paper."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from icmj.report.answers import (
    Answer,
    Verdict,
    continuous_unstable,
    critical_interval,
    damped,
    further_eigenvalue,
    gain_is,
    interval_converges,
    neglected_dynamics,
    no_limit_cycle,
    periodic,
    three_phase_planes,
)
from icmj.report.pairing import CaseRuns
from icmj.report.sections.section import Section
from icmj.report.sections.wording import verdicts

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
class Answered:
    """A statement with the case to which it was applied, and the answer."""

    statement: Statement
    case: CaseRuns
    answer: Answer


def answered(cases: Sequence[CaseRuns]) -> list[Answered]:
    """Every statement applied to every case that names its figure."""
    return [
        Answered(statement, case, statement.check(case))
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
    for item in answered(cases):
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


def untested(cases: Sequence[CaseRuns]) -> list[Statement]:
    """Statements on figures that none of the cases names."""
    figures = {case.first.run.case.paper.figure for case in cases}
    return [statement for statement in STATEMENTS if statement.figure not in figures]


@dataclass(frozen=True)
class Difference:
    """Where this project departs from the paper, and why."""

    title: str
    text: str


def differences(cases: Sequence[CaseRuns]) -> list[Difference]:
    """The departures that concern these cases."""
    figures = {case.first.run.case.paper.figure for case in cases} - {""}
    found = []
    if "simple-neglected" in figures:
        found.append(
            Difference(
                "A probable misprint",
                "For the neglected dynamics the paper prints a damping ratio ζ = 0.5 (and omits a factor s next to "
                "it). With this value the recovered design has Δ_crit = 2.169 s and a stable A − Bk; the paper has "
                "3.6 s and an unstable A − Bk. With ζ = 0.1 both statements of the paper hold. Since the paper does "
                "not print its design, 0.5 is only probably a misprint. ζ = 0.1 is taken as the case of the paper, "
                "and ζ = 0.5 is shown in addition, “as printed”.",
            )
        )
    if any(figure.startswith("three=") for figure in figures):
        found.append(
            Difference(
                "The three-link plant is a calibration",
                "The paper takes its standing model from earlier work and prints none of its parameters. Here the "
                "segments are those of Winter (2009) for a person of 80 kg and 1.80 m; passive stiffness and damping "
                "of the joints were chosen to obtain both published intervals. It is not the author’s model.",
            )
        )
    if figures:
        found.append(
            Difference(
                "The design was recovered",
                "The paper prints no weights. One set of LQ weights was found by a search such that the intervals of "
                "its two second-order systems agree with the printed ones; it is used for all of them. These intervals "
                "therefore test the design less than the periods, the mirrored halves and the convergence do. The "
                "weights of the three-link system are part of its calibration.",
            )
        )
        found.append(
            Difference(
                "Choices of this study",
                "The paper does not print Q_t, q_t, Δ_min, initial states and durations either. Δ_crit does not depend "
                "on them; they determine the amplitude, and which attractor a run reaches.",
            )
        )
    return found


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
        "simple-neglected", 2, "Δ_crit is 3.6 s, with the eigenvalue at +1.", damped(critical_interval(3.6, 1, 1))
    ),
    Statement("simple-neglected", 3, PERIOD, periodic(1)),
    Statement("simple-neglected", 4, "The underlying continuous-time design is unstable.", damped(continuous_unstable)),
)


def statements(cases: Sequence[CaseRuns]) -> Section:
    """Every statement of the paper's section "Features to note", answered."""
    groups: dict[str, dict[str, Any]] = {}
    for item in answered(cases):
        paper = item.case.first.run.case.paper
        group = groups.setdefault(
            item.case.name,
            {"title": item.case.first.run.case.title, "note": paper.note, "figure": paper.figure, "items": []},
        )
        group["items"].append(item)
    extra = [{"title": case.first.run.case.title, "note": _note(case)} for case in cases if case.name not in groups]
    return Section(
        "statements",
        "The paper’s statements",
        "statements.html.j2",
        {
            "groups": list(groups.values()),
            "extra": extra,
            "untested": untested(cases),
            "total": len(STATEMENTS),
            "differences": differences(cases),
        },
    )


def _note(case: CaseRuns) -> str:
    """The run file's note on a case that the paper does not have, and what its runs say beyond the prediction."""
    return " ".join([case.first.run.case.paper.note or "Not in the paper.", *verdicts(case)])
