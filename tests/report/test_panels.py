"""The panels draw what theory and runs say: read back from the drawn artists, against closed forms where there are."""

import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from report_cases import BY_LETTER, CASES, PAPER_PANELS, result, run_text
from scipy.linalg import expm

from icmj import parse_run
from icmj.case.motion import latter_part, reduce_state
from icmj.case.noise import spread_about
from icmj.linear.run import simulate
from icmj.report import style
from icmj.report.axes import LAST_INTERVALS
from icmj.report.axes.eigenvalues import shown_locus
from icmj.report.case_runs import CaseRuns, pair
from icmj.report.panel import Panel
from icmj.simulation.pressure import Pressure

DEG = np.rad2deg(1)
# what each caption speaks of, panel by panel, and no other does
SUBJECTS = ("Largest", "unit circle", "^Outputs? under", "Velocity", "^Open-loop interval Δ_ol that", "mode|Norm")


@pytest.fixture(autouse=True)
def _styled():
    with style.apply():
        yield


def case(name, *plants):
    return pair([result(name, plant) for plant in plants or ("linear", "mujoco")])[0]


def line(axes, label):
    found = [item for item in axes.get_lines() if item.get_label() == label]
    assert len(found) == 1, [item.get_label() for item in axes.get_lines()]
    return found[0].get_xydata()


def drawn_texts(figure):
    """The texts that appear: labels, annotations, legend entries, and the tick labels within the limits."""
    yield from figure.texts
    for legend in figure.legends:
        yield from legend.get_texts()
    for axes in figure.axes:
        yield from axes.texts
        for axis in (axes.xaxis, axes.yaxis):
            yield axis.label
            low, high = sorted(axis.get_view_interval())
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                if low <= tick.get_loc() <= high:
                    yield from (label for label in (tick.label1, tick.label2) if label.get_visible())


def assert_legible(figure):
    """Every text lies on the figure, is at least 7 pt, and no two of them overlap."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    width, height = canvas.get_width_height()
    texts = [text for text in drawn_texts(figure) if text.get_text().strip()]
    boxes = [text.get_window_extent(canvas.get_renderer()) for text in texts]
    for n, (text, box) in enumerate(zip(texts, boxes, strict=True)):
        name = text.get_text()
        assert text.get_fontsize() >= 7, name
        assert box.x0 >= -0.5, name
        assert box.y0 >= -0.5, name
        assert box.x1 <= width + 0.5, name
        assert box.y1 <= height + 0.5, name
        for other, beside in zip(texts[:n], boxes[:n], strict=True):
            across = min(box.x1, beside.x1) - max(box.x0, beside.x0)
            along = min(box.y1, beside.y1) - max(box.y0, beside.y0)
            assert min(across, along) < 1.5, (name, other.get_text())  # pixels of a hundredth of an inch


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("letter", "abcdef")
def test_every_panel_of_every_case_is_whole_and_legible(name, letter):
    figure = BY_LETTER[letter].draw(case(name))
    assert_legible(figure)
    assert figure.get_size_inches()[0] * 25.4 == pytest.approx(85)
    for axes in figure.axes:
        assert axes.get_ylabel()
    assert figure.axes[0].get_xlabel() or figure.axes[-1].get_xlabel()


@pytest.mark.parametrize("name", CASES)
def test_every_panel_has_its_own_letter_and_caption(name):
    assert [panel.letter for panel in PAPER_PANELS] == list("abcdef")
    captions = [panel.caption(case(name)) for panel in PAPER_PANELS]
    assert len(set(captions)) == len(captions)
    for panel, caption, subject in zip(PAPER_PANELS, captions, SUBJECTS, strict=True):
        assert re.search(subject, caption), panel.letter
        assert caption.endswith(".")
        assert sum(bool(re.search(other, caption)) for other in SUBJECTS) == 1


@pytest.mark.parametrize("panel", PAPER_PANELS, ids=lambda panel: panel.letter)
def test_the_letter_on_a_panel_is_its_own(panel):
    letters = [text.get_text() for text in panel.draw(case("b0.8", "linear")).texts]
    assert letters == [f"({panel.letter})"]


def pressed(found):
    """The run as of a body on heel and toe, whose pressure follows its first output."""
    simulation = found.simulation
    at = np.searchsorted(simulation.t, simulation.events.t)
    x = simulation.y[:, 0]
    load = np.column_stack([300 - 1e3 * x, 300 + 1e3 * x])
    centre = np.column_stack([x, 0 * x])
    pressure = Pressure(
        simulation.t, centre, np.zeros(2), ("heel", "toe"), load, np.array([300.0, 300.0]),
        simulation.events.t, centre[at], load[at],
    )  # fmt: skip
    return replace(found, simulation=replace(simulation, pressure=pressure))


def test_a_case_has_the_further_panels_that_it_has_something_for():
    found = result("three-link", "mujoco")
    acting, pressure = BY_LETTER["g"], BY_LETTER["h"]
    plain = pair([found])[0]
    assert not acting.applies(plain)
    assert not pressure.applies(plain)
    u = found.simulation.u
    most = np.quantile(np.abs(u), 0.9)
    facts = {**found.simulation.precision, "saturated_share": 0.1}
    cut = replace(found, simulation=replace(found.simulation, applied=np.clip(u, -most, most), precision=facts))
    both = pair([pressed(result("three-link")), pressed(cut)])[0]
    assert acting.applies(both)
    assert pressure.applies(both)
    figure = acting.draw(both)
    assert_legible(figure)
    assert len(figure.axes) == int((np.abs(u).max(axis=0) > most).sum())
    drawn = line(figure.axes[0], "what acts")
    assert drawn[:, 1].max() == pytest.approx(most)
    assert line(figure.axes[0], "command $u$")[:, 1].max() > most
    said = "Command of the controller, and the input that acts on the plant, which is limited by the actuators."
    assert acting.caption(both) == said
    figure = pressure.draw(both)
    assert_legible(figure)
    drawn = line(figure.axes[0], "linear")
    assert drawn[:, 1].max() == pytest.approx(1e3 * both.linear.simulation.y[:, 0].max())
    assert "is unloaded by" in pressure.caption(both)


def test_a_run_under_noise_has_its_hold_error_beside_the_predicted_orbit_with_its_spread():
    panel, quiet = BY_LETTER["i"], result("b1.2")
    assert not panel.applies(pair([quiet])[0])
    noise = '[[simulation.disturbance]]\nkind = "gaussian"\noutput = "angle"\nsize = 3e-4\ninterval = 0.01\nseed = 1\n'
    run = parse_run(run_text("b1.2") + noise)
    simulation = simulate(quiet.actual, quiet.controller, run.simulation.settings())
    case = pair([replace(quiet, run=run, simulation=simulation)])[0]
    assert panel.applies(case)
    figure = panel.draw(case)
    assert_legible(figure)
    (axes,) = figure.axes
    assert {text.get_text() for text in figure.legends[0].get_texts()} == {"± 2 SD", "predicted", "linear", "threshold"}
    drawn = [line.get_xydata() for line in axes.lines if line.get_color() == style.RUN["linear"]["color"]]
    assert len(drawn) == LAST_INTERVALS
    last = simulation.events.interval[-LAST_INTERVALS:]
    for line_of_run, interval in zip(drawn, last, strict=True):
        np.testing.assert_allclose(line_of_run[[0, -1]], [[0, 0], [interval, 1]], atol=1e-9)
    predicted = line(axes, "predicted")
    np.testing.assert_allclose(predicted[[0, -1]], [[0, 0], [case.prediction.delta_crit, 1]], atol=1e-9)
    # the band is as wide at the end as the deviation at the nominal event says, and nearly every interval is within it
    (band,) = axes.collections
    border = band.get_paths()[0].vertices
    spread = spread_about(case.last, case.prediction.orbit)
    assert border[:, 1].max() == pytest.approx(1 + 2 * spread.epsilon)
    at = 0.6 * case.prediction.delta_crit
    middle, off = np.interp(at, *predicted.T), 2 * np.interp(at, spread.t, spread.hold_error)
    inside = [abs(np.interp(at, *each.T) - middle) < 1.5 * off for each in drawn]
    assert all(inside)
    assert "2 predicted standard deviations" in panel.caption(case)
    assert not re.search(r"dark|light|pale|shade|black|white", panel.caption(case))  # they change places on a dark page
    free = replace(quiet.prediction, cycle=False, verdict="repelling")
    alone = pair([replace(case.last, prediction=free)])[0]
    assert "predicted" not in panel.caption(alone)
    assert not panel.draw(alone).axes[0].collections


def test_a_panel_without_a_caption_cannot_be():
    with pytest.raises(TypeError, match="caption"):
        Panel("g", BY_LETTER["f"].drawing)


@pytest.mark.parametrize("name", ["b0.8", "exact"])
@pytest.mark.parametrize("plant", ["linear", "mujoco"])
@pytest.mark.parametrize("letter", "abcdef")
def test_one_plant_alone_is_drawn_too(name, plant, letter):
    assert len(style.save(BY_LETTER[letter].draw(case(name, plant)), "svg")) > 5000


@pytest.mark.parametrize("letter", "abcdef")
def test_a_run_without_events_is_drawn_too(letter):
    found, events = result("b0.8"), result("b0.8").simulation.events
    none = replace(events, **{k: getattr(events, k)[:0] for k in ("t", "x", "x_o", "x_h", "y_max", "y_min")})
    quiet = replace(found.measurement, kind="no events", p=None, period=None, interval=None, intervals=np.zeros(0))
    runs = pair([replace(found, simulation=replace(found.simulation, events=none), measurement=quiet)])
    assert style.save(BY_LETTER[letter].draw(runs[0]), "pdf").startswith(b"%PDF")


@pytest.mark.parametrize("letter", "abcdef")
@pytest.mark.parametrize("name", ["b0.8", "exact"])
def test_a_diverged_run_is_drawn_up_to_where_it_is_finite(name, letter):
    found = result(name)
    s = found.simulation
    broken = {key: getattr(s, key).copy() for key in ("x", "y", "u", "x_o", "x_h")}
    for values in broken.values():
        values[-3:-1], values[-1] = np.inf, np.nan
    lost = replace(found.measurement, kind="growth", p=None, period=None, intervals=np.zeros(0))
    with np.errstate(invalid="ignore"):
        figure = BY_LETTER[letter].draw(pair([replace(found, simulation=replace(s, **broken), measurement=lost)])[0])
        assert_legible(figure)


def test_a_passes_through_one_at_delta_crit():
    runs = case("b0.8")
    axes = BY_LETTER["a"].draw(runs).axes[0]
    delta, largest = line(axes, r"$\rho=1$").T
    assert np.interp(1.8065408, delta, largest) == pytest.approx(1, abs=1e-3)
    # ρ = 0: the separation principle; φ has the eigenvalues of e^{Â_cΔ} and e^{Â_oΔ}
    delta, largest = line(axes, r"$\rho=0$").T
    of = runs.first.controller.design
    expected = [max(np.abs(np.linalg.eigvals(expm(A * d))).max() for A in (of.A_c, of.A_o)) for d in delta[::64]]
    assert largest[::64] == pytest.approx(expected, abs=1e-9)
    growth = runs.first.growth
    for label in ("linear", "MuJoCo"):
        assert line(axes, label) == pytest.approx(np.column_stack([growth.delta, growth.measured]))


def test_b_marks_the_eigenvalues_at_delta_crit():
    runs = case("b1.7")
    axes = BY_LETTER["b"].draw(runs).axes[0]
    assert line(axes, r"$\lambda_{crit}=-1$")[0] == pytest.approx([-1, 0], abs=1e-6)
    all_of_them = line(axes, r"all $\lambda_j$ at $\Delta_{crit}$")
    assert sorted(np.hypot(*all_of_them.T))[-1] == pytest.approx(1.20, abs=5e-3)  # notes, section 4
    assert axes.get_xlim()[0] < -1.2
    assert axes.get_ylim()[1] < 1.5


def test_b_starts_at_one():
    shown = shown_locus(case("three-link"), result("three-link").actual)
    assert shown.delta[0] == 0
    assert shown.eigenvalues[0] == pytest.approx(np.ones(12))
    assert np.all(np.diff(shown.delta) > 0)


def test_c_is_in_degrees_with_events_and_clipped_to_the_intermittent_run():
    found = result("b0.8")
    wild = replace(found, continuous=replace(found.continuous, y=found.continuous.y * 1e6))
    axes = BY_LETTER["c"].draw(pair([wild])[0]).axes[0]
    assert line(axes, "linear") == pytest.approx(np.column_stack([found.simulation.t, found.simulation.y[:, 0] * DEG]))
    assert axes.get_ylim()[1] < 1.2 * np.abs(found.simulation.y).max() * DEG
    events = [segment[0, 0] for segment in axes.collections[0].get_segments()]
    assert events == pytest.approx(found.simulation.events.t)


def test_c_has_one_axes_for_each_output():
    axes = BY_LETTER["c"].draw(case("three-link")).axes
    assert [item.get_ylabel() for item in axes] == ["shank (deg)", "thigh (deg)", "trunk (deg)"]


def test_d_shows_the_orbit_under_the_measured_cycle():
    runs = case("b1.2")
    axes = BY_LETTER["d"].draw(runs).axes[0]
    predicted, measured = line(axes, "predicted"), line(axes, "linear")
    nearest = [np.hypot(*(predicted - point).T).min() for point in measured[::10]]
    assert max(nearest) < 0.02 * np.abs(predicted).max()
    order = [item.get_label() for item in axes.get_lines()]
    assert order.index("predicted") < order.index("linear") < order.index("MuJoCo")


def test_e_has_every_interval_and_delta_crit():
    events = result("b0.8").simulation.events
    axes = BY_LETTER["e"].draw(case("b0.8", "linear")).axes[0]
    assert line(axes, "linear") == pytest.approx(np.column_stack([events.t, events.interval]))
    dotted = next(item for item in axes.get_lines() if "Delta_{crit}" in item.get_label())
    assert dotted.get_ydata()[0] == pytest.approx(1.8065, abs=1e-4)


@pytest.mark.parametrize("name", ["b0.8", "b1.2", "neglected"])
def test_f_meets_gamma_at_events_where_the_others_vanish(name):
    found = result(name)
    critical, others, *_ = BY_LETTER["f"].draw(case(name, "linear")).axes
    gamma = found.prediction.gamma
    chi, rest = line(critical, "linear"), others.get_lines()[-1].get_xydata()
    for t in found.simulation.events.t[-4:]:
        n = int(np.argmin(np.abs(chi[:, 0] - t)))
        assert abs(chi[n, 1]) == pytest.approx(gamma, rel=1e-6)
        assert rest[n, 1] == pytest.approx(0, abs=1e-6 * gamma + 1e-9)
    predicted = line(critical, "predicted")
    predicted = predicted[~np.isnan(predicted[:, 0])]
    at = np.interp(predicted[:, 0], *chi.T)
    assert np.abs(at - predicted[:, 1]).max() < 0.03 * np.abs(chi[:, 1]).max()
    levels = [item.get_ydata()[0] for item in critical.get_lines() if item.get_linestyle() != "-"]
    assert sorted(levels) == pytest.approx([-gamma, gamma])


def test_f_draws_the_norm_where_chi_is_undefined():
    figure = BY_LETTER["f"].draw(case("exact"))
    assert len(figure.axes) == 1
    assert figure.axes[0].get_yscale() == "log"
    assert "undefined" in figure.axes[0].get_ylabel()
    found, run = result("exact"), result("exact").simulation
    expected = np.linalg.norm(reduce_state(found, run.x, run.x_o, run.x_h), axis=1)
    assert line(figure.axes[0], "linear")[:, 1] == pytest.approx(expected)


def test_saved_figures_repeat_to_the_byte_and_name_no_time():
    first, second = (style.save(BY_LETTER["e"].draw(case("b0.8")), "svg") for _ in range(2))
    assert first == second
    assert not re.search(rb"<dc:date>", first)
    assert not re.search(rb"http://(?!www\.w3\.org|purl\.org|creativecommons\.org)", first)


def test_a_announces_points_only_where_there_are_some():
    found = case("b0.8", "linear")
    without = pair([replace(found.first, growth=None)])[0]
    caption = BY_LETTER["a"].caption
    assert "Points" in caption(found)
    assert "Points" not in caption(without)


def test_strips_beneath_e_and_f_show_how_far_the_last_interval_is_from_the_prediction():
    found = case("b1.2", "linear", "mujoco")
    strip = BY_LETTER["e"].draw(found).axes[1]
    intervals = found.first.simulation.events.interval
    points = {line.get_label(): line.get_ydata() for line in strip.get_lines()}
    expected = np.maximum(np.abs(intervals - found.prediction.delta_crit) / found.prediction.delta_crit, 1e-16)
    np.testing.assert_allclose(points["linear"], expected, rtol=1e-6, atol=1e-15)
    assert points["linear"][-1] < 1e-9 < points["linear"][1]
    modes = BY_LETTER["f"].draw(found).axes[2].get_lines()[0].get_ydata()
    assert np.max(modes) < 1e-6  # on the cycle |χ_k1| is γ at events
    assert "Beneath" in BY_LETTER["e"].caption(found)
    # no cycle, nothing to depart from
    other = case("b1.7", "linear")
    assert len(BY_LETTER["e"].draw(other).axes) == 1
    assert "Beneath" not in BY_LETTER["e"].caption(other)


def test_names_of_several_inputs_stand_clear_of_each_other():
    found = result("three-link")
    simulation = found.simulation
    limited = replace(simulation, applied=0.9 * simulation.u)
    figure = BY_LETTER["g"].draw(pair([replace(found, simulation=limited)])[0])
    figure.canvas.draw()
    assert len(figure.axes) == 3
    labels = [axes.yaxis.get_label() for axes in figure.axes] + [axes.texts[0] for axes in figure.axes]
    boxes = [label.get_window_extent() for label in labels]
    for i, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[i + 1 :])


def test_d_leaves_a_gap_where_the_rate_of_an_output_jumps_with_the_command():
    """Rows before and after a jump were joined, at another angle in every cycle: a filled wedge."""
    found = result("b0.8")
    rate = replace(found.actual, C=np.array([[1.0, 0.0], [0.0, 1.0]]), outputs=("angle", "rate"), output_units=())
    y = np.column_stack([found.simulation.y[:, 0], found.simulation.x[:, 1]])
    alone = replace(found.prediction, orbit=None)
    both = replace(found, actual=rate, simulation=replace(found.simulation, y=y), prediction=alone)
    (axes,) = BY_LETTER["d"].drawing(pair([both])[0]).axes
    position, velocity = (line for line in axes.lines if len(line.get_xdata()) > 50)
    late = found.simulation.events.t >= latter_part(found.simulation, 8)[0]
    assert np.isfinite(position.get_ydata()).all()
    assert late.sum() - 1 <= np.isnan(velocity.get_ydata()).sum() <= late.sum()


def test_d_parts_the_outputs_of_a_run_under_noise():
    quiet = case("three-link", "linear")
    driven = replace(quiet.first, simulation=replace(quiet.first.simulation, noisy=True))
    figure = BY_LETTER["d"].draw(CaseRuns("three-link", {"linear": driven}))
    assert_legible(figure)
    together = BY_LETTER["d"].draw(quiet).axes[0]
    assert len(figure.axes) == 3
    drawn = [curve.get_xydata() for axes in figure.axes for curve in axes.get_lines()]
    assert len(drawn) == len(together.get_lines())
    for mine, theirs in zip(drawn, together.get_lines(), strict=True):
        np.testing.assert_array_equal(mine, theirs.get_xydata())
    assert "one output in each" in BY_LETTER["d"].caption(CaseRuns("three-link", {"linear": driven}))
