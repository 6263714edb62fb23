"""From run file to prediction: the notes' numbers for every shipped case, and errors that name the run file."""

import numpy as np
import pytest

from icmj.case.case import prepare, simulate
from icmj.controller.trigger import ClockTrigger, Continuous
from icmj.errors import DesignError, RunFileError
from icmj.runfile.reading import load_run, parse_run

NOTES = {  # Δ_crit [s], eigenvalue, cycle predicted (notes, sections 2, 4 and 5)
    "simple-0.8": (1.807, 1, True),
    "simple-1.2": (1.528, -1, True),
    "simple-1.7": (1.112, -1, False),
    "three-link-0.9": (0.7594, 1, True),
    "three-link-1.1": (0.7351, -1, True),
    "neglected-0.1": (3.593, 1, True),
    "neglected-0.5": (2.169, 1, True),
    "simple-exact": (None, None, False),
}


@pytest.mark.parametrize("name", NOTES)
def test_prediction_is_that_of_the_notes(root, name):
    delta_crit, eigenvalue, cycle = NOTES[name]
    prediction = prepare(load_run(root / "runs" / f"{name}.toml")).prediction
    assert prediction.cycle is cycle
    if delta_crit is None:
        assert prediction.delta_crit is None
        assert prediction.eigenvalue is None
        assert prediction.period is None
        return
    digits = len(str(delta_crit).split(".")[1])
    assert round(prediction.delta_crit, digits) == delta_crit
    assert prediction.eigenvalue == pytest.approx(eigenvalue, abs=1e-9)
    if cycle:
        assert prediction.period == pytest.approx(prediction.delta_crit * (1 if eigenvalue == 1 else 2))


def test_exact_model_means_equal_plants(root):
    case = prepare(load_run(root / "runs" / "simple-exact.toml"))
    np.testing.assert_array_equal(case.assumed.linearisation.plant.A, case.actual.linearisation.plant.A)


def test_one_case_runs_on_both_plants_under_any_trigger(root):
    case = prepare(load_run(root / "runs" / "simple-0.8.toml"))
    for plant in ("linear", "mujoco"):
        for trigger, control in ((None, "event"), (ClockTrigger(0.5), "clock"), (Continuous(), "continuous")):
            run = simulate(case, plant, trigger=trigger, duration=3.0)
            assert (run.plant, run.control, run.outcome.kind) == (plant, control, "completed")
            assert run.t[-1] == pytest.approx(3.0)
            assert run.x[0, 0] == pytest.approx(0.02)
    assert len(run.events) == 0


def test_refinement_divides_the_timestep(root):
    case = prepare(load_run(root / "runs" / "simple-0.8.toml"))
    assert simulate(case, duration=0.5, refinement=0.5).precision["timestep"] == 0.0025


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("{ hinge = 0.02 }", "{ hip = 0.02 }", "simulation.initial: no 'hip' in the model; expected one of hinge"),
        (
            "[study]",
            '[[simulation.disturbance]]\nkind = "step"\ninput = "x"\nsize = 1.0\n[study]',
            "no 'x' in the model",
        ),
        (
            "[study]",
            '[[simulation.disturbance]]\nkind = "noise"\noutput = "torque"\nsize = 1.0\ncorner = 1\nseed = 1\n[study]',
            "simulation.disturbance: no 'torque' in the model; expected one of angle",
        ),
    ],
)
def test_names_the_model_does_not_have_are_refused_first(root, old, new, words):
    path = root / "runs" / "simple-0.8.toml"
    with pytest.raises(RunFileError, match=words) as caught:
        prepare(parse_run(path.read_text(encoding="utf-8").replace(old, new), path))
    assert "simple-0.8.toml" in str(caught.value)


def test_a_design_error_names_the_run_file(root):
    path = root / "runs" / "simple-0.8.toml"
    text = path.read_text(encoding="utf-8").replace('Q_c = "output"', "Q_c = [1.0, 1.0, 1.0]")
    with pytest.raises(DesignError, match=r"simple-0.8.toml: weight Q_c"):
        prepare(parse_run(text, path))


def test_exact_model_in_mujoco_has_an_interval_that_grows_with_the_logarithm_of_the_threshold(root):
    """The plant's departure from its linear model is cubic: the hold error starts at q_t³ and grows as e^Δ to q_t,
    so the interval grows by 2 ln 10 for each decade, without bound."""
    path = root / "runs" / "simple-exact.toml"
    text = path.read_text(encoding="utf-8").replace("duration = 60.0", "duration = 90.0")
    intervals = []
    for q_t in (1e-2, 1e-3):
        changed = text.replace("q_t = 0.01 ", f"q_t = {q_t} ").replace("hinge = 0.02", f"hinge = {2 * q_t}")
        run = simulate(prepare(parse_run(changed, path)), "mujoco")
        intervals.append(run.events.interval[-1])
    assert intervals[1] - intervals[0] == pytest.approx(2 * np.log(10), rel=2e-3)
