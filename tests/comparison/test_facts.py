"""Each fact is said once, and nowhere forgotten; files keep the names that they had."""

import importlib
import re
from dataclasses import fields
from pathlib import Path

import pytest
from report_cases import result

from icmj.base.numbers import Fact
from icmj.case.comparison import RUN, Measured, Predicted, RelativeError, compare, to_json
from icmj.log.summary import summarise as properties
from icmj.log.summary import write_markdown
from icmj.study.chunk import CYCLE, WITHOUT_PREDICTION, columns
from icmj.theory.prediction import PREDICTION

TABLES = {"PREDICTION": PREDICTION, "RUN": RUN, "CYCLE": CYCLE, "WITHOUT_PREDICTION": WITHOUT_PREDICTION}
ALL = [(table, fact) for table, facts in TABLES.items() for fact in facts]
NAMED = [f"{table} {fact.name}" for table, fact in ALL]


@pytest.mark.parametrize(("table", "fact"), ALL, ids=NAMED)
def test_a_fact_has_label_unit_and_meaning(table: str, fact: Fact) -> None:
    assert fact.label
    assert len(fact.meaning) >= 5
    assert fact.unit in {"", "s", "1/s"}, "a unit that a table does not know: name it here"


def test_a_page_tabulates_every_fact_under_the_names_of_its_files(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("sphinx")
    monkeypatch.syspath_prepend(root / "docs" / "_ext")
    tables = importlib.import_module("facts")
    assert [facts for facts, *_ in tables.TABLES.values()] == list(TABLES.values())
    page = (root / "docs" / "facts.md").read_text(encoding="utf-8")
    assert re.findall(r"^```\{facts\} (\S+)$", page, flags=re.M) == list(tables.TABLES)
    lines = tables.tabulate_facts("run")
    assert "| events in a period |  |  | `PLANT_p` | `measured.events_per_period` |" in lines
    whole = "largest magnitude of each output over a period, or of late in the run | of the output"
    names = "`measured.amplitude` | `PLANT_peak_OUTPUT` | `measured.amplitude_OUTPUT`"
    assert f"| {whole} | {names} |" in lines


def test_no_fact_is_nowhere_and_no_name_is_taken_twice() -> None:
    for facts in TABLES.values():
        assert all(fact.key("record") or fact.key("column") or fact.key("logged") for fact in facts)
        for place in ("record", "column", "logged"):
            keys = [fact.key(place) for fact in facts if fact.key(place)]
            assert len(keys) == len(set(keys))


def test_the_comparison_has_the_facts_that_summaries_have() -> None:
    for kind, facts in ((Predicted, PREDICTION), (Measured, RUN)):
        assert {field.name for field in fields(kind)} == {fact.key("record") for fact in facts} - {""}
    assert {field.name for field in fields(RelativeError)} == {fact.name for fact in RUN if fact.against}
    predicted = {fact.name for fact in PREDICTION}
    assert all(fact.against in predicted for fact in RUN if fact.against)


def test_files_keep_the_names_that_they_had() -> None:
    found = compare(result("b0.8"))
    record = to_json(found)
    assert set(record["predicted"]) == {
        "delta_crit",
        "eigenvalue",
        "cycle",
        "period",
        "gamma",
        "amplitude",
        "verdict",
        "by_paper",
    }
    assert set(record["measured"]) == {"interval", "period", "amplitude", "gamma", "converged", "kind"}
    assert set(record["relative_error"]) == {"interval", "period", "amplitude", "gamma"}
    logged = properties(result("b0.8"), found)
    assert set(logged["predicted"]) == {
        "cycle", "delta_crit", "eigenvalue_re", "eigenvalue_im", "period", "gamma", "verdict",
        "state_feedback_stable", "observer_feedback_stable", "amplitude_angle",
    }  # fmt: skip
    assert set(logged["measured"]) == {
        "kind", "events_per_period", "mirrored", "interval", "period", "gamma", "residual", "words", "amplitude_angle",
    }  # fmt: skip
    table = columns([("b", "number")], ["y"], motion=["mujoco"], cycle=["linear"], noisy=True, attractors=False)
    assert list(table) == [
        "point", "b", "status", "words", "predicted_delta_crit", "predicted_eigenvalue", "predicted_cycle",
        "predicted_period", "predicted_verdict", "predicted_multiplier", "predicted_gamma",
        "predicted_state_feedback_stable", "predicted_observer_feedback_stable", "predicted_peak_y",
        "predicted_orbit_delta", "predicted_orbit_eigenvalue", "predicted_orbit_verdict", "predicted_orbit_multiplier",
        "predicted_unresolved",
        "mujoco_outcome", "mujoco_end", "mujoco_kind", "mujoco_on_predicted", "mujoco_interval", "mujoco_error",
        "mujoco_p", "mujoco_mirrored", "mujoco_period", "mujoco_residual", "mujoco_events", "mujoco_step_error",
        "mujoco_interval_error", "mujoco_interval_deviation", "mujoco_binding", "mujoco_peak_y", "mujoco_rms_y",
        "linear_cycle_found", "linear_cycle_words", "linear_cycle_interval", "linear_cycle_error",
        "linear_cycle_period", "linear_cycle_p", "linear_cycle_mirrored", "linear_cycle_attracting",
        "linear_cycle_multiplier", "linear_cycle_peak_y",
    ]  # fmt: skip
    types = {name: str(kind) for name, (kind, _) in table.items()}
    assert [types[f"mujoco_{name}"] for name in ("p", "events", "mirrored", "kind", "period")] == [
        "int32", "int64", "bool", "string", "double",
    ]  # fmt: skip
    other = columns([], ["y"], motion=["linear"], cycle=[], noisy=False, attractors=False, predicted=False)
    assert list(other)[3:] == [
        "root_real", "root_imag", "linear_outcome", "linear_end", "linear_switches", "linear_growth", "linear_factor",
        "linear_period", "linear_peak_y", "linear_rms_y",
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["three-link", "exact"])
def test_the_summary_of_a_log_has_a_line_for_all_that_is_compared(name: str) -> None:
    of = result(name)
    page = write_markdown(of, compare(of))
    for fact in RUN:
        if fact.against and fact.kind != "outputs":
            assert f"| {fact.label}" in page
    for output in of.actual.outputs:
        assert f"| peak of {output}" in page
    assert "| nan" not in page
