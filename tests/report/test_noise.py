"""A case under noise in comparison, archive, summary and page."""

from dataclasses import replace
from functools import cache

import pytest
from log_cases import assert_same
from matplotlib.figure import Figure
from report_cases import PAPER_PANELS, compose, context_of, result

from icmj import Result, build_report, measure, parse_run, statistics
from icmj.case.comparison import compare, to_json
from icmj.errors import LogError
from icmj.linear.run import simulate
from icmj.log.archive import pack, unpack
from icmj.log.summary import summarise as properties
from icmj.log.summary import write_markdown
from icmj.plant.linear_plant import transformation
from icmj.report.abstract import abstract
from icmj.report.axes.noise import draw_histogram
from icmj.report.case_runs import pair, shown_interval
from icmj.report.sections.noise_statistics import estimate

NOISE = """
[[simulation.disturbance]]
kind = "noise"
input = "torque"
size = 0.02
corner = 0.5
seed = 1
"""


@cache
def noisy() -> Result:
    """The pendulum of b = 0.8 under noise, in a case of its own."""
    quiet = result("b0.8")
    run = parse_run(quiet.run.text.replace('name = "b0.8"', 'name = "noisy"') + NOISE)
    simulation = simulate(quiet.actual, quiet.controller, run.simulation.settings())
    motion = measure(simulation, T_hat=transformation(quiet.assumed, quiet.actual))
    return replace(quiet, run=run, simulation=simulation, measurement=motion, statistics=statistics(simulation))


def test_it_comes_back_from_the_archive_bit_for_bit_and_damaged_statistics_are_refused() -> None:
    assert_same(noisy(), unpack(*pack(noisy())))
    told = noisy().statistics
    assert told is not None
    for damaged, words in (
        (replace(told, rms=()), r"statistics\.rms has 0 numbers for 1 outputs"),
        (replace(told, edges=told.edges[1:]), r"statistics\.edges has shape"),
        (replace(told, spectrum=replace(told.spectrum, low=told.spectrum.low[1:])), r"statistics\.spectrum\.low"),
    ):
        with pytest.raises(LogError, match=words):
            unpack(*pack(replace(noisy(), statistics=damaged)))


def test_measures_of_a_person_stand_beside_those_of_young_people() -> None:
    """In millimetres; a body of another size has none."""
    swayed = replace(noisy(), sway={"cop.x.rms": 4.12e-3, "cop.x.speed": 7.04e-3, "cop.x.frequency.mean": 0.272})
    assert unpack(*pack(swayed)).sway == swayed.sway
    section = compose("noise_statistics", pair([swayed]))
    assert section is not None
    sway = section.context["items"][0]["sway"]
    assert sway["heads"] == ["linear plant", "young people"]
    assert sway["rows"][0] == ("RMS (mm)", "4.12", "4.74 ± 1.6")
    assert sway["rows"][1] == ("mean speed (mm/s)", "7.04", "7.99 ± 4.6")
    assert ("mean frequency (Hz)", "0.272", "0.252 ± 0.13") in sway["rows"]
    section = compose("noise_statistics", pair([noisy()]))
    assert section is not None
    assert section.context["items"][0]["sway"] is None


def test_where_noise_acts_and_no_cycle_is_predicted_no_prediction_is_drawn() -> None:
    """The panels of quiet standing named Δ_crit, ±γ and a repelling orbit as predictions, beside noise."""
    free = replace(noisy(), prediction=replace(noisy().prediction, cycle=False, verdict="repelling"))
    for found, drawn in ((noisy(), True), (free, False)):
        case = pair([found])[0]
        assert (shown_interval(case) is not None) == drawn
        captions = {panel.letter: panel.caption(case) for panel in PAPER_PANELS}
        assert ("Δ_crit" in captions["e"]) == drawn
        assert ("γ" in captions["f"]) == drawn
        axes = Figure().add_subplot()
        draw_histogram(axes, case)
        assert any("crit" in str(line.get_label()) for line in axes.lines) == drawn


def test_it_is_compared_in_distribution() -> None:
    compared = compare(noisy())
    assert (compared.measured.kind, compared.measured.converged) == ("noisy", False)
    assert "the predicted cycle without noise has 1.807 s" in compared.words
    assert to_json(compared)["measured"]["kind"] == "noisy"


def test_the_summary_has_every_number_with_its_confidence() -> None:
    found, told = properties(noisy(), compare(noisy()))["statistics"], noisy().statistics
    assert told is not None
    assert told.interval is not None
    assert (found["interval"], found["interval_error"]) == (told.interval.value, told.interval.error)
    assert found["rms_angle"] == told.rms[0].value
    quiet = result("b0.8")
    assert properties(quiet, compare(quiet))["statistics"] == {}


def test_a_noisy_case_is_not_counted_among_the_cycles() -> None:
    both = pair([result("b0.8"), noisy()])
    assert "Of the 1 case without noise below, linear theory predicts a limit cycle for 1." in abstract(both)
    quiet, row = context_of("summary_table", both)["rows"]
    assert (quiet["runs"]["linear"]["mark"], row["runs"]["linear"]["mark"]) == ("✓", "–")
    assert row["runs"]["linear"]["error"] == ""
    assert [error["title"] for error in context_of("summary_table", both)["errors"]] == [quiet["title"]]


def test_without_noise_there_is_no_section() -> None:
    assert compose("noise_statistics", pair([result("b0.8")])) is None
    assert estimate(None) == "–"


@pytest.mark.slow
def test_the_page_shows_histogram_and_spectra(tmp_path) -> None:
    build_report([result("b0.8"), noisy()], tmp_path / "r.html")
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "Under noise" in page
    assert page.count("histogram of intervals") == 1
    assert {"noisy_intervals.svg", "noisy_spectra.pdf"} <= {path.name for path in (tmp_path / "r_figures").iterdir()}


def test_the_viewer_gives_no_error_of_a_mean_interval_as_the_report_gives_none() -> None:
    found = noisy()
    compared = compare(found)
    assert compared.relative_error.interval is not None
    line = next(
        line for line in write_markdown(found, compared).splitlines() if line.startswith("| open-loop interval")
    )
    assert line.split("|")[-2].strip() == "–"
