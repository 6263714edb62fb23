"""Runs find their case."""

import pytest
from report_cases import result

from icmj.errors import ReportError
from icmj.report.case_runs import pair


def test_runs_of_a_case_come_together_linear_first():
    cases = pair([result("b1.2", "mujoco"), result("b0.8"), result("b1.2")])
    assert [case.name for case in cases] == ["b1.2", "b0.8"]
    assert list(cases[0].runs) == ["linear", "mujoco"]
    assert cases[0].first is cases[0].linear
    assert cases[0].last is cases[0].runs["mujoco"]
    assert list(cases[1].runs) == ["linear"]
    assert cases[1].last is cases[1].linear
    assert set(cases[0].comparisons) == {"linear", "mujoco"}


def test_no_results_and_the_same_run_twice_are_errors():
    with pytest.raises(ReportError, match="at least one log"):
        pair([])
    with pytest.raises(ReportError, match=r"'b0\.8' on the linear plant"):
        pair([result("b0.8"), result("b0.8")])
