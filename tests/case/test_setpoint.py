"""A set-point from a run file to both plants, log and export."""

from dataclasses import replace

import numpy as np
import pytest
from model_cases import two

import icmj
from icmj import compose_run, load_run, prepare, simulate
from icmj.cli.main import main
from icmj.engine.pose import make_scene
from icmj.errors import AnalysisError, CycleError, LogError, RunFileError
from icmj.log.archive import pack, unpack
from icmj.log.groups import list_groups
from icmj.study.estimate import estimate

SHORT = {"simulation.duration": 2.0, "study.growth_points": 0, "study.law_q_t": [], "study.attractor_starts": 0}
MOVES = [
    {"output": "shank", "kind": "step", "size": 0.01},
    {"output": "shank", "kind": "pulse", "size": 0.01, "start": 0.4, "duration": 0.5},
    {"combination": {"shank": 0.4, "trunk": 0.6}, "name": "mass", "unit": "m", "kind": "ramp", "size": 0.02,
     "start": 0.3, "duration": 1.0},
    {"combination": {"shank": 0.4, "trunk": 0.6}, "name": "mass", "kind": "sines", "size": 0.002,
     "frequencies": [0.7, 1.9], "seed": 3},
    {"output": "thigh", "kind": "ternary", "size": 0.01, "interval": 0.05},
]  # fmt: skip


@pytest.fixture(scope="module")
def case(root):
    run = load_run(root / "runs" / "three-link-0.9.toml").with_(**{"controller.q_t": 1e-3, **SHORT})
    return prepare(run.with_(setpoint=MOVES))


def test_both_plants_follow_it(case):
    linear, engine = (simulate(case, plant) for plant in ("linear", "mujoco"))
    assert len(linear.events) > 3
    np.testing.assert_allclose(engine.events.t[:3], linear.events.t[:3], atol=1e-3)
    for run in (linear, engine):
        assert run.setpoint.names == ("shank", "mass", "thigh")
        assert run.setpoint.units == ("rad", "m", "rad")
        shank = run.r[:, 0]
        np.testing.assert_allclose(shank, 0.01 + 0.01 * ((run.t >= 0.4) & (run.t < 0.9)), atol=1e-15)
        after = -run.events.x_o @ case.controller.design.k.T
        after += case.setpoint(run.events.t) @ (case.controller.design.k @ case.setpoint.x_ss + case.setpoint.u_ss).T
        np.testing.assert_allclose(run.u_after(case.controller), after, rtol=1e-12)


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_it_is_logged_and_exported(case, tmp_path, plant):
    result = icmj.run_case(case.run, plant, study=True)
    path = tmp_path / "followed.rrd"
    icmj.write_log(result, path)
    back = icmj.read_log(path)
    for run, of in ((result.simulation, back.simulation), (result.continuous, back.continuous)):
        np.testing.assert_array_equal(of.r, run.r)
        for name in ("names", "units", "x_ss", "u_ss", "terms"):
            np.testing.assert_array_equal(getattr(of.setpoint, name), getattr(run.setpoint, name))
    shown = {group.path: group for group in list_groups(back)}["outputs/setpoint"]
    assert shown.names == ("set-point shank", "set-point mass", "set-point thigh")
    jump = shown.values[shown.t == 0.4, 0]
    np.testing.assert_allclose([jump[0], jump[-1]], [0.01, 0.02], atol=1e-12)
    assert np.all(np.diff(shown.t) >= 0)
    series = back.to_series(500.0)
    columns = [series.names.index(name) for name in ("r.shank", "r.mass", "r.thigh")]
    assert [series.units[i] for i in columns] == ["rad", "m", "rad"]
    np.testing.assert_array_equal(series.values[:, columns], case.setpoint(series.t))


def test_a_log_whose_set_point_does_not_fit_is_refused(case):
    result = icmj.run_case(case.run, "linear")
    wrong = replace(result.simulation.setpoint, x_ss=result.simulation.setpoint.x_ss[1:])
    wrong = replace(result, simulation=replace(result.simulation, setpoint=wrong))
    with pytest.raises(LogError, match=r"setpoint\.x_ss"):
        unpack(*pack(wrong))


def test_what_is_of_theory_knows_nothing_of_it(case):
    """Nor does growth under a clock, and an open-loop interval is refused: test_routes.py."""
    bare = prepare(case.run.with_(setpoint=None))
    assert bare.prediction.delta_crit == case.prediction.delta_crit
    assert not bare.setpoint
    mine, theirs = (icmj.find_cycle(one, "linear") for one in (case, bare))
    np.testing.assert_array_equal(mine.states, theirs.states)


@pytest.mark.slow
def test_who_asks_is_told_that_theory_knows_nothing_of_it(case, root, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "follows.toml"
    path.write_text(case.run.text.replace("../models", str(root / "models")), encoding="utf-8")
    assert [notice.kind for notice in case.notices] == ["set-point"]
    result = icmj.run_case(case.run, "linear")
    assert any("the prediction is that of r = 0" in notice for notice in result.notices)
    further = {"analyse": "", "cycle": "--plant linear", "run": "--plant linear",
               "continue": "--plant linear --parameter b --from 0.9 --to 0.91"}  # fmt: skip
    for command, options in further.items():
        assert main([command, str(path), *options.split()]) == 0
        said = capsys.readouterr()
        assert "set-point: the prediction is that of r = 0" in " ".join((said.out + said.err).split())


def test_too_fine_a_sequence_is_refused_and_a_fast_sine_is_reckoned_with(case):
    fine = {"output": "shank", "kind": "ternary", "size": 0.1, "interval": 1e-3}
    with pytest.raises(AnalysisError, match="1e\\+04 intervals in this run; expected at most 5000"):
        prepare(case.run.with_(setpoint=[fine], **{"simulation.duration": 10.0}))
    slow, fast = ({"output": "shank", "kind": "sines", "size": 1e-9, "frequencies": [f]} for f in (1.0, 1e9))
    seconds = [estimate(prepare(case.run.with_(setpoint=[table])), "linear") for table in (slow, fast)]
    assert seconds[0] < 60 < seconds[1]


def test_other_controllers_have_none(case):
    other = {"kind": "switching", "position": "shank", "rate": "thigh", "P": 1.0, "D": 1.0}
    with pytest.raises(RunFileError, match="a set-point is for the intermittent or the predictor controller"):
        case.run.with_(controller=other)


@pytest.mark.parametrize(("tables", "words"), [
    ([{"output": "shnk", "kind": "step", "size": 1.0}], "shnk.*outputs are"),
    ([{"output": "shank", "kind": "step"}], r"setpoint\[0\].*size"),
    ([{"output": "shank", "kind": "stair", "size": 1.0}], "stair"),
    ([{"kind": "step", "size": 1.0}], "one of output and combination"),
    ([{"combination": {"shank": 1.0}, "kind": "step", "size": 1.0}], "a combination needs a name"),
    ([{"output": "shank", "kind": "sines", "size": [1.0], "frequencies": [1.0, 2.0]}], "1 numbers for 2"),
    ([{"output": "shank_rate", "kind": "step", "size": 1.0}], "outputs are|no steady state"),
    ([{"output": "ankle_rate", "kind": "step", "size": 1.0}], "no steady state"),
    ([{"output": "shank", "kind": "sines", "size": 1.0, "frequencies": []}], "frequencies"),
])  # fmt: skip
def test_bad_tables_are_told_in_one_line(case, tables, words):
    with pytest.raises((RunFileError, AnalysisError), match=words) as told:
        prepare(case.run.with_(setpoint=tables))
    assert str(told.value).startswith(str(case.run.path))


def test_pairs_of_steps_are_those_of_the_function(case):
    pairs = {"output": "trunk", "kind": "double-steps", "size": 0.01, "isi": [0.1, 0.3], "repetitions": 2, "seed": 5}
    followed = prepare(case.run.with_(setpoint=[pairs]), like=case).setpoint
    made = icmj.controller.double_steps([0.1, 0.3], 2, 0.01, seed=5)
    np.testing.assert_array_equal(followed.edges, made.t.ravel())
    np.testing.assert_allclose(followed(made.t.ravel())[:, 0], np.cumsum(made.sizes.ravel()), atol=1e-15)
    for wrong, words in (
        ({"isi": [0.1, 0.1]}, "each once"),
        ({"size": 0.0}, "sizes must be finite and not zero"),
        ({"recovery": [2.0, 1.0]}, "recovery of 2 to 1 s"),
        ({"repetitions": 10_000}, "at most 10000"),
        ({"directions": ["up"]}, "directions"),
    ):
        with pytest.raises((RunFileError, AnalysisError), match=words):
            _ = prepare(case.run.with_(setpoint=[{**pairs, **wrong}]), like=case).setpoint


@pytest.fixture
def recorded(root, tmp_path):
    """A run that follows a column in degrees, from 0.5 s on, and the folder of its file."""
    (tmp_path / "target.csv").write_text("t [s],other [N],head [deg]\n0,9,0.2\n0.5,9,0.2\n1.0,9,-0.3\n1.6,9,0.1\n")
    text = (root / "runs" / "three-link-0.9.toml").read_text().replace("../models", (root / "models").as_posix())
    (tmp_path / "followed.toml").write_text(text)
    follows = {"output": "trunk", "kind": "file", "file": "target.csv", "column": "head", "size": 2.0, "start": 0.5}
    run = load_run(tmp_path / "followed.toml").with_(**{"controller.q_t": 1e-3, **SHORT, "setpoint": [follows]})
    return run, tmp_path


def test_a_column_of_a_file_is_followed(recorded):
    run, _ = recorded
    corners, values = np.array([0.5, 1.0, 1.5, 2.1]), np.radians([0.4, 0.4, -0.6, 0.2])
    for plant in ("linear", "mujoco"):
        found = simulate(prepare(run), plant)
        expected = np.interp(found.t, corners, values) * (found.t >= 0.5)
        np.testing.assert_allclose(found.r[:, 0], expected, atol=1e-15)
        assert found.setpoint.units == ("rad",)
        assert len(found.events) > 2
    coarse = prepare(run.with_(**{"setpoint[0].interval": 0.8})).setpoint
    at = np.array([0.0, 0.5, 1.3, 1.7, 2.1])
    np.testing.assert_allclose(coarse(at)[:, 0], [0, values[0], *np.interp([1.3, 1.7, 2.1], [0.5, 1.3, 2.1],
                               np.interp([0.5, 1.3, 2.1], corners, values))], atol=1e-15)  # fmt: skip


def test_a_log_carries_the_file_that_was_followed(recorded, tmp_path_factory):
    run, folder = recorded
    path = tmp_path_factory.mktemp("elsewhere") / "followed.rrd"
    icmj.write_log(icmj.run_case(run, "linear"), path)
    (folder / "target.csv").unlink()
    with icmj.read_log(path).run.at_hand() as again:
        assert again.path.parent != folder
        assert prepare(again).setpoint(1.5) == pytest.approx(np.radians(-0.6), abs=1e-15)


@pytest.mark.parametrize(("content", "changes", "words"), [
    (None, {"file": "none.csv"}, "none.csv"),
    (None, {"column": "neck"}, "neck"),
    ("t [s],head [deg]\n0,0.1\n1,\n2,0.2\n", {}, "row 2; fill its gaps"),
    ("t [s],head [deg]\n" + "".join(f"{i * 1e-4},{i * i % 7}\n" for i in range(12_000)), {}, "set its interval"),
    (None, {"interval": 1e-7}, "expected at most 5000"),
])  # fmt: skip
def test_a_file_that_cannot_be_followed_is_told_in_one_line(recorded, content, changes, words):
    run, folder = recorded
    if content is not None:
        (folder / "target.csv").write_text(content)
    with pytest.raises((RunFileError, AnalysisError), match=words):
        prepare(run.with_(**{f"setpoint[0].{key}": value for key, value in changes.items()}))


def test_the_scene_shows_the_posture_that_is_asked_for(case):
    """The outputs are absolute angles: the lines of the target lean as the set-point and its steady state say."""
    run = simulate(case, "linear")
    rows = np.arange(0, len(run.t), 37)
    found = make_scene(case.actual, run, 10.0, rows)
    of_outputs = run.r[rows] @ (case.controller.plant.C @ case.setpoint.x_ss).T
    for lines, factor in ((found.target, 1.0), (found.magnified_target, 10.0)):
        dx, dz = np.moveaxis(np.diff(lines, axis=2)[:, :, 0, [0, 2]], -1, 0)
        np.testing.assert_allclose(np.arctan2(dx, dz), factor * of_outputs, atol=1e-9)
    still = replace(case, controller=replace(case.controller, setpoint=None))
    assert make_scene(case.actual, simulate(still, "linear"), 10.0).target is None


def test_a_sampling_delay_is_logged_told_of_and_no_cycle_is_sought_with_it(root, tmp_path) -> None:
    late = {"controller.sampling_delay": 0.05, **SHORT}
    run = load_run(root / "runs" / "simple-0.8.toml").with_(**late)
    made = prepare(run)
    assert [notice.kind for notice in made.notices if notice.kind == "sampling delay"]
    with pytest.raises(CycleError, match=r"samples 0.05 s later: take controller.sampling_delay out"):
        icmj.find_cycle(made, "linear")
    with pytest.raises(AnalysisError, match="has no such form"):
        icmj.to_iosystem(made.actual.linearisation.plant, made.controller, dt=0.01)
    result = icmj.run_case(run, "linear")
    again = unpack(*pack(result))
    assert again.controller.sampling_delay == 0.05
    text = compose_run(made.actual.linearisation.plant, made.controller, name="again").text
    assert "sampling_delay = 0.05" in text
    assert prepare(icmj.parse_run(text, tmp_path / "again.toml")).controller.sampling_delay == 0.05


CART = """
[case]
name = "cart"
title = "A pole on a cart, both driven"
[assumed]
model = "two.xml"
[design]
R_c = 0.1
R_o = 0.01
[controller]
q_t = 1e-4
delta_min = 0.01
[simulation]
duration = 20.0
[[setpoint]]
output = "angle"
kind = "step"
size = 0.01
"""


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_it_is_held_where_a_coordinate_is_free(plant, tmp_path) -> None:
    """The pole leans at 0.01 rad wherever the cart is; the torque is that of its weight, 9.81 N · 0.5 m / 20."""
    two(tmp_path)
    (tmp_path / "run.toml").write_text(CART, encoding="utf-8")
    case = prepare(load_run(tmp_path / "run.toml"))
    np.testing.assert_allclose(case.setpoint.x_ss[:, 0], [0, 1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(case.setpoint.u_ss[:, 0], [0, -9.81 * 0.5 / 20], atol=1e-8)
    run = simulate(case, plant)
    assert run.outcome.kind == "completed"
    np.testing.assert_allclose(run.y[-1], [0, 0.01], atol=2e-4)
