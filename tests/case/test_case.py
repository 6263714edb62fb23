"""From run file to prediction: the notes' numbers for every shipped case, and errors that name the run file."""

from dataclasses import replace

import numpy as np
import pytest
from model_cases import MOTOR, pendulum, two, written

from icmj import ClockTrigger, Continuous, build_report, load_run, parse_run, prepare, run_case, simulate
from icmj.errors import DesignError, ModelError, RunFileError

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


NOISY = [{"kind": "noise", "output": "torque", "size": 1.0, "corner": 1, "seed": 1}]


@pytest.mark.parametrize(("keys", "words"), [
    ({"initial": {"hip": 0.02}}, "simulation.initial names 'hip', which the model lacks; expected one of hinge"),
    ({"disturbance": [{"kind": "step", "input": "x", "size": 1.0}]}, "names 'x', which the model lacks"),
    ({"disturbance": NOISY}, "simulation.disturbance names 'torque', which the model lacks; expected one of angle"),
])  # fmt: skip
def test_names_the_model_does_not_have_are_refused_first(root, keys, words):
    run = load_run(root / "runs" / "simple-0.8.toml")
    with pytest.raises(RunFileError, match=f"simple-0.8.toml.*{words}"):
        prepare(run.with_(**{f"simulation.{key}": value for key, value in keys.items()}))


def test_a_design_error_names_the_run_file(root):
    run = load_run(root / "runs" / "simple-0.8.toml").with_(**{"design.Q_c": [1.0, 1.0, 1.0]})
    with pytest.raises(DesignError, match=r"simple-0.8.toml: weight Q_c"):
        prepare(run)


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


FIVE = """
case = {{ name = "brought", title = "Brought along" }}
assumed = {{ model = "{assumed}"{more} }}
actual = {{ {actual} }}
design = {{ R_c = 0.01, R_o = 0.01 }}
controller = {{ q_t = 0.001 }}
"""


def brought(folder, assumed="two.xml", actual="gain = 0.9", more="", extra=""):
    """A run file of five lines for a model that lies in ``folder``."""
    return parse_run(FIVE.format(assumed=assumed, actual=actual, more=more) + extra, folder / "run.toml")


def test_inputs_and_outputs_are_matched_by_name_between_the_models(tmp_path):
    """The same plant with its actuators and sensors in another order is the same plant."""
    two(tmp_path), two(tmp_path, -1, "turned.xml")
    same, turned = (prepare(brought(tmp_path, actual=a)) for a in ("gain = 0.9", 'model = "turned.xml", gain = 0.9'))
    assert turned.prediction.delta_crit == same.prediction.delta_crit
    assert turned.actual.linearisation.plant.outputs == ("place", "angle")


def test_ports_of_other_names_take_the_place_of_the_assumed_ones_where_the_run_file_says_so(tmp_path):
    """The same pendulum with its motor and sensor under other names: the same case, from prediction to report."""
    other = pendulum(MOTOR).replace('name="ankle"', 'name="muscle"').replace('name="angle"', 'name="tilt"')
    written(tmp_path, pendulum(MOTOR)), written(tmp_path, other, "other.xml")
    named = 'model = "other.xml", gain = 0.9, inputs = ["muscle"], outputs = ["tilt"]'
    extra = """simulation = { duration = 2.0, initial = { lean = 0.01 } }
    study = { growth_points = 2, attractor_starts = 1 }"""
    both = ("gain = 0.9", named)
    same, renamed = (run_case(brought(tmp_path, "model.xml", actual, extra=extra), "linear") for actual in both)
    assert renamed.actual.inputs == ("muscle",)
    np.testing.assert_array_equal(renamed.simulation.y, same.simulation.y)
    assert renamed.prediction.delta_crit == same.prediction.delta_crit
    build_report([renamed], tmp_path / "report.html")
    with pytest.raises(ModelError, match="no input 'ankle'; it has muscle"):
        prepare(brought(tmp_path, "model.xml", 'model = "other.xml"'))


@pytest.mark.parametrize(("words", "keys"), [
    ("no input 'push'; it has ankle", {"actual": 'model = "other.xml"'}),
    ("x does not matter to any output; drop", {"more": ', outputs = ["angle"]'}),
    (r'assumed: .*free needs operating_point = "balance"', {"more": ', free = ["x"]'}),
])  # fmt: skip
def test_what_models_lack_and_what_a_design_cannot_see_is_named(tmp_path, words, keys):
    two(tmp_path)
    written(tmp_path, pendulum(MOTOR), "other.xml")
    with pytest.raises((DesignError, ModelError, RunFileError), match=words):
        prepare(brought(tmp_path, **keys))


def test_a_model_without_sensors_runs_from_five_lines(tmp_path):
    two(tmp_path, sensors=False)
    case = prepare(brought(tmp_path, more=', inputs = ["push"]'))
    assert [notice.kind for notice in case.notices] == ["outputs"]
    assert not prepare(brought(tmp_path, more=', outputs = "joints", inputs = ["push"]')).notices
    plant = case.actual.linearisation.plant
    assert (plant.inputs, plant.outputs, plant.output_units) == (("push",), ("x", "tilt"), ("m", "rad"))


def test_a_dropped_state_leaves_both_plants_if_nothing_depends_on_it(tmp_path):
    two(tmp_path)
    case = prepare(brought(tmp_path, more=', outputs = ["angle"], drop = ["x"]'))
    assert case.assumed.linearisation.plant.states == ("tilt", "x_rate", "tilt_rate")
    assert case.actual.linearisation.plant.states == ("tilt", "x_rate", "tilt_rate")
    run = simulate(case, "mujoco", duration=2.0)
    assert run.x.shape[1] == 3


def test_changes_by_name_reach_the_actual_plant(tmp_path):
    two(tmp_path)
    extra = '[[actual.change]]\nwhat = "mass"\nof = "pole"\nfactor = 1.2\n'
    text = extra + '[[actual.change]]\nwhat = "damping"\nof = "x"\nvalue = 0.9\n'
    run = brought(tmp_path, actual="", extra="").model_copy()
    run = parse_run(run.text.replace("actual = {  }\n", "") + text, run.path)
    model = prepare(run).actual.spec.compile()
    assert model.body("pole").mass[0] == pytest.approx(1.2)
    assert model.body("pole").inertia == pytest.approx([0.024] * 3)
    assert model.dof_damping.ravel()[0] == pytest.approx(0.9)
    with pytest.raises(ModelError, match="no body 'poll' to change; it has cart, pole"):
        prepare(parse_run(run.text.replace('of = "pole"', 'of = "poll"'), run.path))
    with pytest.raises(RunFileError, match=r"actual.change\[0\]: .*either a factor or a value"):
        parse_run(run.text.replace("factor = 1.2\n", ""), run.path)


def test_a_plant_that_moves_by_itself_is_refused_unless_allowed(tmp_path):
    """A lean of 3° without control: what linear theory says of it is about nothing."""
    written(tmp_path, pendulum(MOTOR, key=f'qpos="{np.radians(3)}"'))
    run = brought(tmp_path, "model.xml", more=', keyframe = "stand"')
    with pytest.raises(ModelError, match=r"run.toml: not at rest: lean accelerates by 0.516 rad/s²"):
        prepare(run)
    more = ', keyframe = "stand"'
    allowed = brought(tmp_path, "model.xml", more=more, extra='analysis.allow = ["not at rest"]')
    assert [notice.kind for notice in prepare(allowed).notices] == ["not at rest"]


def test_shipped_cases_need_no_word(root):
    for path in sorted((root / "runs").glob("*.toml")):
        # the drift of a standing person is slow beside a minute, and quiet-standing says so
        said = {notice.kind for notice in prepare(load_run(path)).notices}
        assert said == ({"slow noise"} if path.stem == "quiet-standing" else set()), path


def test_slow_noise_on_three_joints_is_one_notice(root):
    """The first study printed three lines that differed in their numbers alone."""
    (words,) = (notice.words for notice in prepare(load_run(root / "runs" / "quiet-standing.toml")).notices)
    assert words.count("60 s are too short") == words.count("take a longer run") == 1
    assert all(f"on {joint}_torque, whose SD is" in words for joint in ("ankle", "knee", "hip"))


@pytest.mark.parametrize("change", ["", '[[actual.change]]\nwhat = "mass"\nof = "rod"\nfactor = 1.05\n'])
def test_a_lean_held_by_static_control_does_what_is_predicted(tmp_path, change):
    """Whether the gain is wrong or the mass: the actual plant rests by its own control, and departs as predicted."""
    written(tmp_path, pendulum(MOTOR, key=f'qpos="{np.radians(3)}"'))
    text = f"""
case = {{ name = "lean", title = "Lean" }}
assumed = {{ model = "model.xml", keyframe = "stand", operating_point = "static control" }}
design = {{ R_c = 1e-7, R_o = 1e-6 }}
controller = {{ q_t = 2e-4 }}
simulation = {{ duration = 12.0, initial = {{ lean = 4e-4 }} }}
{change or "actual = { gain = 0.9 }"}
"""
    case = prepare(parse_run(text, tmp_path / "run.toml"))
    assert case.notices == ()
    assert case.prediction.verdict == "attracting"
    run = simulate(case, "mujoco")
    assert run.events.interval[-1] == pytest.approx(case.prediction.delta_crit, rel=2e-4)
    torque = -70 * 9.81 * 0.9 * np.sin(np.radians(3))
    assert case.assumed.linearisation.point.ctrl[0] == pytest.approx(torque)
    assert case.actual.linearisation.point.ctrl[0] == pytest.approx(torque * (1.05 if change else 1))


def test_a_model_without_geoms_is_logged(tmp_path):
    from icmj.log.writer import write_log

    written(tmp_path, pendulum(MOTOR))
    case = brought(tmp_path, "model.xml", extra="simulation = { duration = 1.0 }\nstudy = { growth_points = 0 }")
    write_log(run_case(case, "mujoco"), tmp_path / "log.rrd")


def test_the_assumed_plants_keyframe_is_the_actual_ones_if_it_has_it(tmp_path):
    written(tmp_path, pendulum(MOTOR, key='qpos="0.01" ctrl="-6.18"'))
    written(tmp_path, pendulum(MOTOR, key='qpos="0.01" ctrl="-6.18"'), "same.xml")
    written(tmp_path, pendulum(MOTOR).replace('key name="stand"', 'key name="lie"'), "none.xml")
    allow = 'analysis = { allow = ["not at rest"] }'
    more = ', keyframe = "stand"'
    case = prepare(brought(tmp_path, "model.xml", 'model = "same.xml", gain = 0.9', more, allow))
    assert case.actual.linearisation.point.qpos[0] == 0.01
    case = prepare(brought(tmp_path, "model.xml", 'model = "none.xml", gain = 0.9', more, allow))
    assert case.actual.linearisation.point.qpos[0] == 0
    assert any("no keyframe 'stand'" in notice.words for notice in case.notices)


def test_an_orbit_beyond_the_range_of_an_input_is_told_before_any_run(tmp_path):
    weak = '<motor name="ankle" joint="lean" ctrllimited="true" ctrlrange="-2 2"/>'
    written(tmp_path, pendulum(weak))
    text = FIVE.replace("R_c = 0.01, R_o = 0.01", "R_c = 1e-7, R_o = 1e-6").replace("q_t = 0.001", "q_t = 0.01")
    run = parse_run(text.format(assumed="model.xml", actual="gain = 0.9", more=""), tmp_path / "run.toml")
    (notice,) = prepare(run).notices
    assert notice.kind == "saturation"
    assert "and its ctrlrange leaves 2" in notice.words


@pytest.mark.parametrize("where", ["assumed", "actual"])
def test_an_output_that_jumps_with_the_input_is_refused_before_anything_is_predicted(tmp_path, where):
    jumps = pendulum(MOTOR, sensor='<accelerometer name="acceleration" site="top"/>')
    written(tmp_path, jumps, "jumps.xml")
    extra = "" if where == "assumed" else ', outputs = ["angle"]'
    actual = "gain = 0.9" if where == "assumed" else 'gain = 0.9, outputs = ["acceleration.0"]'
    with pytest.raises(ModelError, match=r"feedthrough: output 'acceleration.0' jumps with the inputs"):
        prepare(brought(tmp_path, "jumps.xml", actual, extra))
    assert prepare(brought(tmp_path, "jumps.xml", more=', outputs = ["angle"]')).notices == ()


def test_a_person_whom_the_actual_plant_follows_is_told_to_be_no_model_error():
    exact = load_run("three-link-0.9").with_(**{"actual.gain": 1.0})
    followed = prepare(exact.with_(**{"assumed.person.mass": 68.0}))
    assert np.array_equal(followed.assumed.linearisation.plant.B, followed.actual.linearisation.plant.B)
    (notice,) = followed.notices
    assert notice.kind == "person"
    assert notice.words.startswith("the actual person follows the assumed one; there is no model error")
    for changes in (
        {"actual.person.mass": 80.0},
        {"actual.gain": 0.9},
        {"actual.change": [{"what": "mass", "of": "trunk", "factor": 1.1}]},
    ):
        case = prepare(exact.with_(**{"assumed.person.mass": 68.0, **changes}))
        assert not np.array_equal(case.assumed.linearisation.plant.B, case.actual.linearisation.plant.B)
        assert "person" not in {one.kind for one in case.notices}
    assert "person" not in {one.kind for one in prepare(exact).notices}


def test_crossings_that_may_be_missing_are_a_notice_which_runs_and_the_report_repeat(root, tmp_path):
    case = prepare(load_run(root / "runs" / "simple-0.8.toml"))
    assert case.notices == ()
    gaps = tuple((0.1 * i, 0.1 * i + 0.01) for i in range(5))
    theory = replace(case.theory, prediction=replace(case.prediction, unresolved=gaps))
    doubted = replace(case, theory=theory)
    (notice,) = doubted.notices
    assert notice.words.startswith("crossings may be missing between 0 and 0.01 s, between 0.1 and 0.11 s")
    assert "and in 2 more places" in notice.words
    result = run_case(doubted, "linear")
    assert any(notice.words in words for words in result.notices)
    build_report([result], tmp_path / "report.html")
    assert "rossings may be missing between 0 and 0.01" in (tmp_path / "report.html").read_text(encoding="utf-8")
