"""Tables on narrow terminals and in pipes: every digit is there, whatever gives way."""

import io
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

from benchmarks.__main__ import show_compared, show_measured
from benchmarks.row import Row
from icmj.cli.comparisons import show_comparisons
from icmj.cli.table import Column, show_table
from icmj.cli.terminal import Terminal
from icmj.work.shipped import RUNS


def shown(show, *content, width=None):
    """What ``show`` prints on a terminal of this width, or into a pipe."""
    file = io.StringIO()
    narrow = {} if width is None else {"width": width, "height": 50, "force_terminal": True, "color_system": None}
    show(*content, Terminal(file=file, **narrow))
    return file.getvalue()


def comparison(case, plant, converged=True, kind="cycle"):
    return SimpleNamespace(
        case=case,
        plant=plant,
        predicted=SimpleNamespace(delta_crit=1.8065407961, cycle=kind != "noisy"),
        measured=SimpleNamespace(interval=1.8066180001, kind=kind, converged=converged),
        relative_error=SimpleNamespace(interval=-1.8e-13, largest_amplitude=4.25e-5),
        notices=(),
        words="",
        changes="",
    )


CASES = [path.stem for path in RUNS.folder.glob("*.toml")]
COMPARISONS = [comparison(case, plant) for case in CASES for plant in ("linear", "mujoco")]


@pytest.mark.parametrize("width", [60, 80, 200, None])
def test_no_digit_of_the_study_s_table_is_cut(width):
    text = shown(show_comparisons, COMPARISONS, width=width)
    assert "…" not in text
    assert len(CASES) >= 11
    for number in ("1.80654", "1.80662", "-1.8e-13"):
        assert text.count(number) == len(COMPARISONS), number
    for case in CASES:
        assert len(re.findall(rf"{re.escape(case)}(?![\w.-])", text)) == 2
    assert width is None or max(map(len, text.splitlines())) <= width
    if width != 60:
        assert text.count("+4.3e-05") == len(COMPARISONS) or "A wider terminal also shows: peak error" in text


def test_every_number_is_there_in_a_pipe_whatever_columns_says(monkeypatch):
    """Piped, the table was cut to 80 columns: "+1.8e-…", "cyc…"."""
    for columns in ("20", "60", "80"):
        monkeypatch.setenv("COLUMNS", columns)
        text = shown(show_comparisons, COMPARISONS)
        assert text.count("+4.3e-05") == len(COMPARISONS)
        assert text.count("yes") == len(COMPARISONS)


def test_where_no_cycle_is_predicted_the_interval_stands_in_brackets():
    """It looked as if 1.544 s had been predicted for quiet standing under noise."""
    text = shown(show_comparisons, [comparison("a", "linear", False, "noisy"), comparison("b", "linear")])
    assert text.count("(1.80654)") == 1
    assert "in brackets: no cycle is predicted" in " ".join(text.split())
    assert "brackets" not in shown(show_comparisons, [comparison("b", "linear")])


def test_what_homoclinic_means_stands_beneath_a_table_that_has_the_word():
    text = " ".join(shown(show_comparisons, [comparison("a", "linear", False, "homoclinic")]).split())
    assert "homoclinic: the last open-loop intervals grow, each longer than the one before" in text
    assert "homoclinic" not in shown(show_comparisons, [comparison("b", "linear")])


@pytest.mark.parametrize("width", [60, 80, None])
def test_kinds_of_motion_are_whole(width):
    text = shown(show_comparisons, [comparison("a", "linear", False, "quasi-periodic")], width=width)
    assert "quasi-periodic" in text
    assert " no" in text or "also shows" in text


@pytest.mark.parametrize("width", [60, 80, None])
def test_no_digit_of_the_benchmarks_table_is_cut(width):
    rows = [
        Row("linear plant", "compiled, with a row every 10 ms", 13245.678, "× time", "79 events in 60 s", 1e4, False),
        Row("linear plant", "Drake RK3 at 1e-08 s", 749.3123, "ms", "tolerance 1e-09; interval 1.2e-09 s"),
        Row("startup", "icmj analyse, second time", 0.5123, "s", "", 1.0),
    ]
    text = shown(show_measured, rows, width=width)
    for words in ("1.325e+04 × time", "≥ 10000 ✓", "749.3 ms", "0.5123 s", "≤ 1 ✓", "compiled, with a row every 10 ms"):
        assert words in text, words
    saved = {(row.group, row.name): row for row in rows}
    both = shown(show_compared, saved, saved, width=width)
    assert both.count("1.000") == 3
    assert both.count("749.3 ms") == 2


def test_the_least_important_column_gives_way_first_and_a_list_is_the_last_resort():
    columns = Column("name"), Column("value", "right"), Column("detail", rank=1), Column("aside", rank=2)
    rows = [("first", "1.23456789", "a detail", "an aside")]

    def show(out):
        show_table(columns, rows, out, title="Things")

    text = shown(show, width=60)
    assert "an aside" in text
    assert "a detail" in text
    text = shown(show, width=28)
    assert "an aside" not in text
    assert "a detail" in text
    text = " ".join(shown(show, width=20).split())
    assert "1.23456789" in text
    assert "A wider terminal also shows: detail, aside." in text
    text = shown(show, width=15)
    assert [line.strip() for line in text.splitlines()] == [
        "Things", "", "first", "value   1.23456789", "detail  a detail", "aside   an aside",
    ]  # fmt: skip


def test_json_of_a_run_is_the_record_of_the_summary(tmp_path, shell):
    command = ["run", "simple-0.8", "--plant", "linear", "--set", "simulation.duration=12", "--out", str(tmp_path)]
    found = shell.answers([*command, "--json"])
    (run,) = found["runs"]
    (log,) = found["logs"]
    assert run["predicted"]["delta_crit"] == pytest.approx(1.8065408)
    assert run["measured"]["kind"]
    assert found["outcome"] == {"kind": "completed", "t": 12.0}
    again = shell.answers(["report", log, "--out", str(tmp_path / "page.html"), "--json"])
    assert again["runs"] == [run]
    assert Path(again["report"]).is_file()
