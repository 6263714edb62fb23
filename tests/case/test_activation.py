"""Muscles from a run file: known and unknown ones, on both plants, by matrices, in logs, sweeps and branches."""

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import icmj
from icmj.case.case import Case, prepare
from icmj.cycle.parameter import find_parameter
from icmj.errors import CycleError, ModelError, RunFileError
from icmj.runfile.schema import overridden
from icmj.runfile.sweep_tables import SweepFile

SHORT = {"simulation.duration": 3.0, "study.growth_points": 0, "study.law_q_t": [], "study.attractor_starts": 0}
KNOWN = {"order": 2, "frequency": 16.8, "damping_ratio": 0.99}
UNKNOWN = {"order": 1, "time_constant": 0.03}
CHAIN = """
case = { name = "chain", title = "Chain" }
controller = { q_t = 0.01 }
simulation = { duration = 1.0, initial = { x0 = 0.01 } }
assumed = { A = [[0, 1], [2, 0]], B = [[0, 0], [1, 1]], C = [[1, 0]], inputs = ["a", "b"], units = {a = "N m"}, GIVEN }
actual = { ACTUAL }
"""


def shipped(root: Path, name: str = "three-link-0.9", **changes: object) -> icmj.RunFile:
    return icmj.load_run(root / "runs" / f"{name}.toml").with_(**{**SHORT, **changes})


def chain(assumed: str = "", actual: str = "") -> Case:
    text = CHAIN.replace(", GIVEN", f", {assumed}" if assumed else "").replace("ACTUAL", actual)
    return prepare(icmj.parse_run(text))


def clocked(case: Case, delta: float) -> np.ndarray:
    """(x, x_o) from one event of a clock to the next: the loop with the lag's rows by hand, exponentiated."""
    gains, b, tau = case.controller.design, case.run.actual.gain, UNKNOWN["time_constant"]
    A, B, C = gains.plant.A, gains.plant.B, gains.plant.C
    k, L, (n, n_u) = gains.k, gains.L, B.shape
    none, one = np.zeros, np.eye(n_u)
    F = np.block([
        [A, B, none((n, 2 * n))],
        [none((n_u, n)), -one / tau, none((n_u, n)), -b * k / tau],
        [L @ C, none((n, n_u)), A - L @ C, -B @ k],
        [none((n, n)), none((n, n_u)), none((n, n)), A - B @ k],
    ])  # fmt: skip
    taken_up = np.vstack([np.eye(2 * n + n_u), np.eye(n, 2 * n + n_u, n + n_u)])
    return np.asarray((expm(F * delta) @ taken_up)[:-n])


@pytest.mark.parametrize(("name", "moved"), [("simple-0.8", 0.05), ("simple-1.2", 0.05), ("three-link-0.9", 0.05)])
def test_muscles_unknown_to_the_controller_move_the_critical_interval(root, name, moved):
    case = prepare(shipped(root, name, **{"actual.activation": UNKNOWN}))
    before = prepare(shipped(root, name)).prediction
    found, sign = case.prediction.delta_crit, case.prediction.eigenvalue.real
    assert case.system.actual.n > case.system.design.plant.n
    assert abs(found - before.delta_crit) > moved * before.delta_crit

    def off(delta: float) -> float:
        M = clocked(case, delta)
        return float(np.linalg.det(M - sign * np.eye(len(M))))

    assert brentq(off, 0.99 * found, 1.01 * found, xtol=1e-13) == pytest.approx(found, abs=1e-8)


def test_muscles_known_to_the_controller_are_those_of_the_actual_plant(root):
    case = prepare(shipped(root, **{"assumed.activation": KNOWN, "controller.q_t": 1e-3}))
    names = [f"{joint}_torque_act{i}" for joint in ("ankle", "knee", "hip") for i in (0, 1)]
    for plant in (case.assumed, case.actual):
        assert list(plant.linearisation.plant.states[6:]) == names
    assert case.system.T_hat.tolist() == np.eye(12).tolist()
    other = prepare(shipped(root, **{"assumed.activation": KNOWN, "actual.activation": UNKNOWN}))
    assert (other.system.n_hat, other.system.n) == (12, 9)
    none = prepare(shipped(root, **{"assumed.activation": KNOWN, "actual.activation": {"order": 0}}))
    assert (none.system.n_hat, none.system.n) == (12, 6)
    # an exact model, at a motion that is small: both plants do the same
    linear, engine = (icmj.simulate(case, plant) for plant in ("linear", "mujoco"))
    assert engine.events.t[:3] == pytest.approx(linear.events.t[:3], rel=1e-3)


def test_matrices_and_models_have_the_same_muscles(root, tmp_path):
    run = shipped(root, "simple-0.8", **{"assumed.activation": KNOWN, "actual.activation": UNKNOWN})
    model = prepare(run)
    by_model = model.actual.linearisation.plant
    A, B, C = (np.array(m).tolist() for m in ([[0, 1], [1, 0]], [[0], [1]], [[1, 0]]))
    text = f"""
case = {{ name = "a", title = "A" }}
controller = {{ q_t = 0.01 }}
[assumed]
A = {A}
B = {B}
C = {C}
states = ["hinge", "hinge_rate"]
inputs = ["torque"]
outputs = ["angle"]
units = {{ torque = "N m" }}
activation = {{ order = 2, frequency = 16.8, damping_ratio = 0.99 }}
[actual]
gain = 0.8
activation = {{ order = 1, time_constant = 0.03 }}
[design]
R_c = 0.1
R_o = 0.01
[simulation]
initial = {{ hinge = 0.02, torque_act = 0.1 }}
"""
    case = prepare(icmj.parse_run(text))
    given = case.actual.linearisation.plant
    assert given.states == by_model.states
    assert given.state_units[2:] == by_model.state_units[2:] == ("N m",)
    for name in ("A", "B", "C", "B_d"):
        assert getattr(given, name) == pytest.approx(getattr(by_model, name), abs=1e-8), name
    assert case.prediction.delta_crit == pytest.approx(model.prediction.delta_crit, rel=1e-7)


def test_what_is_wrong_with_matrices_is_mixed_and_named_without_the_lag():
    case = chain(
        'activation = { order = 2, time_constant = { a = 0.1 } }',
        "A = [[0, 1], [3, 0]], B = [[0, 0], [1, 1]], C = [[1, 0]], rho = 0.5, gain = [2.0, 1.0]",
    )  # fmt: skip
    plant = case.actual.linearisation.plant
    assert plant.states == ("x0", "x1", "a_act0", "a_act1")
    assert plant.state_units[2:] == ("N m/s", "N m")
    assert plant.A[:2].tolist() == [[0, 1, 0, 0], [2.5, 0, 0, 1]]
    assert plant.B.ravel() == pytest.approx([0, 0, 0, 1, 150, 0, 0, 0])  # half of the gain's error: ρ
    assert plant.B_d.tolist() == [[0, 0], [1, 1], [0, 0], [0, 0]]
    assert chain(actual="activation = { order = 1, time_constant = 0.1 }").actual.linearisation.plant.n == 4


@pytest.mark.parametrize("table", ["assumed", "actual"])
def test_names_that_the_plant_has_not_are_refused_in_one_line(root, table):
    with pytest.raises(ModelError) as caught:
        prepare(shipped(root, **{f"{table}.activation": {"order": 1, "time_constant": {"hip": 0.1}}}))
    assert "three_link.xml: activation: no input 'hip'; there are ankle_torque, " in str(caught.value)


def test_so_are_those_of_matrices_and_a_model_that_has_dynamics(root):
    for table in ("assumed", "actual"):
        given = {table: "activation = { order = 1, time_constant = { c = 0.1 } }"}
        with pytest.raises(RunFileError, match=f"{table}: activation: no input 'c'; there are a, b"):
            chain(**given)
    with pytest.raises(ModelError, match="activation: input 'torque' has dynamics of its own"):
        prepare(shipped(root, "neglected-0.1", **{"assumed.activation": UNKNOWN}))


def test_a_start_a_sweep_a_branch_and_the_command_line_reach_it(root):
    run = shipped(root, **{"actual.activation": UNKNOWN, "simulation.initial": {"hip_torque_act": 2.0}})
    start = icmj.simulate(prepare(run), "linear").x[0]
    assert start.tolist() == [*[0] * 8, 2]
    assert overridden(run, ["actual.activation.time_constant=0.05"]).actual.activation.time_constant == 0.05
    vary = {"field": "actual.activation.time_constant", "values": [0.1]}
    sweep = {"sweep": {"name": "s", "run": "x"}, "vary": [vary]}
    assert SweepFile.validated(sweep, Path("s.toml"), base=run).vary[0].column == "time_constant"
    of = find_parameter("actual.activation.time_constant")
    assert of.value(run) == 0.03
    assert of.put(run, 0.04).actual_activation.time_constant == 0.04
    with pytest.raises(CycleError, match="has no key 'assumed"):
        find_parameter("assumed.activation.time_constant").value(run)
    branch = icmj.follow(run, "actual.activation.time_constant", 0.031, plant="linear", points=2)
    assert branch.value[-1] == pytest.approx(0.031)
    assert branch.intervals[-1, 0] == pytest.approx(prepare(of.put(run, 0.031)).prediction.delta_crit, rel=1e-9)


def test_it_is_logged_and_read(root, tmp_path):
    run = shipped(root, **{"actual.activation": KNOWN, "simulation.duration": 1.0})
    result = icmj.run_case(run, "mujoco")
    icmj.write_log(result, tmp_path / "muscles.rrd")
    back = icmj.read_log(tmp_path / "muscles.rrd")
    np.testing.assert_array_equal(back.simulation.x, result.simulation.x)
    assert back.actual.states[6:8] == ("ankle_torque_act0", "ankle_torque_act1")
    assert back.actual.state_units[6:8] == ("N m/s", "N m")
    # the activation is what the lag makes of the command that acts
    simulation = result.simulation
    rate, a, u = simulation.x[:, 6], simulation.x[:, 7], 0.9 * simulation.applied[:, 0]
    h = simulation.t[1]
    clear = np.abs(simulation.t[:, None] - simulation.events.t).min(axis=1) > 2.1 * h
    even = np.flatnonzero(clear[2:-2] & (np.abs(simulation.t[4:] - simulation.t[:-4] - 4 * h) < 1e-9)) + 2
    change = [rate[even + i] - rate[even - i] for i in (1, 2)]
    slope = (8 * change[0] - change[1]) / (12 * h)
    expected = 16.8**2 * (u - a) - 2 * 0.99 * 16.8 * rate
    assert len(even) > 30
    assert slope == pytest.approx(expected[even], abs=1e-3 * np.abs(slope).max())
