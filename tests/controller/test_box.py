"""A second event rule, proved as the first one is: orbit, admissibility, multipliers and events by brute force."""

from pathlib import Path

import engine_cases
import numpy as np
import pytest
from linear_cases import loop_matrix
from scipy.linalg import expm
from scipy.optimize import brentq
from theory_cases import assert_multipliers_agree, random_systems, shipped, started_beside

import icmj
from icmj import Controller, Design, EventTrigger, LinearPlant, Settings, predict, system_matched
from icmj.engine.run import simulate as simulate_engine
from icmj.errors import AnalysisError, RunFileError
from icmj.linear.run import simulate as simulate_linear
from icmj.theory.error_system import ErrorSystem

BoxTrigger = icmj.BoxTrigger


def errors(design: Design, rule: BoxTrigger, e: np.ndarray) -> np.ndarray:
    """|e_i|/threshold_i, written down from the rule's words; last axis."""
    watched = e @ design.plant.C.T if rule.on == "output" else e
    return np.abs(watched) / rule.threshold


def random_box(system: ErrorSystem, seed: int, spread: float) -> BoxTrigger:
    random = np.random.default_rng(seed)
    on = ("output", "state")[seed % 2]
    size = system.actual.n_y if on == "output" else system.n_hat
    return BoxTrigger(0.01 * 10 ** random.uniform(-spread, spread, size), on, 1e-4)


def flight(system: ErrorSystem, rule: BoxTrigger, z: np.ndarray, longest: float, points: int = 4000):
    """(interval, state before the reset) from (x, x_o) on, by a fine grid and bisection, from the paper's equations."""
    controller = Controller(system.design, system_matched(system.design), rule)
    M, n, m = loop_matrix(system.actual, controller), system.n, system.n_hat
    state, h = expm(M * rule.delta_min) @ np.concatenate([z, z[n:]]), longest / points
    one = expm(M * h)

    def excess(s: np.ndarray) -> float:
        return float(errors(system.design, rule, s[n + m :] - s[n : n + m]).max() - 1)

    if excess(state) >= 0:
        return rule.delta_min, state
    for i in range(points):
        after = one @ state
        if excess(after) >= 0:
            tau = brentq(lambda s, state=state: excess(expm(M * s) @ state), 0.0, h, xtol=1e-15, rtol=1e-14)
            return rule.delta_min + i * h + tau, expm(M * tau) @ state
        state = after
    return None


def level_of(system: ErrorSystem, rule: BoxTrigger):
    """The component of a hold error that is nearest to its threshold, relative to it."""
    rows = system.design.plant.C if rule.on == "output" else np.eye(system.n_hat)

    def level(e: np.ndarray) -> complex:
        relative = rows @ e / rule.threshold
        i = np.abs(relative.real).argmax()
        return relative[i] * np.sign(relative[i].real)

    return level


def predictions(seed: int, count: int, verdicts: tuple[str, ...], spread: float = 0.5):
    """Random systems with a box whose orbit is one of ``verdicts``."""
    found = 0
    for i, system in enumerate(random_systems(seed, 1000)):
        rule = random_box(system, i, spread)
        prediction = predict(system, rule, delta_max=2.0)
        if prediction.verdict in verdicts and prediction.orbit is not None:
            yield i, system, rule, prediction
            found += 1
            if found == count:
                return
    raise AssertionError(f"only {found} orbits found")


# --- the rule itself -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("on", ["output", "state"])
def test_e_is_the_largest_component_against_its_threshold(on: str) -> None:
    plant = LinearPlant(np.zeros((3, 3)), np.ones((3, 1)), [[1, 2, 0], [0, 0, 3]])
    design = Design(plant, np.zeros((1, 3)), np.zeros((3, 2)))
    rule = BoxTrigger([0.1, 0.02] if on == "output" else [0.1, 0.02, 0.3], on)
    e = np.random.default_rng(0).standard_normal((20, 3))
    expected = errors(design, rule, e).max(axis=1) ** 2 - 1
    np.testing.assert_allclose(rule.faces(design).E(e), expected, rtol=1e-12)


def test_one_output_is_the_paper_s_rule() -> None:
    system = shipped("b=0.8")
    C = system.design.plant.C
    box, paper = (predict(system, rule) for rule in (BoxTrigger(0.01), EventTrigger(C.T @ C, 0.01)))
    assert box.verdict == paper.verdict == "attracting"
    assert box.gamma == pytest.approx(paper.gamma, rel=1e-12)
    np.testing.assert_allclose(box.multipliers, paper.multipliers, atol=1e-10)


def test_what_is_no_box_is_refused_and_resizing_keeps_the_shape() -> None:
    for bad in ([0.1, -0.1], [], 0.0, [np.nan], [[0.1]]):
        with pytest.raises(AnalysisError, match="positive"):
            BoxTrigger(bad)
    with pytest.raises(AnalysisError, match="'output' or the 'state'"):
        BoxTrigger(0.1, "input")
    with pytest.raises(AnalysisError, match="delta_min"):
        BoxTrigger(0.1, delta_min=-1.0)
    with pytest.raises(AnalysisError, match="2 thresholds for 1 outputs"):
        BoxTrigger([0.1, 0.2]).faces(shipped("b=0.8").design)
    rule = BoxTrigger([0.1, 0.4], delta_min=0.2).resized(0.04)
    np.testing.assert_allclose(rule.threshold, [0.01, 0.04])
    assert (rule.size, rule.delta_min) == (0.04, 0.2)


# --- theory ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", ["b=0.9 three-link", "b=1.1 three-link", "b=1.7", "zeta=0.1"])
@pytest.mark.parametrize("on", ["output", "state"])
def test_shipped_cases_agree_with_finite_differences(case: str, on: str) -> None:
    system = shipped(case)
    size = system.actual.n_y if on == "output" else system.n_hat
    rule = BoxTrigger(0.01 * np.linspace(0.7, 1.5, size), on)
    prediction = predict(system, rule, delta_max=4.0)
    assert prediction.orbit is not None
    if prediction.orbit.admissible:
        assert_multipliers_agree(system, rule, prediction, level_of(system, rule))
    else:
        assert on == "state"


@pytest.mark.slow
def test_random_plants_agree_with_finite_differences() -> None:
    faces = set()
    for _, system, rule, prediction in predictions(99, 40, ("attracting", "repelling")):
        assert_multipliers_agree(system, rule, prediction, level_of(system, rule))
        faces.add(rule.faces(system.design).active(prediction.orbit.e_hp[-1]))
    assert len(faces) > 1  # not always the same face


@pytest.mark.slow
def test_admissibility_agrees_with_a_fine_grid() -> None:
    said = []
    for _, system, rule, prediction in predictions(17, 150, ("attracting", "repelling", "not admissible"), 2.0):
        orbit = prediction.orbit
        if not np.isfinite(orbit.gamma):
            continue
        one, X, highest = expm(system.A_C * orbit.delta / 4000), orbit.X[0], []
        for _ in range(4000):
            highest.append(errors(system.design, rule, system.T_t @ X).max() - 1)
            X = one @ X
        inside = np.array(highest)[int(np.ceil(4000 * rule.delta_min / orbit.delta)) : -40]
        if (inside >= 0).any():
            assert not orbit.admissible
        elif inside.max() < -1e-4 and np.diff(highest[-40:]).min() > 0:
            assert orbit.admissible, orbit.reason
        said.append(orbit.admissible)
    assert sum(said) > 5
    assert len(said) - sum(said) >= 5


@pytest.mark.slow
def test_orbits_attract_or_repel_as_their_multipliers_say() -> None:
    clear = 0
    for i, system, rule, prediction in predictions(2024, 60, ("attracting", "repelling")):
        largest = np.abs(prediction.multipliers).max()
        if 0.9 <= largest <= 1.1:
            continue
        assert started_beside(system, rule, prediction, i)[1] == (largest < 1)
        clear += 1
    assert clear >= 40


# --- both plants -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("on", ["output", "state"])
def test_linear_events_are_those_of_brute_force(on: str) -> None:
    system = shipped("b=0.9 three-link")
    size = 3 if on == "output" else 6
    rule = BoxTrigger(0.01 * np.linspace(0.7, 1.5, size), on, 0.01)
    controller = Controller(system.design, system_matched(system.design), rule)
    x = 0.01 * np.array([1.0, -0.5, 0.3, 2.0, 1.0, -3.0])
    run = simulate_linear(system.actual, controller, Settings(duration=6.0, limit=1e6), x0=x)
    assert len(run.events) >= 6
    z = np.concatenate([x, np.zeros(6)])
    for i in range(len(run.events)):
        delta, state = flight(system, rule, z, 3.0)
        assert run.events.interval[i] == pytest.approx(delta, abs=1e-9)
        z = np.concatenate([run.events.x[i], run.events.x_o[i]])
        np.testing.assert_allclose(z, state[:12], atol=1e-8)


def test_engine_agrees_with_the_linear_plant_at_small_sway() -> None:
    body, control = engine_cases.plant("three_link", 0.9), engine_cases.controller("three_link")
    rule = BoxTrigger(1e-4 * np.array([0.7, 1.0, 1.5]), delta_min=0.01)
    control = control.triggered_by(rule)
    settings = Settings(duration=3.0, timestep=2e-3)
    x0 = 1e-4 * np.array([1.0, -0.5, 0.3, 2.0, 1.0, -3.0])
    engine = simulate_engine(body, control, settings, x0=x0)
    linear = simulate_linear(body.linearisation.plant, control, settings, x0=x0)
    assert len(engine.events) == len(linear.events) >= 3
    np.testing.assert_allclose(engine.events.t, linear.events.t, atol=1e-6)
    reached = errors(control.design, rule, engine.events.x_h - engine.events.x_o).max(axis=1)
    late = engine.events.interval > 0.0101
    np.testing.assert_allclose(reached[late], 1.0, atol=1e-10)


def test_an_event_that_one_face_reaches_within_a_step_is_found() -> None:
    """The swing of the pendulum's hold error: a coarse step sees neither face above its threshold at its ends."""
    body = engine_cases.plant("pendulum", 0.8)
    swing, hidden = np.array([0.05, -0.08]), 0
    free = engine_cases.controller("pendulum").triggered_by(BoxTrigger([1e3, 1e3], "state"))
    fine = simulate_engine(body, free, Settings(duration=0.8, timestep=1e-4, record_interval=1e-6), x0=swing)
    e = np.abs((fine.x_h - fine.x_o)[:, 0])
    top = int(np.argmax((e[1:-1] > e[:-2]) & (e[1:-1] > e[2:]))) + 1
    for timestep in (0.0100, 0.0103, 0.0107, 0.0111, 0.0117, 0.0120):
        threshold = e[top] * (1 - 1e-5)
        settings = Settings(duration=fine.t[top] + 0.1, timestep=timestep, record_interval=1e-6)
        coarse = simulate_engine(body, free, settings, x0=swing)
        hidden += not (np.abs((coarse.x_h - coarse.x_o)[:, 0]) >= threshold).any()
        control = free.triggered_by(BoxTrigger([threshold, 1e3], "state"))
        run = simulate_engine(body, control, Settings(duration=fine.t[top] + 0.1, timestep=timestep), x0=swing)
        assert len(run.events) >= 1
        assert abs(run.events.t[0] - fine.t[top]) < 0.02
    assert hidden >= 3


# --- from run file to report -----------------------------------------------------------------------------------------

KEYS = 'rule = "box"\non = "output"\nthreshold = [0.008, 0.01, 0.02]'


def boxed(root: Path) -> str:
    lines = (root / "runs" / "three-link-0.9.toml").read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not line.startswith(("Q_t", "q_t", "law_q_t", "attractor_starts"))]
    kept.insert(kept.index("[controller]") + 1, KEYS)
    return "\n".join(kept).replace('"three-link-0.9"', '"boxed"').replace("../models", str(root / "models"))


@pytest.mark.slow
def test_from_run_file_to_report_on_both_plants(root: Path, tmp_path: Path) -> None:
    path = tmp_path / "boxed.toml"
    path.write_text(boxed(root) + "\nlaw_q_t = [1e-2, 1e-3]\n", encoding="utf-8")
    outputs = icmj.run_study([icmj.load_run(path)], tmp_path / "out", jobs=2)
    linear, mujoco = outputs.page.comparisons
    assert linear.predicted.cycle
    assert linear.measured.converged
    assert abs(linear.relative_error.interval) < 1e-9
    assert abs(linear.relative_error.gamma) < 1e-9
    assert mujoco.measured.converged
    assert abs(mujoco.relative_error.interval) < 1e-3
    result = icmj.read_log(outputs.logs[1])
    np.testing.assert_array_equal(result.controller.trigger.threshold, [0.008, 0.01, 0.02])
    assert result.law is not None
    assert result.law.interval_slope == pytest.approx(2.0, abs=0.05)
    page = outputs.report.read_text(encoding="utf-8")
    assert "threshold" in page
    assert "0.008" in page


@pytest.mark.parametrize(("old", "new", "words"), [
    ("threshold = [0.008, 0.01, 0.02]", "threshold = [0.008, 0.0, 0.02]", "threshold"),
    ("threshold = [0.008, 0.01, 0.02]", "", "threshold"),
    ('rule = "box"', 'rule = "circle"', "rule"),
    ('on = "output"', 'on = "output"\nq_t = 0.1', "q_t"),
    ('rule = "box"\non = "output"', "q_t = 0.1", "threshold"),
])  # fmt: skip
def test_keys_that_do_not_fit_are_one_line_errors(root: Path, old: str, new: str, words: str) -> None:
    with pytest.raises(RunFileError, match=words):
        icmj.parse_run(boxed(root).replace(old, new))


def test_thresholds_that_do_not_fit_the_model_are_named(root: Path, tmp_path: Path) -> None:
    text = boxed(root).replace("threshold = [0.008, 0.01, 0.02]", "threshold = [0.008, 0.01]")
    with pytest.raises(icmj.IcmjError, match="2 thresholds for 3 outputs"):
        icmj.prepare(icmj.parse_run(text, tmp_path / "boxed.toml"))
