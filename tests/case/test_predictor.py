"""The continuous predictor controller: from the run file through the command line to log, report and replay."""

import json
from pathlib import Path

import numpy as np
import pytest
from terminal_cases import told

from icmj.case.case import prepare, simulate
from icmj.cli.main import main
from icmj.errors import IcmjError
from icmj.log.reader import read_log, read_summary
from icmj.log.writer import write_log
from icmj.runfile.reading import load_run
from icmj.study.study import run_case

RUN = """
[case]
name = "predicting"
title = "Continuous prediction"
[assumed]
model = "pendulum.xml"
delay = 0.1
[actual]
delay = 0.12
gain = 0.9
[design]
R_c = 0.1
R_o = 0.01
[controller]
kind = "predictor"
[[setpoint]]
output = "angle"
kind = "step"
size = 0.02
start = 1.0
[simulation]
duration = 3.0
initial = { hinge = 0.01 }
"""


@pytest.fixture
def run_path(tmp_path: Path, root: Path) -> Path:
    model = root / "models" / "pendulum.xml"
    path = tmp_path / "predicting.toml"
    path.write_text(RUN.replace("pendulum.xml", model.as_posix()), encoding="utf-8")
    return path


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_it_goes_from_run_file_to_log_and_is_read_bit_for_bit(run_path: Path, plant: str) -> None:
    result = run_case(load_run(run_path), plant)  # type: ignore[arg-type]
    assert result.controller.kind == "predictor"
    log = run_path.with_suffix(".rrd")
    write_log(result, log)
    back = read_log(log)
    for name in ("t", "x", "y", "u", "r"):
        assert getattr(back.simulation, name).tobytes() == getattr(result.simulation, name).tobytes()
    assert back.simulation.r[-1] == 0.02
    assert back.controller.realisation.M.tobytes() == result.controller.realisation.M.tobytes()
    facts = read_summary(log)["controller"]
    assert (facts["delay"], facts["assumed_delay"]) == (0.12, 0.1)
    # the law that is kept moves as the one that was run
    trial = prepare(load_run(run_path))
    again = simulate(type(trial)(**{**vars(trial), "controller": back.controller}), plant)  # type: ignore[arg-type]
    np.testing.assert_array_equal(again.x, result.simulation.x)


@pytest.mark.slow
def test_the_same_command_lines_serve_it(run_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = run_path.parent / "out"
    assert main(["study", str(run_path), "--out", str(out), "--jobs", "1"]) == 0
    records = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert [(row["plant"], row["control"]) for row in records] == [("linear", "predictor"), ("mujoco", "predictor")]
    assert "Under predictor control the run" in capsys.readouterr().out
    log = out / "predicting.linear.rrd"
    assert main(["report", str(log), "--out", str(out / "one.html")]) == 0
    assert main(["export", str(log), "--rate", "50"]) == 0
    assert main(["measure", str(log), "--since", "1"]) == 0


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (["cycle"], "a controller that never switches has no cycle of its own"),
        (["continue", "--parameter", "b", "--from", "1", "--to", "0.9"], "only branches of intermittent"),
    ],
)
def test_what_makes_no_sense_is_one_line(
    run_path: Path, command: list, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command[0], str(run_path), *command[1:]]) == 2
    (said,) = told(capsys.readouterr().err)
    assert words in said


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"assumed.delay": None, "actual.delay": None}, "predicts over a delay, and there is none"),
        ({"actual.delay": None, "assumed.delay": 60.0}, "leaves no significant digit"),
        ({"controller.q_t": 0.1}, "controller.q_t"),
        ({"design.R_c": -1.0}, "R_c"),
        ({"setpoint[0].output": "knee"}, "the assumed plant's outputs are"),
        ({"simulation.observer": {"hinge": 0.1}}, "leave out where they start"),
    ],
)
def test_what_is_wrong_is_said(run_path: Path, change: dict, words: str) -> None:
    def attempt() -> None:
        simulate(prepare(load_run(run_path).with_(**change)), "linear")

    with pytest.raises(IcmjError, match=words):
        attempt()
