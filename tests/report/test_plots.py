"""The figures drawn into axes of one's own: the same artists as the report's, nothing else touched."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from report_cases import BY_LETTER, result, swaying

import icmj
from icmj import Delay, Noise, statistics
from icmj.case.motion import output_rate
from icmj.errors import ReportError
from icmj.linear.run import simulate
from icmj.report import style
from icmj.report.case_runs import pair

PLOTS = icmj.plots
BOTH = ("linear", "mujoco")
# what is drawn, and which axes of which panel of the report it is
OF_PANELS = {
    "modulus": ("a", 0), "locus": ("b", 0), "output": ("c", 0), "phase": ("d", 0), "intervals": ("e", 0),
    "critical_mode": ("f", 0), "other_modes": ("f", 1), "interval_errors": ("e", 1), "mode_errors": ("f", 2),
}  # fmt: skip


def noisy():
    quiet = result("b0.8")
    settings = replace(quiet.run.simulation.settings(), disturbance=(Noise("torque", 0.02, corner=0.5, seed=1),))
    simulation = simulate(quiet.actual, quiet.controller, settings)
    return replace(quiet, simulation=simulation, statistics=statistics(simulation))


def axes_of_mine():
    """The right one of two axes, so that a function that makes or takes its own is found out."""
    figure = Figure()
    left, right = figure.subplots(1, 2)
    return figure, left, right


def contents(axes):
    """Every line, with its label, as numbers."""
    return [(str(line.get_label()), line.get_xydata()) for line in axes.get_lines() if len(line.get_xydata())]


@pytest.mark.parametrize("name", ["b0.8", "three-link"])
@pytest.mark.parametrize("function", OF_PANELS)
def test_it_draws_what_the_report_shows_and_nowhere_else(function, name):
    results = [result(name, plant) for plant in BOTH]
    letter, place = OF_PANELS[function]
    expected = BY_LETTER[letter].draw(pair(results)[0]).axes[place]
    figure, left, right = axes_of_mine()
    getattr(PLOTS, function)(right, *results)
    assert not left.has_data()
    assert figure.axes == [left, right]
    assert not figure.texts
    assert not figure.legends
    mine, theirs = contents(right), contents(expected)
    assert len(mine) == len(theirs) > 0
    for (label, points), (other, others) in zip(mine, theirs, strict=True):
        assert label.startswith("_") or label == other
        np.testing.assert_array_equal(points, others)
    assert right.get_xlabel()
    assert right.get_ylabel() == expected.get_ylabel()
    assert right.get_legend() is not None


def off(points, line):
    """Distances of points from a line through others, shape (M,)."""
    a, b = line[:-1], line[1:]
    d = b - a
    part = ((points[:, None] - a) * d).sum(axis=2) / np.maximum((d**2).sum(axis=1), 1e-300)
    return np.linalg.norm(a + np.clip(part, 0, 1)[..., None] * d - points[:, None], axis=2).min(axis=1)


@pytest.mark.parametrize("t_d", [0.0, 0.1])
def test_the_phase_plane_is_a_curve_at_rows_of_10_ms(t_d):
    """It was a polygon: after each event the three-link body runs through its curve in two rows."""
    found = result("three-link")
    law, prediction = replace(found.controller, delay=Delay(t_d)), replace(found.prediction, orbit=None)
    sizes = {"duration": 8.0, "record_interval": 0.01}
    runs = [
        simulate(found.actual, law, replace(found.run.simulation.settings(), **sizes | changes))
        for changes in ({}, {"record_interval": 1e-3})
    ]
    axes = Figure().subplots()
    PLOTS.phase(axes, replace(found, controller=law, prediction=prediction, simulation=runs[0]))
    drawn = [line.get_xydata() for line in axes.get_lines() if line.get_color() == style.RUN["linear"]["color"]]
    assert len(drawn) == 3
    start = runs[0].events.t[-9]
    for output, line in enumerate(drawn):
        rows, dense = (
            np.degrees(np.column_stack([run.y[late, output], output_rate(found, run.x, run.u)[late, output]]))
            for run in runs
            for late in [run.t >= start]
        )
        pixels = 400 / np.ptp(dense, axis=0)
        assert off(pixels * dense, pixels * line).max() < 0.5
        assert off(pixels * rows, pixels * line).max() < 1e-6
        assert off(pixels * dense, pixels * rows).max() > 0.5 or output
        assert len(line) < 4 * len(rows)


@pytest.mark.parametrize("function", ["interval_histogram", "spectrum"])
def test_a_run_under_noise_is_drawn(function):
    _, left, right = axes_of_mine()
    getattr(PLOTS, function)(right, noisy(), legend=False)
    assert right.has_data()
    assert not left.has_data()
    assert right.get_legend() is None
    with pytest.raises(ReportError, match="only runs under noise"):
        getattr(PLOTS, function)(right, result("b0.8"))


def test_the_hold_error_of_a_settled_run_lies_on_the_predicted_orbit():
    _, left, right = axes_of_mine()
    PLOTS.hold_error(right, result("b1.2"))
    assert not left.has_data()
    lines = dict(contents(right))
    predicted = lines["predicted"]
    assert lines["threshold"][:, 1] == pytest.approx(1)
    runs = [points for label, points in contents(right) if label == "linear" or label.startswith("_")]
    assert len(runs) >= 3
    for points in runs:
        assert points[-1] == pytest.approx(predicted[-1], rel=1e-3)
        # the polygon through 256 points of the orbit is that near to its curve
        np.testing.assert_allclose(points[:, 1], np.interp(points[:, 0], *predicted.T), atol=2e-3)
    found = result("b1.2")
    started = simulate(found.actual, found.controller, replace(found.run.simulation.settings(), duration=0.5))
    with pytest.raises(ReportError, match="no complete interval"):
        PLOTS.hold_error(right, replace(found, simulation=started))


def test_the_amplitude_law_and_the_norm_are_drawn():
    _, _, axes = axes_of_mine()
    PLOTS.amplitude_law(axes, result("three-link", "mujoco"))
    assert axes.get_xscale() == "log"
    _, _, axes = axes_of_mine()
    PLOTS.state_norm(axes, result("exact"))
    assert axes.get_yscale() == "log"
    with pytest.raises(ReportError, match="no amplitude law"):
        PLOTS.amplitude_law(axes, result("b0.8"))
    with pytest.raises(ReportError, match="χ is undefined"):
        PLOTS.critical_mode(axes, result("exact"))


def test_what_acts_beside_the_command_is_drawn():
    pushed = noisy()
    for wanted in (None, 0, "torque"):
        _, left, right = axes_of_mine()
        PLOTS.acting(right, pushed, input=wanted)
        ((_, points),) = [each for each in contents(right) if each[0] == "what acts"]
        np.testing.assert_array_equal(points[:, 1], pushed.simulation.applied[:, 0])
        assert not left.has_data()
    with pytest.raises(ReportError, match="nothing but the command"):
        PLOTS.acting(right, result("b0.8"))
    with pytest.raises(ReportError, match="no input 'hip'; expected one of torque"):
        PLOTS.acting(right, pushed, input="hip")


def test_the_centre_of_pressure_is_drawn():
    found = result("b0.8")
    standing = swaying(found)
    centre = standing.simulation.pressure.centre
    _, left, right = axes_of_mine()
    PLOTS.pressure(right, standing)
    assert dict(contents(right))["linear"][:, 1] == pytest.approx(1e3 * centre[:, 0])
    assert "$x$ (mm)" in right.get_ylabel()
    assert not left.has_data()
    with pytest.raises(ReportError, match="expected x or y"):
        PLOTS.pressure(right, standing, axis="z")
    with pytest.raises(ReportError, match="nothing stands on a floor"):
        PLOTS.pressure(right, found)


@pytest.mark.parametrize("function", ["sway_path", "sway_diffusion", "sway_spectrum"])
def test_measured_sway_is_drawn(function, root):
    sway = icmj.measure_sway(icmj.read_series(root / "examples" / "standing.csv", rate=100.0))
    figure, left, right = axes_of_mine()
    getattr(PLOTS, function)(right, sway)
    drawn = dict(contents(right))
    assert not left.has_data()
    assert figure.axes == [left, right]
    assert "cm" in right.get_ylabel()
    if function == "sway_path":
        np.testing.assert_array_equal(drawn["path"], sway.series.values)
        one = icmj.measure_sway(sway.series, ["ap"])
        with pytest.raises(ReportError, match="two signals of the same unit"):
            PLOTS.sway_path(right, one)
    elif function == "sway_diffusion":
        found = sway.plane.diffusion
        curve = drawn[f"plane, H = {found.short.H:.2f}, {found.long.H:.2f}"]
        np.testing.assert_array_equal(curve[:, 1], found.displacement)
        fitted = [points for label, points in contents(right) if label.startswith("_")]
        assert len(fitted) == 6
        (start, end) = fitted[-2]  # the plane's, on short times
        assert np.log(end[1] / start[1]) / np.log(end[0] / start[0]) == pytest.approx(2 * found.short.H)
    else:
        np.testing.assert_array_equal(drawn["ml"][:, 1], sway.spectrum.power[1:, 1])


def test_an_output_is_taken_by_number_or_name():
    found = result("three-link")
    for wanted in (2, -1, "trunk"):
        _, _, axes = axes_of_mine()
        PLOTS.output(axes, found, output=wanted)
        assert axes.get_ylabel() == "trunk (deg)"
    for wanted in (3, "head"):
        with pytest.raises(ReportError, match=r"expected one of shank, thigh, trunk, or its number"):
            PLOTS.output(axes, found, output=wanted)


def test_results_that_do_not_belong_together_are_refused():
    _, _, axes = axes_of_mine()
    with pytest.raises(ReportError, match="different cases"):
        PLOTS.phase(axes, result("b0.8"), result("b1.2"))
    with pytest.raises(ReportError, match="no results"):
        PLOTS.phase(axes)


def test_the_circle_stays_round_when_the_figure_changes_its_shape():
    figure, _, axes = axes_of_mine()
    PLOTS.locus(axes, result("b0.8"))
    figure.set_size_inches(9, 3)
    FigureCanvasAgg(figure).draw()
    width, height = axes.get_window_extent().size
    scale = [np.ptp(limits) / size for limits, size in ((axes.get_xlim(), width), (axes.get_ylim(), height))]
    assert scale[0] == pytest.approx(scale[1], rel=1e-6)


def test_double_steps_are_drawn_where_they_were_found():
    isi = np.repeat([0.1, 0.3, 0.6], 4)
    rt = 0.14 + np.column_stack([0 * isi, np.maximum(0.0, 0.4 - isi)])
    _, left, right = axes_of_mine()
    PLOTS.reaction_times(right, icmj.refractoriness(isi, rt))
    assert not left.has_data()
    lines = [line for line in right.get_lines() if line.get_label().startswith(("free", "slope"))]
    assert len(lines) == 2
    for line in lines:
        np.testing.assert_allclose(line.get_ydata(), 0.14 + np.maximum(0, 0.4 - line.get_xdata()), atol=1e-9)
    pairs = icmj.controller.StepPairs([[1.0, 1.5]], [[1.0, -2.0]])
    t = 0.01 * np.arange(400)
    u = (t >= 1.2) - 2.0 * (t >= 1.7)
    still = icmj.experiments.StepResponse(np.array([[-1.0]]), np.zeros(1), np.zeros(1), 1.0)
    found = icmj.experiments.reconstruct_steps(icmj.Series(t, u[:, None], ("u",), ("m",)), "u", pairs, response=still)
    PLOTS.reconstruction(left, found)
    assert left.get_ylabel() == "control (m)"
    assert len(left.patches) == 2
    with pytest.raises(ReportError, match="no pair 1 of 1"):
        PLOTS.reconstruction(left, found, 1)
