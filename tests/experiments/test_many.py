"""Many runs of one case are what each is alone."""

from dataclasses import replace

import numpy as np
import pytest

import icmj
from icmj.controller.setpoint import step
from icmj.errors import AnalysisError, RunFileError, SimulationError, StudyError
from icmj.series.series import Series


@pytest.fixture(scope="module")
def standing(root):
    run = icmj.load_run(root / "runs" / "quiet-standing.toml")
    return icmj.prepare(run.with_(**{"simulation.duration": 4.0}))


def test_each_run_is_what_it_is_alone(standing):
    batch = icmj.simulate_many(standing, 3, keep=("y", "events", "sway"), jobs=1)
    assert len(batch) == 3
    assert batch.t[-1] == 4.0
    assert len({values.tobytes() for values in batch["y"]}) == 3  # other noise
    for index in range(3):
        run = icmj.simulate(batch.case(index), "linear")
        grid = np.isin(np.round(run.t, 9), np.round(batch.t, 9))
        np.testing.assert_array_equal(run.y[grid], batch["y"][index])
        np.testing.assert_array_equal(run.events.t, batch["events"][index][: len(run.events.t)])
        assert np.isnan(batch["events"][index][len(run.events.t) :]).all()
        assert batch.outcome[index] == run.outcome.kind
        sway = icmj.measure_sway(Series(run.t[grid], run.y[grid], run.labels.outputs))
        assert batch["sway.thigh.rms"][index] == pytest.approx(sway.coordinates[1].rms, rel=1e-12)
        assert batch["sway.trunk.frequency.median"][index] == pytest.approx(sway.coordinates[2].frequencies.median)
    assert "3 runs of quiet-standing" in repr(batch)


def test_noises_of_one_run_differ_and_a_seed_is_a_run(standing):
    batch = icmj.simulate_many(standing, seeds=[5, 0, 5], jobs=1)
    seeds = {source.seed for source in batch.case(0).settings.disturbance}
    assert len(seeds) == len(standing.settings.disturbance)
    np.testing.assert_array_equal(batch["y"][0], batch["y"][2])
    np.testing.assert_array_equal(batch["y"][1], icmj.simulate_many(standing, 1, jobs=1)["y"][0])


def test_numbers_vary_of_the_start_and_of_the_plant(standing):
    quiet = icmj.prepare(standing.run.with_(**{"simulation.disturbance": []}))
    varied = {"simulation.initial.ankle": [0.002, 0.004], "actual.gain": [0.9, 0.85]}
    batch = icmj.simulate_many(quiet, vary=varied, keep=("x",), jobs=1)
    np.testing.assert_array_equal(batch["x"][:, 0, 0], [0.002, 0.004])
    alone = icmj.prepare(quiet.run.with_(**{"simulation.initial.ankle": 0.004, "actual.gain": 0.85}))
    np.testing.assert_array_equal(batch["x"][1, -1], icmj.simulate(alone, "linear").x[-1])


def test_a_function_keeps_what_it_likes_and_what_falls_is_not_a_number(standing):
    keep = lambda run: {"peak": np.abs(run.y).max(axis=0), "count": len(run.events)}  # noqa: E731
    batch = icmj.simulate_many(standing, 2, keep=keep, jobs=1)
    assert batch["peak"].shape == (2, 3)
    assert (batch["count"] >= 5).all()
    fallen = icmj.simulate_many(standing, 2, vary={"simulation.limit": [1.0, 0.0021]}, jobs=1)
    assert fallen.outcome[1] == "fell"
    assert np.isfinite(fallen["y"][0]).all()
    assert np.isnan(fallen["y"][1, -1]).all()


def test_runs_on_the_engine(standing):
    batch = icmj.simulate_many(standing, 1, plant="mujoco", vary={"simulation.duration": [4.0]}, jobs=1)
    np.testing.assert_allclose(batch["y"][0, 0], standing.actual.linearisation.plant.C[:, 0] * 0.002, rtol=1e-4)
    assert np.isfinite(batch["y"]).all()


ON_A_FLOOR = """
case = { name = "floor", title = "On a floor" }
assumed = { model = "models/three_link_floor.xml", drop = ["foot_x"], keyframe = "upright" }
actual = { gain = 0.9 }
design = { R_c = 5e-7, R_o = 2e-7 }
controller = { q_t = 1e-4, delta_min = 0.01 }
simulation = { duration = 1.0, record_interval = 0.0505, initial = { ankle = 0.002 } }
"""


@pytest.mark.slow
@pytest.mark.parametrize("stated", [{}, {"simulation.integrator": "RK4"}], ids=["of the model", "given"])
def test_rows_between_the_ends_of_fixed_steps_are_those_of_a_run_with_a_row_at_each(root, stated):
    """A model that may touch takes its own steps, though nothing states them."""
    case = icmj.prepare(icmj.parse_run(ON_A_FLOOR, root / "run.toml").with_(**stated))
    found = icmj.simulate_many(case, 1, plant="mujoco", keep=("y",), jobs=1)
    step = float(case.actual.model.opt.timestep)
    fine = icmj.simulate(replace(case, settings=replace(case.settings, record_interval=step)), "mujoco")
    expected = np.array([np.interp(found.t, fine.t, of) for of in fine.y.T]).T
    assert np.abs(found["y"][0] - expected).max() < 2e-5 * np.abs(fine.y).max()


@pytest.mark.slow
def test_processes_change_no_bit(standing):
    ways = [icmj.simulate_many(standing, 20, keep=("y", "sway"), jobs=jobs) for jobs in (1, 2)]
    for name, values in ways[0].kept.items():
        np.testing.assert_array_equal(values, ways[1][name])


@pytest.mark.slow
def test_a_function_of_a_script_or_a_notebook_reaches_other_processes(standing):
    """It was "Can't pickle"."""
    scale = 100.0  # cm
    ways = [
        icmj.simulate_many(standing, 20, keep=lambda run: {"far": scale * np.abs(run.y).max()}, jobs=jobs).kept["far"]
        for jobs in (1, 2)
    ]
    np.testing.assert_array_equal(*ways)
    assert np.ptp(ways[0]) > 0


@pytest.mark.parametrize(("words", "asked"), [
    ("seeds has 2", {"n": 3, "seeds": [1, 2]}),
    ("expected some of x, y", {"n": 1, "keep": ("z",)}),
    ("expected some of x, y", {"n": 1, "keep": "y"}),
    ("seeds: -1; expected a whole number from 0", {"seeds": [-1]}),
    ("seeds: nan; expected a whole number", {"seeds": [float("nan")]}),
    ("seeds: 9223372036854775808; expected", {"seeds": [2**63]}),
    ("seeds: 1.5; expected", {"seeds": np.array([1.5])}),
    ("seeds: True; expected", {"seeds": [True]}),
    ("0 runs; give one value for each run", {"n": 0}),
    *((f"n: {n}; expected a whole number", {"n": n}) for n in (2.5, float("nan"), True)),
    ("the function returned None; expected numbers", {"n": 1, "keep": lambda run: None}),
    ("the function returned 3; expected numbers", {"n": 1, "keep": lambda run: 3}),
    ("expected numbers or arrays by name", {"n": 1, "keep": lambda run: {"a": "b"}}),
    ("expected some of x, y", {"n": 1, "keep": None}),
    ("plant 'Linear'; expected one of linear, mujoco", {"n": 1, "plant": "Linear"}),
    ("vary: actual.gain must be a vector", {"vary": {"actual.gain": 1.0}}),
    ("vary: actual.gain must be a vector", {"vary": {"actual.gain": [[1.0], [1.0, 2.0]]}}),
])  # fmt: skip
def test_what_does_not_fit_is_refused(standing, words, asked):
    with pytest.raises(SimulationError, match=words):
        icmj.simulate_many(standing, jobs=1, **asked)


@pytest.mark.parametrize("jobs", [-3, 0, 1.5, True])
def test_so_is_a_number_of_processes_that_is_none(standing, jobs):
    with pytest.raises(StudyError, match=r"jobs: .*; expected a whole number, at least 1"):
        icmj.simulate_many(standing, 20, jobs=jobs)


def test_nothing_but_a_case_is_taken_and_an_unknown_key_is_refused(standing):
    for other in (standing.run, standing.controller, None):
        with pytest.raises(AnalysisError, match="simulate_many takes a Case, got"):
            icmj.simulate_many(other, 1, jobs=1)
    with pytest.raises(RunFileError, match=r"simulation\.initail"):
        icmj.simulate_many(standing, vary={"simulation.initail.ankle": [0.1]}, jobs=1)


def test_a_set_point_is_followed(root):
    """As by one run; without it there are fewer events."""
    lean = [{"kind": "step", "output": "shank", "size": 0.02, "start": 1.0}]
    run = icmj.load_run(root / "runs" / "three-link-0.9.toml").with_(**{"simulation.duration": 10.0, "setpoint": lean})
    case = icmj.prepare(run)
    events = icmj.simulate_many(case, 1, keep=("events",), jobs=1)["events"][0]
    np.testing.assert_array_equal(events, icmj.simulate(case, "linear").events.t)
    bare = icmj.simulate(icmj.prepare(run.with_(setpoint=None)), "linear").events.t
    assert len(bare) < len(events)


@pytest.mark.slow
def test_what_was_replaced_in_a_case_is_in_every_process(standing):
    """A trigger, a set-point and settings that its run file does not say."""
    plant = standing.controller.plant
    moved = icmj.setpoint(plant, [icmj.Target({plant.outputs[0]: 1.0}, step(0.01, 0.5))])
    law = replace(standing.controller.triggered_by(icmj.ClockTrigger(0.3)), setpoint=moved)
    other = replace(standing, controller=law, settings=replace(standing.settings, duration=2.0))
    alone, apart = (icmj.simulate_many(other, 20, keep=("y", "events"), jobs=jobs) for jobs in (1, 2))
    assert alone["events"].shape == (20, 6)
    for name in ("y", "events"):
        np.testing.assert_array_equal(alone[name], apart[name])
    np.testing.assert_array_equal(icmj.simulate(alone.case(7), "linear").events.t, alone["events"][7])
    with pytest.raises(SimulationError, match="settings or trigger of this case are others"):
        icmj.simulate_many(other, vary={"actual.gain": [0.9]}, jobs=1)
