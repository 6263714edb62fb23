"""Switching channels and the delayed PID in run files: made, simulated on both plants, kept in logs, refused."""

from pathlib import Path

import numpy as np
import pytest
from tapped_cases import PERSON

from icmj import IcmjError, RunFile, load_run, prepare, read_log, run_case, simulate, write_log

HEAD = """
case = { name = "asai", title = "Feedback of one joint" }
assumed = { model = "person.xml", delay = 0.2 }
simulation = { duration = 12.0, initial = { lean = 0.02 } }
[controller]
"""
CHANNEL = {"position": "theta", "rate": "omega", "P": 147.15, "D": 10.0, "slope": -0.4, "dead_zone": 0.004}
PID = (
    'kind = "delayed-pid"\nposition = "theta"\nrate = "omega"\nP = 400.0\nD = 150.0\nI = 20.0\n'
    "force_gain = 2e-4\nforce_time = 10.0\n"
)


def _lines(table: dict[str, object]) -> str:
    return "".join(f"{key} = {value!r}\n".replace("'", '"') for key, value in table.items())


def written(folder: Path, controller: str, *more: tuple[str, str]) -> RunFile:
    text, person = HEAD + controller, PERSON
    for old, new in more:
        text, person = text.replace(old, new), person.replace(old, new)
    (folder / "person.xml").write_text(person, encoding="utf-8")
    (folder / "asai.toml").write_text(text, encoding="utf-8")
    return load_run(folder / "asai.toml")


@pytest.fixture
def channelled(tmp_path: Path) -> RunFile:
    return written(tmp_path, f'kind = "switching"\n[[controller.channel]]\n{_lines(CHANNEL)}')


@pytest.fixture
def continuous(tmp_path: Path) -> RunFile:
    lagging = ("delay = 0.2", "delay = 0.097, activation = { order = 2, time_constant = 0.0595 }")
    return written(tmp_path, PID, lagging)


def test_one_channel_is_the_controller_of_one_joint(channelled: RunFile, tmp_path: Path) -> None:
    known = written(tmp_path, 'kind = "switching"\n' + _lines(CHANNEL))
    for plant in ("linear", "mujoco"):
        mine, theirs = (simulate(prepare(run), plant) for run in (channelled, known))  # type: ignore[arg-type]
        np.testing.assert_array_equal(mine.x, theirs.x)


@pytest.mark.parametrize("which", ["channelled", "continuous"])
def test_a_log_keeps_it_bit_for_bit(which: str, request: pytest.FixtureRequest) -> None:
    run = request.getfixturevalue(which)
    for plant in ("linear", "mujoco"):
        result = run_case(run.with_(**{"simulation.duration": 3.0}), plant)  # type: ignore[arg-type]
        log = run.path.with_suffix(".rrd")
        write_log(result, log)
        back = read_log(log)
        assert back.simulation.x.tobytes() == result.simulation.x.tobytes()
        again = simulate(prepare(back.run), plant)  # type: ignore[arg-type]
        assert again.x.tobytes() == result.simulation.x.tobytes()
        assert type(back.controller) is type(result.controller)


def test_the_engine_is_the_linear_plant_at_small_sway(continuous: RunFile) -> None:
    errors = []
    for size in (0.04, 0.02):
        run = continuous.with_(**{"simulation.initial": {"lean": size}, "simulation.duration": 2.0})
        linear, engine = (simulate(prepare(run), plant) for plant in ("linear", "mujoco"))  # type: ignore[arg-type]
        theirs = np.interp(linear.t, engine.t, engine.x[:, 0])
        errors.append(np.abs(theirs - linear.x[:, 0]).max() / size)
    # the body's sine differs from its slope in the third power, relative in the second
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(("change", "words"), [
    ({"controller.P": 1.0}, "controller.P"),
    ({"controller.channel": []}, "controller.channel"),
    ({"controller.channel[0].share": 0.6}, "give slope or share, not both"),
    ({"controller.channel[0].rate": "knee"}, "the plant's outputs are theta, omega"),
    ({"controller.channel[0].input": "hip"}, "name the input of each channel"),
    ({"controller.channel[0].dead_zone": -1.0}, "dead_zone"),
    ({"controller.channel[0].position": {"theta": "x"}}, "position"),
])  # fmt: skip
def test_what_is_wrong_with_channels_is_said(channelled: RunFile, change: dict, words: str) -> None:
    with pytest.raises(IcmjError, match=words):
        prepare(channelled.with_(**change))


@pytest.mark.parametrize(("change", "words"), [
    ({"controller.P": None}, "controller.P is missing"),
    ({"controller.force": "knee"}, "the plant's outputs are theta, omega"),
    ({"controller.force_gain": 1.0}, "it must be below 1"),
    ({"controller.force_time": 0.0}, "force_time"),
    ({"assumed.delay": None}, "delay of the delayed PID controller must be positive"),
])  # fmt: skip
def test_what_is_wrong_with_a_delayed_pid_is_said(continuous: RunFile, change: dict, words: str) -> None:
    with pytest.raises(IcmjError, match=words):
        prepare(continuous.with_(**change))
