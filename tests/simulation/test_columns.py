"""What a run gives away: every signal by name, between rows as exactly as the rows allow, across no event."""

from dataclasses import replace

import numpy as np
import pytest
from report_cases import design_of, result

from icmj.case.case import prepare, simulate_plant
from icmj.case.case import simulate as simulate_case
from icmj.controller.controller import Controller
from icmj.controller.delay import Delay
from icmj.controller.design import output_weight
from icmj.controller.hold import system_matched
from icmj.controller.rules.quadratic import EventTrigger
from icmj.controller.setpoint import Target, step
from icmj.controller.setpoint import setpoint as setpoint_of
from icmj.controller.trigger import ClockTrigger, Continuous
from icmj.errors import DataError
from icmj.linear.run import simulate
from icmj.runfile.reading import load_run, parse_run
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Impulse, Sinusoids, Step

RATE = 373.0  # Hz: no row of a grid of 10 ms, but for every whole second


def controller(trigger=None, delay=None):
    design = design_of("b0.8")
    rule = trigger or EventTrigger(output_weight(design), 0.01, 0.3 if delay else 0.0)
    return Controller(design, system_matched(design), rule, **({"delay": Delay(delay, delay)} if delay else {}))


def run(control, interval=0.01, **more):
    settings = Settings(duration=8.0, initial={"hinge": 0.02}, record_interval=interval, **more)
    return simulate(design_of("b0.8").plant.scaled(0.8), control, settings)


def departure(simulation, exact, *known, of, rate=RATE):
    """Largest departure of each kind of signals from a run recorded at this rate, relative to its largest value."""
    found = simulation.to_series(rate, *known)
    rows = np.searchsorted(exact.t, found.t + 1e-9) - 1
    assert exact.t[rows] == pytest.approx(found.t, abs=1e-9)
    errors = {}
    for kind in of:
        there = getattr(exact, kind)[rows]
        mine = found.values[:, [i for i, name in enumerate(found.names) if name.startswith(f"{kind}.")]]
        errors[kind] = np.abs(mine - there).max() / np.abs(there).max()
    return errors


ALL = ("x", "y", "u", "x_o", "x_h")


def test_between_rows_it_is_the_run_recorded_there_to_fourth_order():
    control = controller()
    exact = run(control, 1 / RATE)
    errors = [departure(run(control, step), exact, control, of=ALL) for step in (0.04, 0.02, 0.01)]
    assert max(errors[-1].values()) < 1e-6
    for kind in ALL:
        slope = np.log2(errors[0][kind] / errors[2][kind]) / 2
        assert slope > 3.5, kind


def test_without_the_controller_what_jumps_is_extended_from_behind():
    control = controller()
    exact = run(control, 1 / RATE)
    errors = departure(run(control), exact, of=ALL)
    assert max(errors.values()) < 5e-5
    assert errors["x"] < 1e-6


@pytest.mark.parametrize("kind", ["delay", "clock", "continuous"])
def test_delays_clocks_and_continuous_control(kind):
    control = {
        "delay": lambda: controller(delay=0.1234),
        "clock": lambda: controller(ClockTrigger(0.217)),
        "continuous": lambda: controller(Continuous()),
    }[kind]()
    simulation, exact = run(control), run(control, 1 / RATE)
    errors = departure(simulation, exact, control, of=ALL)
    assert max(errors.values()) < 2e-5, errors
    assert ("E" in simulation.to_series().names) == (kind == "delay")


@pytest.mark.parametrize("kind", ["event", "clock", "continuous"])
@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_both_sides_are_known_of_actions_and_edges(kind, plant):
    """Right before them: what fine rows tell, and what coarse ones are exported as, with few between two actions."""
    control = {
        "event": lambda: controller(EventTrigger(output_weight(design_of("b0.8")), 0.002, 0.02), delay=0.02),
        "clock": lambda: controller(ClockTrigger(0.031), delay=0.0253),
        "continuous": lambda: followed(controller(Continuous()), step(0.01, 0.7037)),
    }[kind]()
    case = prepare(load_run("simple-0.8"))
    body = case.system.actual if plant == "linear" else case.actual
    push = (Sinusoids(input="torque", terms=((0.05, 7.0, 0.4, 0.3033, 1.2071),)), Step("torque", 0.05, 0.4))
    settings = Settings(duration=1.5, initial={"hinge": 0.02}, tolerance=1e-10, disturbance=push)
    fine, coarse = (
        simulate_plant(body, control, replace(settings, record_interval=interval)) for interval in (1e-4, 0.01)
    )
    instants = np.unique(np.concatenate([fine.actions, fine.edges]))
    assert fine.leads[:, 0] == pytest.approx(instants[instants < fine.t[-1]], abs=1e-12)
    compared, there = 0, np.column_stack([fine.u, fine.applied, fine.pushed, fine.x_h, fine.E])
    size = np.abs(there).max(axis=0)
    for t, *left in fine.leads:
        row = int(np.searchsorted(fine.t, t - 1e-9))
        few = slice(row - 3, row)
        if (np.abs(instants - t) < 5e-4).sum() > 1 or (np.abs(fine.events.t - t) < 5e-4).any():
            continue
        told = np.polynomial.polynomial.polyfit(fine.t[few] - t, there[few], 2)[0]
        assert (np.abs(left - told) <= 1e-6 * size)[np.isfinite(told)].all(), t
        compared += 1
    assert compared >= 4
    one, other = (run.to_series(1000.0, control) for run in (coarse, fine))
    for name, bound in (("u.torque", 1e-6), ("x_h.hinge_rate", 1e-6), ("E", 5e-5)):
        if name in other.names and not (kind == "continuous" and name == "u.torque"):  # a plant's own time constants
            late = other.t > 0.1
            assert np.abs(one[name] - other[name])[late].max() <= bound * np.abs(other[name]).max(), name


def followed(control, terms):
    """The controller with a set-point of the pendulum's angle."""
    return replace(control, setpoint=setpoint_of(control.plant, [Target({"angle": 1.0}, terms)]))


@pytest.mark.parametrize("kind", ["delay", "clock", "event", "continuous"])
@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_where_signals_jump_the_side_is_that_of_a_row_there(kind, plant):
    """Actions, ticks and steps of the set-point on multiples of 0.1 s, which decimal fractions miss by rounding."""
    control = {
        "delay": lambda: replace(controller(ClockTrigger(0.3)), delay=Delay(0.2, 0.2)),
        "clock": lambda: controller(ClockTrigger(0.3)),
        "event": controller,
        "continuous": lambda: controller(Continuous()),
    }[kind]()
    control = followed(control, np.concatenate([step(0.01, at) for at in (0.7, 2.3, 4.1)]))
    case = prepare(load_run("simple-0.8"))
    body = case.system.actual if plant == "linear" else case.actual
    settings = Settings(duration=6.0, initial={"hinge": 0.02}, tolerance=1e-9)
    # of the first run no row but those of events is at a multiple of 0.1 s, of the second each
    coarse, exact = (
        simulate_plant(body, control, replace(settings, record_interval=interval)) for interval in (0.0137, 0.1)
    )
    errors = departure(coarse, exact, *(() if kind == "delay" else (control,)), of=ALL, rate=10.0)
    assert max(errors.values()) < 1e-5
    # a jump that is missed is a hundred times as large
    assert np.abs(np.diff(exact.u, axis=0)).max() > 1e-3 * np.abs(exact.u).max()


def test_continuous_commands_jump_with_the_set_point_and_no_spline_crosses_that():
    control = followed(controller(Continuous()), step(0.01, 2.3037))
    errors = departure(run(control), run(control, 1 / RATE), control, of=ALL)
    assert max(errors.values()) < 2e-5, errors


def test_where_a_controller_changes_its_mode_without_an_event_its_command_bends(root):
    """Of the shipped controller that knows its saturation: it leaves the bound where no instant is planned."""
    file = load_run(root / "examples/hybrid/saturating.toml", allow_code=True)
    push = {"kind": "step", "input": "ankle_torque", "size": 1.0, "start": 1.0}
    more = {"simulation.duration": 6.0, "simulation.disturbance": [push], "assumed.delay": 0.25}
    coarse, exact = (
        simulate_case(prepare(file.with_(**more, **{"simulation.record_interval": interval})), "linear")
        for interval in (0.002, 1 / RATE)
    )
    assert len(coarse.switches) > 4
    assert departure(coarse, exact, of=("u",))["u"] < 1e-4


PUSH = """
[[simulation.disturbance]]
kind = "impulse"
input = "torque"
size = 0.02
start = 3.1234
duration = 0.05
"""


def pushed():
    """A result with an impulse of 50 ms that begins and ends between rows."""
    found = result("b0.8")
    simulation = run(found.controller, disturbance=(Impulse("torque", 0.02, 3.1234, 0.05),))
    return replace(found, run=parse_run(found.run.text + PUSH), simulation=simulation)


def test_nothing_is_interpolated_across_a_push():
    found = pushed()
    exact = run(found.controller, 1 / RATE, disturbance=(Impulse("torque", 0.02, 3.1234, 0.05),))
    unknown = replace(found.simulation, edges=np.zeros(0), leads=np.zeros((0, 0)))
    blind = departure(unknown, exact, found.controller, of=("x",))["x"]
    series = found.to_series(RATE)
    rows = np.searchsorted(exact.t, series.t - 1e-9)
    error = np.abs(series.values[:, :2] - exact.x[rows]).max() / np.abs(exact.x).max()
    assert error < 1e-8 < 1e-4 < blind


def test_rows_are_given_as_they_are():
    found = result("three-link")
    series = found.to_series()
    simulation = found.simulation
    assert series.t is simulation.t
    np.testing.assert_array_equal(series["x.ankle"], simulation.x[:, 0])
    np.testing.assert_array_equal(series["y.trunk"], simulation.y[:, 2])
    np.testing.assert_array_equal(series["u.hip_torque"], simulation.u[:, 2])
    np.testing.assert_array_equal(series["x_h.knee_rate"], simulation.x_h[:, 4])
    np.testing.assert_array_equal(series["E"], simulation.E)
    assert series.units[series.place("x.ankle")] == "rad"
    assert series.units[series.place("u.ankle_torque")] == "N m"
    assert series.facts["case"] == "three-link"
    count = series["interval"]
    events = np.searchsorted(series.t, simulation.events.t)
    assert count[0] == 0
    np.testing.assert_array_equal(count[events], np.arange(len(events)))
    np.testing.assert_array_equal(count[events + 1], np.arange(len(events)) + 1)


def test_events_are_a_series_of_their_own():
    found = result("b0.8")
    events, series = found.simulation.events, found.events_to_series()
    np.testing.assert_array_equal(series.t, events.t)
    np.testing.assert_array_equal(series["interval"], events.interval)
    np.testing.assert_array_equal(series["x_h.hinge"], events.x_h[:, 0])
    np.testing.assert_array_equal(series["y_min.angle"], events.y_min[:, 0])
    assert len(found.continuous.events_to_series()) == 0


def test_names_that_are_not_known_are_numbers():
    bare = replace(result("b0.8").simulation, labels=type(result("b0.8").simulation.labels)())
    assert bare.to_series().names == ("x.0", "x.1", "y.0", "u.0", "x_o.0", "x_o.1", "x_h.0", "x_h.1", "E", "interval")


def test_a_rate_that_is_none_is_refused():
    for rate in (0.0, -1.0, np.nan, 1e12):
        with pytest.raises(DataError, match="Hz"):
            result("b0.8").to_series(rate)


def test_python_control_gets_a_response_that_it_can_plot():
    from matplotlib.figure import Figure

    found = result("three-link")
    response = found.simulation.to_timeresponse()
    np.testing.assert_array_equal(response.outputs, found.simulation.y.T)
    np.testing.assert_array_equal(response.inputs, found.simulation.u.T)
    np.testing.assert_array_equal(response.states, found.simulation.x.T)
    assert list(response.output_labels) == ["shank", "thigh", "trunk"]
    figure = Figure()
    axes = figure.subplots(6, 1)
    response.plot(ax=axes[:, None])
    assert [item.get_lines()[0].get_xydata().shape[0] for item in axes] == [len(response.time)] * 6


def test_pandas_gets_the_rows_of_a_run():
    pytest.importorskip("pandas")
    frame = result("b0.8").simulation.to_pandas()
    assert frame.loc[0.0, "x.hinge"] == 0.02
    assert frame.attrs["units"]["u.torque"] == ""


def test_xarray_gets_the_rows_of_a_run_and_its_events(tmp_path):
    xarray = pytest.importorskip("xarray")
    found = result("three-link")
    rows, events = found.to_xarray(), found.events_to_series().to_xarray(along="event")
    assert dict(rows.sizes) == {"t": len(found.simulation.t), "state": 6, "output": 3, "input": 3, "assumed_state": 6}
    np.testing.assert_array_equal(rows["x_o"], found.simulation.x_o)
    np.testing.assert_array_equal(rows["y"].sel(output="trunk"), found.simulation.y[:, 2])
    assert rows.attrs["case"] == found.run.case.name
    assert events["y_max"].dims == ("event", "output")
    np.testing.assert_array_equal(events["interval"], found.simulation.events.interval)
    np.testing.assert_array_equal(found.simulation.to_xarray()["u"], found.simulation.u)
    rows.to_netcdf(tmp_path / "run.nc", engine="scipy")
    with xarray.open_dataset(tmp_path / "run.nc", engine="scipy") as again:
        xarray.testing.assert_identical(again.load().sortby("t"), rows)
