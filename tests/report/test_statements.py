"""The paper's statements: which hold is known beforehand (notes, section 4), and wrong runs must not pass."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from report_cases import CASES, actual_plant, everything, result

from icmj.report.case_runs import pair
from icmj.report.sections.paper_statements import differences
from icmj.report.statements import STATEMENTS, answer, find_untested, in_paper_order, verdicts_on_results

# the numbered items of the paper's section "Features to note", figure by figure
ITEMS = {"simple-gain=0o8": 4, "simple-gain=1o2": 4, "simple-gain=1o7": 3}
ITEMS |= {"three=0o9": 5, "three=1o1": 4, "simple-neglected": 4}
YES, RESERVED, NO = "reproduced", "reproduced with a reservation", "not reproduced"


def verdicts(*results):
    return [item.answer.verdict for item in answer(pair(results))]


def test_every_item_of_the_paper_is_there_once():
    assert Counter(statement.figure for statement in STATEMENTS) == ITEMS
    for figure, count in ITEMS.items():
        assert [s.number for s in STATEMENTS if s.figure == figure] == list(range(1, count + 1))


@pytest.mark.parametrize(("name", "expected"), [
    ("b0.8", [YES, YES, YES, YES]),
    ("b1.2", [YES, YES, YES, YES]),
    ("b1.7", [YES, RESERVED, NO]),  # the paper: no limit cycle; both plants settle on another one
    ("three-link", [RESERVED, RESERVED, YES, YES, YES]),
    ("neglected", [RESERVED, RESERVED, YES, RESERVED]),  # with another damping ratio than the printed one
    ("printed", [YES, NO, YES, NO]),  # other Δ_crit, stable A − Bk
])  # fmt: skip
def test_the_verdict_on_each_statement(name, expected):
    assert verdicts(result(name), result(name, "mujoco")) == expected


def test_each_result_of_the_paper_counts_once_and_what_names_the_system_not_at_all():
    """Of the 24 statements, six name the system and one what a panel shows; two cases have the figure of the last."""
    assert sum(statement.result for statement in STATEMENTS) == sum(ITEMS.values()) - 6 - 1
    assert not any(statement.result for statement in STATEMENTS if statement.number == 1)
    both = pair([result("printed"), result("neglected")])
    assert len(answer(both)) == 8
    assert verdicts_on_results(both) == [RESERVED, YES, RESERVED]
    assert verdicts_on_results(pair([result("printed")])) == [NO, YES, NO]


def test_a_reservation_names_the_damping_ratio_and_the_unstable_design_its_eigenvalue():
    for i in (0, 1, 3):
        assert "ζ = 0.1; the paper prints ζ = 0.5" in answer(pair([result("neglected")]))[i].answer.why
    assert "0.497 ± 9.92j" in answer(pair([result("neglected")]))[3].answer.why


def test_the_misprint_is_answered_with_its_numbers():
    second, fourth = (answer(pair([result("printed")]))[i].answer.why for i in (1, 3))
    assert "2.169 s" in second
    assert "3.6 s" in second
    assert fourth.startswith("The rightmost eigenvalue of A − Bk is −")


def test_another_gain_and_a_cycle_where_the_paper_has_none_are_not_reproduced():
    wrong = replace(result("b0.8"), actual=actual_plant("b1.2"))
    assert verdicts(wrong)[0] == NO
    good, other = result("b1.7"), result("b1.2")
    assert verdicts(replace(good, prediction=other.prediction, measurement=other.measurement))[2] == NO


def test_a_run_that_does_not_settle_fails_period_and_convergence():
    good = result("b0.8")
    lost = replace(good.measurement, kind="irregular", p=None, period=None, intervals=np.zeros(0), interval=1.1)
    bad = replace(result("b0.8", "mujoco"), measurement=lost)
    assert verdicts(good, bad) == [YES, YES, NO, NO]


def test_what_no_case_names_is_listed_as_untested():
    cases = pair([result("b0.8"), result("exact")])
    assert {statement.figure for statement in find_untested(cases)} == set(ITEMS) - {"simple-gain=0o8"}
    assert {item.case.name for item in answer(cases)} == {"b0.8"}


def test_answers_are_sentences():
    items = answer(pair(everything()))
    assert {item.case.name for item in items} == set(CASES) - {"exact"}
    for item in items:
        assert item.answer.why.endswith(".")
        assert ".." not in item.answer.why
        assert ".;" not in item.answer.why
        assert item.answer.why[0].isupper() or item.answer.why[0].isdigit()


def test_differences_concern_the_cases_shown():
    def titles(*names):
        return [difference.title for difference in differences(pair([result(name) for name in names]))]

    assert titles("exact") == []
    assert titles("b0.8") == ["The design was recovered", "Choices of this study"]
    assert titles("printed")[0] == "A probable misprint"
    assert titles("three-link")[0] == "The three-link plant is a calibration"
    assert len(titles("neglected", "three-link")) == 4


def test_the_text_on_the_misprint_has_the_numbers_of_the_runs():
    text = differences(pair([result("printed")]))[0].text
    for name in ("printed", "neglected"):
        computed = f"{result(name).prediction.delta_crit:.4g}"
        assert computed in text or computed == "3.593"
    assert not result("neglected").prediction.state_feedback_stable
    assert result("printed").prediction.state_feedback_stable


def test_cases_follow_the_papers_figures():
    cases = pair([result(name) for name in ("exact", "printed", "neglected", "three-link", "b1.7", "b0.8")])
    order = ["b0.8", "b1.7", "three-link", "printed", "neglected", "exact"]
    assert [case.name for case in in_paper_order(cases)] == order
