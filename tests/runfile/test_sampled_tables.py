"""Disturbances by their values: ramps and columns of files, from a run file to both plants and a log."""

from dataclasses import replace

import numpy as np
import pytest
from linear_cases import PLANT, event_controller, ivp_run, pendulum_design, settings_from

import icmj
from icmj import IcmjError, Sampled, load_run
from icmj.errors import RunFileError
from icmj.linear.run import simulate
from icmj.simulation.disturbance import make_disturbance, make_pushes


def test_a_ramp_is_what_dop853_finds() -> None:
    ramp = {"kind": "ramp", "input": "torque", "on": "command", "size": 0.2, "start": 0.31, "duration": 0.56}
    chosen = settings_from({"duration": 1.5, "disturbance": [ramp]})
    controller = event_controller(pendulum_design(), q_t=0.004, delta_min=0.05)
    found = simulate(PLANT, controller, chosen, x0=[0.02, 0.0])
    times, states, _ = ivp_run(
        PLANT, controller, 1.5, [0.02, 0.0], [0.0, 0.0], max_step=1e-3,
        torque=lambda t: 0.2 * np.clip((np.asarray(t) - 0.31) / 0.56, 0, 1)[..., None],
    )  # fmt: skip
    assert len(times) == len(found.events) >= 4
    np.testing.assert_allclose(found.events.t, times, atol=1e-7, rtol=0)
    np.testing.assert_allclose(found.events.x, states[:, :2], atol=1e-7, rtol=0)


@pytest.fixture
def run(root, tmp_path):
    rows = "".join(f"{0.05 * i:.2f},{20 * i * (4 - i):.1f}\n" for i in range(5))
    (tmp_path / "pushed.csv").write_text(f"t [s],push [N m]\n{rows}", encoding="utf-8")
    return load_run(root / "runs" / "simple-0.8.toml")


def test_a_column_of_a_file_pushes_both_plants_and_a_log_carries_it(run, tmp_path) -> None:
    table = {"kind": "file", "input": "torque", "on": "body", "column": "push", "size": 1e-4}
    table["file"] = str(tmp_path / "pushed.csv")
    changes = {"simulation.disturbance": [table | {"start": 0.5}], "simulation.duration": 2.0}
    run = run.with_(**changes)
    rows = 1e-4 * np.array([0.0, 60.0, 80.0, 60.0, 0.0])
    for plant in ("linear", "mujoco"):
        result = icmj.run_case(run, plant)
        t = result.simulation.t
        expected = np.where(t >= 0.5, np.interp(t, 0.5 + 0.05 * np.arange(5), rows), 0.0)
        np.testing.assert_allclose(result.simulation.pushed[:, 0], expected, atol=1e-15)
        icmj.write_log(result, tmp_path / "pushed.rrd")
        (source,) = icmj.read_log(tmp_path / "pushed.rrd").run.simulation.settings().disturbance
        assert isinstance(source, Sampled)
        assert make_pushes(replace(result.run.simulation.settings(), disturbance=(source,))).size(0.56)[
            0
        ] == pytest.approx(np.interp(0.06, [0.05, 0.1], rows[1:3]))


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"kind": "file", "file": "none.csv", "column": "push"}, "none.csv"),
        ({"kind": "file", "file": "pushed.csv", "column": "pull"}, "pull"),
        ({"kind": "file", "file": "pushed.csv", "column": "push", "interval": 1e-7}, "set its interval"),
        ({"kind": "ramp", "size": 1.0, "start": 0.005, "duration": 0.1}, "integer multiples of its interval, 0.01 s"),
        ({"kind": "ramp", "size": 1.0, "duration": 1e9}, "at most 100000 of them"),
        ({"kind": "ramp", "duration": 0.1}, "size is required"),
        ({"kind": "sampled", "values": []}, "at least 1"),
        ({"kind": "sampled", "values": [1.0], "interval": -1.0}, "greater than 0"),
        ({"kind": "sampled", "values": [1.0], "surface": "tilt"}, "give one of"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(run, tmp_path, table, words) -> None:
    if "file" in table:
        table = table | {"file": str(tmp_path / table["file"])}
    with pytest.raises(IcmjError) as told:
        icmj.prepare(run.with_(**{"simulation.disturbance": [{"input": "torque"} | table]}))
    assert words in str(told.value)
    assert "\n" not in str(told.value)


def test_gaps_are_told(run, tmp_path) -> None:
    (tmp_path / "pushed.csv").write_text("t [s],push [N m]\n0,1\n0.1,\n0.2,1\n", encoding="utf-8")
    table = {"kind": "file", "input": "torque", "file": str(tmp_path / "pushed.csv"), "column": "push"}
    with pytest.raises(RunFileError, match="has no number in push, row 2; fill its gaps"):
        icmj.prepare(run.with_(**{"simulation.disturbance": [table]}))


def test_after_its_last_value_it_is_held() -> None:
    source = Sampled(input="u", values=(0.0, 2.0), interval=0.5, start=0.25, on="command")
    t = np.array([0.0, 0.2, 0.25, 0.5, 0.75, 9.0])
    np.testing.assert_allclose(make_disturbance((source,), ("u",))(t)[:, 0], [0.0, 0.0, 1.0, 2.0, 2.0, 2.0])
