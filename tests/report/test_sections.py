"""What the sections say, against what is known of the cases."""

import html
import itertools
import re
from dataclasses import replace

import numpy as np
import pytest
from report_cases import CASES, PAPER_PANELS, PENDULUM, compose, context_of, design_of, everything, result, run_text

import icmj
from icmj import LinearPlant, Settings, SwitchingPD, parse_run
from icmj.case.result import Attractor, Result
from icmj.controller.rules.quadratic import EventTrigger
from icmj.controller.trigger import EventRule, Faces
from icmj.report import style
from icmj.report.abstract import abstract
from icmj.report.case_runs import pair
from icmj.report.experiment import Row, experiment_page
from icmj.report.headline import headline
from icmj.report.overview import overview_figure
from icmj.report.page import render_page
from icmj.report.sections import SECTIONS
from icmj.report.sections.rival_controllers import rivals
from icmj.study.kinds.double_step import DoubleStepTable
from icmj.study.kinds.quiet_standing import QuietStandingTable


def rows():
    return {row["anchor"]: row for row in context_of("summary_table", pair(everything()))["rows"]}


def test_summary_has_all_four_columns_side_by_side():
    row = rows()["b0.8"]
    assert row["paper"] == {"delta": "1.8", "eigenvalue": "+1", "cycle": "yes"}
    assert (row["predicted"]["delta"], row["predicted"]["eigenvalue"]) == ("1.8065", "+1")
    assert row["runs"]["linear"]["interval"] == "1.8065"
    assert row["runs"]["mujoco"]["interval"] == "1.8069"  # passed off with 2e-4 more
    assert row["runs"]["mujoco"]["error"] == "+2.0\N{NO-BREAK SPACE}×\N{NO-BREAK SPACE}10⁻⁴"
    assert row["runs"]["mujoco"]["mark"] == "✓"


def test_notices_on_a_run_stand_below_its_case():
    linear, engine = result("b0.8"), result("b0.8", "mujoco")
    both = "kink: <b>the limits</b> of the actuator"
    runs = [replace(linear, notices=(both,)), replace(engine, notices=(both, "large step: 0.1 s is long"))]
    verdicts = context_of("summary_table", pair(runs))["rows"][0]["verdicts"]
    assert verdicts[-2:] == ["Kink. <b>the limits</b> of the actuator.", "Large step (MuJoCo). 0.1 s is long."]
    assert not any("Kink" in words for row in rows().values() for words in row["verdicts"])


@pytest.mark.parametrize(("name", "agrees"), [
    *((name, True) for name in ("b0.8", "b1.2", "b1.7", "three-link", "neglected")), ("printed", False), ("exact", None)
])  # fmt: skip
def test_agreement_with_the_printed_value(name, agrees):
    assert SECTIONS["summary_table"].agrees_with_paper(pair([result(name)])[0]) is agrees
    departs = any("Differs from the paper" in words for words in rows()[name]["verdicts"])
    assert departs is (agrees is False)


def test_no_cycle_as_predicted_looks_like_agreement_and_a_circle_says_another():
    """It was a red cross: "no cycle, as predicted" looked like a failure."""
    for name, mark, word in (("b1.7", "○", "another cycle"), ("exact", "✓", "none, agrees")):
        row = rows()[name]
        for plant in ("linear", "mujoco"):
            assert (row["runs"][plant]["mark"], row["runs"][plant]["word"]) == (mark, word)
        assert row["predicted"]["cycle"] == "none"
        assert row["verdicts"]
    assert rows()["exact"]["runs"]["linear"]["interval"] == "grows"
    assert rows()["exact"]["paper"]["delta"] == "–"


def test_of_a_family_that_is_not_reached_nothing_says_that_its_cycle_attracts():
    """The mark said so, and the caption said "its orbit family"."""
    found = result("b0.8")
    lost = replace(found.measurement, kind="irregular", p=None, period=None)
    cases = pair([replace(found, prediction=replace(found.prediction, verdict="family"), measurement=lost)])
    (row,) = context_of("summary_table", cases)["rows"]
    (shown,) = context_of("case_panels", cases)["cases"]
    assert "attracts" not in f"{row['runs']} {row['verdicts']}"
    assert row["runs"]["linear"]["word"] == "not reached"
    assert shown["caption"].endswith("is predicted, one of a family.")


def foot(page):
    return re.sub(r"<[^>]+>", "", page.partition("<footer>")[2].partition("</footer>")[0])


DOUBLE_STEP = DoubleStepTable(output="angle", size=0.02, isi=[0.1, 0.2, 0.3])
STANDING = QuietStandingTable()


def plain(page):
    """The words of a page, with single blanks."""
    body = re.sub(r"<(style|script|nav).*?</\1>", " ", page, flags=re.S)
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", body)).split())


def test_the_foot_names_what_the_page_was_built_from():
    """Pages of experiments and fits said "from logs", "PDF", and named the paper on limit cycles."""
    page = experiment_page("Double steps", DOUBLE_STEP, [Row("a", "linear", 2, {}, "words")], b"<svg/>")
    assert "from the trials in the folder of this page. The figure is also available as SVG and PNG files" in foot(page)
    row = Row("a", "recording", 2, {}, "words")
    recorded = experiment_page("Double steps", DOUBLE_STEP, [row], None, ("anna.csv",))
    assert "from recordings." in foot(recorded)
    assert "Recorded data: 2 trials, from anna.csv" in recorded
    for said in (foot(page), foot(recorded)):
        assert not any(word in said for word in ("Gawthrop", "logs", "PDF"))


def test_the_page_of_an_experiment_says_what_was_found_of_which_data_before_anything_else():
    """Its title repeated its kind, and its findings came below the methods."""
    words = {"linear": "It sways by 4.9 mm.", "mujoco": "It sways by 4.8 mm."}
    rows = [Row("events", plant, 4, {}, said) for plant, said in words.items()]
    rows += [Row("clock", plant, 4, {}, "Both alike.") for plant in words]
    page = plain(experiment_page("Quiet standing", STANDING, rows, None))
    head, _, rest = page.partition("1 Results")
    assert "Simulated data: 2 cases on the linear plant and in MuJoCo, 4 trials each" in head
    assert "events. On the linear plant, it sways by 4.9 mm. In MuJoCo, it sways by 4.8 mm." in head
    assert "clock. Both alike." in head
    assert "60 s are analysed" in rest.partition("2 Methods")[2]


def test_measures_of_sway_stand_in_millimetres_with_their_scatter_beside_those_of_young_people():
    """RMS was given in metres, and nothing beside it said what is usual."""
    numbers = {"cop.x, RMS (m)": 0.0049, "cop.x, D, short times (m²/s)": 1.16e-5, "cop.x, mean frequency (Hz)": 0.24}
    row = Row("events", "linear", 4, numbers, "words", {"cop.x, RMS (m)": 0.00051})
    page = plain(experiment_page("Standing", STANDING, [row], None))
    assert "RMS (mm) 4.90 ± 0.51 4.74 ± 1.6" in page
    assert "D, short times (mm²/s) 11.6 –" in page
    assert "mean frequency (Hz) 0.240 0.252 ± 0.13" in page
    elsewhere = Row("events", "linear", 4, {"trunk, RMS (rad)": 0.01}, "words")
    page = plain(experiment_page("Standing", STANDING, [elsewhere], None))
    assert "RMS (°) 0.573" in page
    assert "young people" not in page
    measured = Row("anna", "recording", 1, {"ap, RMS (cm)": 0.296}, "words")
    page = plain(experiment_page("Standing", STANDING, [measured], b"<svg/>", ("anna.csv",)))
    assert "RMS (mm) 2.96" in page
    assert "Figure 1. Distribution of ap, divided by its standard deviation" in page
    assert "Right:" not in page


def test_a_confidence_interval_stands_in_one_cell():
    numbers = {"delay (s)": 0.2, "delay, from (s)": 0.19, "delay, to (s)": 0.21, "remnant, share of power": 0.232}
    page = plain(experiment_page("a", DOUBLE_STEP, [Row("a", "linear", 1, numbers, "words")], None))
    assert "delay (s) 0.200 (0.190 to 0.210)" in page
    assert "remnant, share of power (%) 23.2" in page


def test_no_caption_speaks_of_light_and_dark():
    """On a dark page light and dark change places, and hues stay: "shades darken" was not so."""
    for one in pair(everything()):
        for panel in PAPER_PANELS:
            assert not re.search(r"dark|light|pale|shade|black|white", panel.caption(one))


def test_a_missing_plant_has_dashes():
    row = context_of("summary_table", pair([result("b0.8")]))["rows"][0]
    assert (row["runs"]["mujoco"]["interval"], row["runs"]["mujoco"]["mark"]) == ("–", "–")
    assert row["verdicts"] == ["Linear plant: settles on the predicted cycle (period is one interval)."]


def test_errors_name_every_output():
    errors = context_of("summary_table", pair([result("three-link")]))["errors"]
    assert [part.split()[0] for part in errors[0]["amplitude"].split("; ")] == ["shank", "thigh", "trunk"]


def test_abstract_counts():
    text = abstract(pair(everything()))
    assert f"Of the {len(CASES)} cases below, linear theory predicts a limit cycle for 5." in text
    assert "Gawthrop (2017) lists 24 statements, 17 of which are results" in text
    assert "These runs test 14 of them: 9 are reproduced without and 4 with a reservation, 1 not." in text
    assert "In 1 other case a run settles on a cycle although linear theory predicts none." in text
    assert "In MuJoCo all of them are reached" in text


def test_the_headline_counts_the_cases_in_which_no_cycle_is_predicted():
    """It ended "prediction and measurement agree" and left them out; then it did not say which cycles they are."""
    text = headline(pair(everything()))
    assert "predicts a limit cycle in 5 of 7 cases" in text
    found = result("b1.7")
    every = f"with events every {found.measurement.interval:.3f} s on average for “{found.run.case.title}”"
    assert f"settles on another cycle, {every}" in text
    assert text.endswith("; in 1 other case it settles on none.")
    text = headline(pair([result("b0.8"), result("exact")]))
    assert text.endswith("Where it predicts none, none is reached.")  # the intervals grow, as predicted


def test_where_no_cycle_is_predicted_the_interval_stands_in_brackets():
    assert [name for name, row in rows().items() if row["predicted"]["delta"][0] == "("] == ["b1.7"]
    first = result("b1.7")
    noise = 'disturbance = [{ kind = "noise", input = "torque", size = 0.1, bandwidth = 0.5, seed = 1 }]\n'
    noisy = replace(first, run=parse_run(f"{first.run.text}{noise}"))
    row = context_of("summary_table", pair([noisy]))["rows"][0]
    assert (row["predicted"]["delta"], row["predicted"]["eigenvalue"]) == ("–", "–")


def test_columns_of_the_paper_are_there_where_it_has_values():
    """Of a case that is not the paper's they were a column of dashes each."""
    said = dict.fromkeys(("title", "subtitle", "source", "beside"), "")
    page = render_page([compose("summary_table", pair([result("b0.8"), result("exact")]))], **said)
    assert page.count(">paper</th>") == 3
    page = render_page([compose("summary_table", pair([result("exact")]))], **said)
    assert "paper" not in page.partition("<main>")[2].partition("<footer>")[0]
    assert page.partition('<table class="summary')[2].partition("</table>")[0].count("<td data-label") == 7
    assert 'class="verdict"><td colspan="8"' in page


def test_the_sway_of_a_settled_motion_is_said_in_degrees_from_its_extremes():
    """The first screen gave an interval and its error, and not what the body does."""
    run = result("b0.8")
    late = np.degrees(run.simulation.y[run.simulation.t >= run.simulation.t[-1] - run.measurement.period, 0])
    said = headline(pair([run]))
    found = re.search(r"Settled on the linear plant, the angle swings between (\S+)° and (\S+)°\.$", said)
    assert found, said
    low, high = (float(value.replace("−", "-")) for value in found.groups())
    assert (low, high) == (pytest.approx(late.min(), abs=6e-3), pytest.approx(late.max(), abs=6e-3))
    assert max(-low, high) == pytest.approx(np.degrees(run.measurement.amplitude[0]), abs=6e-3)
    # the period is +1: it does not swing about zero
    assert abs(low + high) > 0.1
    context = context_of("case_panels", pair([run]))["cases"][0]
    assert context["sway"] in said
    three = headline(pair([result("three-link", "mujoco")]))
    swings = r"the \w+ swings between .*°, the \w+ between .*°, and the \w+ between .*°"
    assert re.search(rf"Settled in MuJoCo, {swings}\.$", three)
    assert "swings" not in headline(pair([result("exact")]))  # whose intervals grow


@pytest.mark.parametrize("narrow", [False, True])
def test_titles_of_the_overview_have_one_size_and_stand_whole_in_their_place(narrow):
    """Long ones were smaller, and on a telephone hardly to be read."""
    title = "Quiet standing of young people, muscles, delay, b = 0.9, refractory period and noise of 0.1 s (changed)"
    long = parse_run(run_text("b1.2").replace("Simple system, b = 1.2", title))
    cases = pair([result("b0.8"), replace(result("b1.2"), run=long), result("b1.7")])
    with style.apply():
        figure = overview_figure(cases, narrow=narrow)
        figure.set_dpi(1200)  # else letters stand on whole pixels
        figure.draw_without_rendering()
    intervals, errors = figure.axes
    texts = figure.texts[:3] if narrow else intervals.get_yticklabels()
    assert [" ".join(text.get_text().split()) for text in texts] == [case.first.run.case.title for case in cases]
    assert "b\N{NO-BREAK SPACE}=\N{NO-BREAK SPACE}0.9" in texts[1].get_text()
    assert len({text.get_fontsize() for text in texts}) == 1
    assert texts[0].get_fontsize() >= 8
    boxes = [text.get_window_extent() for text in texts]
    assert all(above.y0 > below.y1 for above, below in itertools.pairwise(boxes))
    assert min(box.x0 for box in boxes) >= 0
    assert narrow or max(box.x1 for box in boxes) <= intervals.get_window_extent().x0
    marks = [line.get_ydata()[0] for line in errors.lines if line.get_marker() != "None"]
    assert len(set(marks)) == 2  # none is predicted for b = 1.7
    assert intervals.get_window_extent().width > 0.25 * figure.bbox.width


def found_by(of):
    return Attractor(of.measurement, np.zeros((0, 4)), 24, 1.0, np.zeros(2), np.zeros(2))


def test_attractors_bear_the_marks_of_the_summary():
    """An exact model's growing intervals, as predicted, had a cross; so had the cycles of b = 1.7."""
    marked = {}
    for name in ("b0.8", "b1.7", "exact"):
        found = result(name)
        section = compose("coexisting_attractors", pair([replace(found, attractors=(found_by(found),))]))
        marked[name] = section.context["rows"][0]["mark"][0]
        assert marked[name] == rows()[name]["runs"]["linear"]["mark"]
    assert marked == {"b0.8": "✓", "b1.7": "○", "exact": "✓"}
    other = replace(result("b0.8"), attractors=(found_by(result("exact")),))
    assert context_of("coexisting_attractors", pair([other]))["rows"][0]["mark"][0] == "○"  # the prediction is local


def test_starts_from_which_the_plant_falls_are_said_at_the_top():
    """The table said "growth" and a peak of many turns; the headline, that prediction and measurement agree."""
    found = result("b0.8")
    fallen = replace(found_by(found), measurement=replace(found.measurement, kind="growth"), count=11, share=11 / 24)
    reached = replace(found_by(found), count=13, share=13 / 24)
    cases = pair([replace(found, attractors=(reached, fallen))])
    assert "From 11 of 24 other starts the linear plant falls." in headline(cases)
    row = context_of("coexisting_attractors", cases)["rows"][1]
    assert (row["motion"], row["peak"], row["starts"]) == ("grows without bound: a fall", "–", "11 of 24")
    assert "falls" not in headline(pair([found]))


def test_one_design_is_shown_once():
    context = context_of("design_matrices", pair(everything()))
    assert len(context["blocks"]) == 2
    assert len(context["blocks"][0]["cases"]) == len(CASES) - 1
    k = next(m for m in context["blocks"][0]["matrices"] if m["name"] == "k̂")
    assert k["rows"] == [["4.317", "2.938"]]  # the recovered design (notes, section 4), states in this order
    L = next(m for m in context["blocks"][0]["matrices"] if m["name"] == "L")
    assert L["rows"] == [["4.701"], ["11.05"]]
    stable = {plant["title"]: plant["state_feedback"] for plant in context["plants"]}
    assert not stable["Neglected dynamics, ζ = 0.1"]
    assert stable["Neglected dynamics as printed, ζ = 0.5"]


def test_settings_keep_the_facts_of_each_plant_apart():
    context = context_of("run_settings", pair([result("b0.8"), result("b0.8", "mujoco")]))
    linear, mujoco = context["precision"]
    assert (linear["plant"], mujoco["plant"]) == ("linear", "MuJoCo")
    assert mujoco["keys"] == ["integrator", "order", "timestep"]
    assert mujoco["rows"][0][1:-1] == ["RK4", "4", "0.005"]
    assert ("icmj", "0.1.0") in context["provenance"]


def test_errors_of_each_output_have_the_powers_of_ten_of_all_other_errors():
    found = result("b0.8", "mujoco")
    facts = {"output_errors": "shank 3e-10, e2e-4 8.5e-10", "interval_error": 5.44e-10}
    found = replace(found, simulation=replace(found.simulation, precision=facts))
    (table,) = context_of("run_settings", pair([found]))["precision"]
    said, one = (fact.replace("\N{NO-BREAK SPACE}", " ") for fact in table["rows"][0][1:-1])
    assert (said, one) == ("shank 3 × 10⁻¹⁰, e2e-4 8.5 × 10⁻¹⁰", "5.44 × 10⁻¹⁰")


def test_what_many_runs_share_is_said_once():
    found = [result(name, "mujoco") for name in ("b0.8", "b1.2", "exact")]
    (table,) = context_of("run_settings", pair(found))["precision"]
    assert (table["keys"], table["shared"]) == ([], "integrator RK4, order 4, timestep 0.005")
    found[1] = replace(found[1], simulation=replace(found[1].simulation, precision={"order": 4, "timestep": 0.002}))
    (table,) = context_of("run_settings", pair(found))["precision"]
    assert (table["keys"], table["shared"]) == (["integrator", "timestep"], "order 4")
    assert table["rows"][1][1:-1] == ["–", "0.002"]


class Cone(EventRule):
    """A rule that the report has never heard of."""

    delta_min = 0.02
    size = 0.3

    def resized(self, size):
        raise NotImplementedError

    def faces(self, design):
        return Faces(np.eye(design.plant.n) / self.size, np.array([0, design.plant.n]))

    def facts(self):
        return {"opening": self.size, "axes": np.diag([1.0, 4.0]), "delta_min": self.delta_min}


def test_settings_say_what_each_event_rule_says_of_itself():
    found = result("b0.8")
    other = replace(result("b1.2"), controller=found.controller.triggered_by(Cone()))
    context = context_of("run_settings", pair([found, other]))
    assert context["rule"] == ["q_t", "Q_t", "Δ_min", "opening", "axes"]
    assert context["rows"][0]["rule"] == ["0.01", "ĈᵀĈ", "0.001", "–", "–"]
    assert context["rows"][1]["rule"] == ["–", "–", "0.02", "0.3", "diag(1, 4)"]


def test_settings_are_those_of_the_controller_that_ran():
    """Not those of a run file, which may have been edited or never been there."""
    found = result("b0.8")
    rule = EventTrigger(np.eye(2), 0.25, 0.5)
    context = context_of("run_settings", pair([replace(found, controller=found.controller.triggered_by(rule))]))
    said = dict(zip(context["rule"], context["rows"][0]["rule"], strict=True))
    assert said == {"q_t": "0.25", "Q_t": "I", "Δ_min": "0.5"}


@pytest.mark.parametrize(("weight", "text"), [
    (PENDULUM.C.T @ PENDULUM.C, "ĈᵀĈ"),
    (np.eye(2), "I"),
    (np.diag([2.0, 0.5]), "diag(2, 0.5)"),
    (np.array([[2.0, -1.0], [-1.0, 1.0]]), "[[2, −1], [−1, 1]]"),
    (np.eye(3), "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"),
])  # fmt: skip
def test_a_weight_is_said_in_as_few_signs_as_will_do(weight, text):
    assert SECTIONS["run_settings"].rule_fact(weight, design_of("b0.8")) == text


def test_provenance_that_differs_is_listed():
    other = replace(result("b1.2"), provenance={"icmj": "0.2.0"})
    context = context_of("run_settings", pair([result("b0.8"), other]))
    assert ("icmj", "0.1.0, 0.2.0") in context["provenance"]


def test_without_a_law_there_is_no_section_and_a_law_prints_the_errors_without_sign():
    assert compose("amplitude_law", pair([result("b0.8")])) is None
    item = context_of("amplitude_law", pair([result("three-link", "mujoco")]))["items"][0]
    assert item["interval_slope"] == "2.000"
    assert item["rows"][0] == ["0.01", *(f"{x}\N{NO-BREAK SPACE}×\N{NO-BREAK SPACE}10⁻⁴" for x in ("2.3", "1.4"))]


def test_matrix_is_read_row_by_row():
    rows = SECTIONS["design_matrices"].matrix("A", np.array([[0.0, -1.5], [1.0, 1e-7]]))["rows"]
    assert rows == [["0", "−1.5"], ["1", "1\N{NO-BREAK SPACE}×\N{NO-BREAK SPACE}10⁻⁷"]]


def test_controllers_of_one_body_stand_side_by_side():
    """The measures are those of the run's own second half, told by sums over it; other bodies stay out."""
    found = result("b0.8")
    old = found.actual
    words = {"outputs": ("angle", "speed"), "output_units": ("rad", "rad/s")}
    plant = LinearPlant(old.A, old.B, np.eye(2), states=old.states, inputs=old.inputs, **words)
    law = SwitchingPD(plant, "angle", "speed", P=1.6, D=0.8, delay=0.1)
    run = icmj.simulate_plant(plant, law, Settings(duration=20.0), x0=[0.02, 0.0])
    trial = Result(found.run, plant, plant, law, None, run)
    seen = replace(found, actual=plant, simulation=replace(found.simulation, y=found.simulation.x[:, :2]))
    assert rivals([found, seen]) == []
    (group,) = rivals([found, seen, trial])
    assert [rival.run for rival in group] == [seen, trial]
    late = run.t >= run.t[-1] / 2
    y, t = np.degrees(run.y[late, 0]), run.t[late]
    mean = np.trapezoid(y, t) / np.ptp(t)
    rms = np.sqrt(np.trapezoid((y - mean) ** 2, t) / np.ptp(t))
    assert group[1].sway.coordinates[0].rms == pytest.approx(rms, rel=0.02)
    assert group[1].sway.coordinates[0].speed == pytest.approx(np.abs(np.diff(y)).sum() / np.ptp(t), rel=0.02)
