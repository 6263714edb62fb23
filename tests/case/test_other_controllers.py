"""Controllers that are not intermittent: from the run file through the command line to log, report and replay."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from terminal_cases import told

from icmj import build_live, compare, load_run, parse_run, run_case, write_log
from icmj.case.case import expect_theory, prepare, simulate
from icmj.cli.main import main
from icmj.controller.law import RecordedLaw
from icmj.errors import AnalysisError, IcmjError, ReportError, RunFileError
from icmj.log.archive import pack, unpack
from icmj.log.reader import read_log, read_summary

PERSON = """
<mujoco model="person">
  <option timestep="0.002" gravity="0 0 -9.81"/>
  <worldbody>
    <body name="body">
      <joint name="ankle" type="hinge" axis="0 1 0" stiffness="470.88" damping="4"/>
      <inertial pos="0 0 1" mass="60" diaginertia="1e-3 1e-3 1e-3"/>
      <geom type="capsule" fromto="0 0 0.1 0 0 1.6" size="0.1" mass="0" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <actuator><motor name="torque" joint="ankle"/></actuator>
  <sensor>
    <jointpos name="angle" joint="ankle"/>
    <jointvel name="speed" joint="ankle"/>
  </sensor>
  <keyframe><key name="upright" qpos="0"/></keyframe>
</mujoco>
"""
RUN = """
[case]
name = "asai"
title = "Switched feedback"
[assumed]
model = "person.xml"
keyframe = "upright"
delay = 0.2
[controller]
kind = "switching"
position = "angle"
rate = "speed"
P = 147.15
D = 10.0
slope = -0.4
dead_zone = 0.004
[simulation]
duration = 12.0
initial = { ankle = 0.02 }
"""
PREDICTING = """
[case]
name = "predicting"
title = "Continuous prediction"
[assumed]
model = "MODEL"
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
OWN = '''
from dataclasses import dataclass
import numpy as np
from icmj import Law, LinearPlant
from icmj.controller import Layout, Mode, Realisation

@dataclass(frozen=True, eq=False)
class Proportional(Law):
    """u = -P y(t - delay), and an integrator of it."""
    assumed: LinearPlant
    delay: float
    P: float
    I: float = 0.0

    @property
    def plant(self):
        return self.assumed

    kind = "proportional"

    def facts(self):
        return {"P": self.P, "I": self.I}

    @property
    def realisation(self):
        n_u, n_y = self.assumed.n_u, self.assumed.n_y
        N = np.zeros((1, n_y)); N[0, 0] = 1.0
        S = np.zeros((n_u, n_y)); S[:, 0] = self.P; S[:, 1] = 0.35 * self.P
        mode = Mode("on", np.zeros((1, 1)), N, np.full((n_u, 1), self.I), S)
        same, nowhere = np.eye(1), np.zeros((0, 1))
        return Realisation(Layout.of(sum=1), (mode,), same, same, nowhere, np.zeros(1, dtype=int), taps=(self.delay,))

def nothing(assumed):
    return 3
'''


CLOCKED = """
import icmj

def clocked(plant):
    design = icmj.design_lq(plant, R_c=0.1, R_o=0.01)
    return icmj.Controller(design, icmj.system_matched(design), icmj.ClockTrigger(0.1))
"""
UNSTABLE = """
[case]
name = "clocked"
title = "a clock of one's own"
[assumed]
A = [[0.0, 1.0], [1.0, 0.0]]
B = [[0.0], [1.0]]
C = [[1.0, 0.0]]
states = ["lean", "rate"]
inputs = ["torque"]
outputs = ["lean"]
[controller]
kind = "mine:clocked"
[simulation]
duration = 5.0
initial = { lean = 0.02 }
"""


@pytest.fixture
def run_path(tmp_path: Path) -> Path:
    (tmp_path / "person.xml").write_text(PERSON, encoding="utf-8")
    path = tmp_path / "asai.toml"
    path.write_text(RUN, encoding="utf-8")
    return path


@pytest.fixture
def predicting(tmp_path: Path, root: Path) -> Path:
    path = tmp_path / "predicting.toml"
    path.write_text(PREDICTING.replace("MODEL", (root / "models" / "pendulum.xml").as_posix()), encoding="utf-8")
    return path


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_it_goes_from_run_file_to_log_and_is_read_bit_for_bit(run_path: Path, plant: str) -> None:
    result = run_case(load_run(run_path), plant)  # type: ignore[arg-type]
    assert result.controller.kind == "switching"
    assert len(result.simulation.events) > 3
    assert set(result.simulation.mode) == {0, 1}
    log = run_path.with_suffix(".rrd")
    write_log(result, log)
    back = read_log(log)
    for name in ("t", "x", "y", "u", "mode"):
        assert getattr(back.simulation, name).tobytes() == getattr(result.simulation, name).tobytes()
    assert back.controller.facts() | {"P": 0, "D": 0} == result.controller.facts() | {"P": 0, "D": 0}
    assert read_summary(log)["controller"]["delay"] == 0.2
    assert (back.prediction, back.continuous, back.measurement) == (None, None, None)
    count = len(result.simulation.events)
    ended = back.simulation.outcome.message
    assert back.words == f"Under switching control the run {ended}; it switched {count} times."
    with pytest.raises(AnalysisError, match="asai: a run under switching control has no prediction to be"):
        compare(back)


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_a_predictor_that_is_kept_moves_as_the_one_that_was_run(predicting: Path, plant: str) -> None:
    result = run_case(load_run(predicting), plant)  # type: ignore[arg-type]
    log = predicting.with_suffix(".rrd")
    write_log(result, log)
    back = read_log(log)
    for name in ("t", "x", "y", "u", "r"):
        assert getattr(back.simulation, name).tobytes() == getattr(result.simulation, name).tobytes()
    assert back.simulation.r[-1] == 0.02
    assert back.controller.realisation.M.tobytes() == result.controller.realisation.M.tobytes()
    facts = read_summary(log)["controller"]
    assert (result.controller.kind, facts["delay"], facts["assumed_delay"]) == ("predictor", 0.12, 0.1)
    again = simulate(replace(prepare(load_run(predicting)), controller=back.controller), plant)  # type: ignore[arg-type]
    np.testing.assert_array_equal(again.x, result.simulation.x)


def test_a_log_that_an_earlier_version_wrote_of_it_is_read_bit_for_bit(run_path: Path) -> None:
    """It was a class of its own, without the parts beside a prediction, and its controller was called law."""
    result = run_case(load_run(run_path), "linear")
    text, arrays = pack(result)
    known = ("run", "assumed", "actual", "controller", "simulation", "provenance", "notices", "measures")
    tree = {"@": "Tried"} | {name: value for name, value in json.loads(text).items() if name in known}
    earlier = json.loads(json.dumps(tree).replace('"controller.', '"law.'))
    earlier["law"] = earlier.pop("controller")
    renamed = {re.sub(r"^controller\.", "law.", name): values for name, values in arrays.items()}
    back = unpack(json.dumps(earlier), renamed)
    assert back.prediction is None
    assert back.simulation.x.tobytes() == result.simulation.x.tobytes()
    assert back.controller.realisation.modes[0].S.tobytes() == result.controller.realisation.modes[0].S.tobytes()
    assert pack(back)[0] == text


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["switching", "predictor"])
def test_the_same_command_lines_serve_it(run_path, predicting, kind, capsys, shell) -> None:
    path, out = run_path if kind == "switching" else predicting, run_path.parent / "out"
    assert main(["study", str(path), "--out", str(out), "--jobs", "2"]) == 0
    records = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    there = [(row["case"], row["plant"], row["control"]) for row in records]
    assert there == [(path.stem, plant, kind) for plant in ("linear", "mujoco")]
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Other controllers" in page
    assert load_run(path).case.title in page
    assert f"{path.stem} (mujoco): Under {kind} control the run" in capsys.readouterr().out
    log = out / f"{path.stem}.linear.rrd"
    run, report = ["run", str(path), "--out", str(out), "--plant", "linear"], ["report", str(log), "--out"]
    assert f"Under {kind} control the run" in shell.says(run)
    for command in (run, [*report, str(out / "one.html")]):
        assert shell.answers([*command, "--json"])["runs"] == records[:1]
    for command in ([*report, str(out / "one.html")], ["export", str(log)], ["measure", str(log), "--since", "1"]):
        assert main(command) == 0


@pytest.mark.parametrize(("kind", "command", "words"), [
    ("switching", "continue --parameter q_t --to 1", "no parameter 'q_t'; expected P, D, slope"),
    ("switching", "continue --parameter P --to 9 --plant mujoco", "on the linear plant (--plant linear)"),
    ("switching", "cycle --plant linear --set controller.P=900", "no cycle: the motion fell"),
    ("predictor", "cycle", "a controller that never switches has no cycle of its own"),
    ("predictor", "continue --parameter b --from 1 --to 0.9", "only branches of intermittent"),
])  # fmt: skip
def test_what_makes_no_sense_is_one_line(run_path, predicting, kind, command, words, shell) -> None:
    first, *more = command.split()
    (said,) = told(shell.refuses([first, str(run_path if kind == "switching" else predicting), *more]))
    assert words in said


@pytest.mark.slow
def test_its_cycle_is_found_and_followed(run_path: Path, shell) -> None:
    found = shell.answers(["cycle", str(run_path), "--plant", "linear", "--json"])
    assert found["period"] == pytest.approx(4.131031, rel=2e-5)  # this body has 1e-3 of 60 kg m² of its own
    assert (found["switches"], found["mirrored"], found["attracting"]) == (4, False, True)
    said = shell.says(["continue", str(run_path), "--parameter", "P", "--to", "142.4", "--points", "5"])
    assert "Stability changes at P = 142.80" in said
    assert "reached P = 142.4" in said


def test_a_start_of_an_observer_that_is_not_there_is_told_with_the_file(run_path, shell):
    text = run_path.read_text(encoding="utf-8") + "observer = { ankle = 0.1 }\n"
    run_path.write_text(text, encoding="utf-8")
    out = run_path.parent / "out"
    (line,) = told(shell.refuses(["run", str(run_path), "--plant", "linear", "--out", str(out)]))
    assert "asai.toml: " in line
    assert "neither observer nor hold" in line
    assert not out.exists()


def test_a_case_of_any_controller_says_whether_it_has_a_prediction(root: Path, run_path: Path) -> None:
    known, other = prepare(load_run(root / "runs" / "simple-0.8.toml")), prepare(load_run(run_path))
    assert known.prediction is not None
    assert expect_theory(known, "a cycle") is known.theory
    assert (other.prediction, other.system, other.rule) == (None, None, None)
    assert repr(other) == "<Case: asai, switching control, no prediction>"
    with pytest.raises(RunFileError, match=r"asai\.toml: a cycle needs an event rule, .* 'switching'"):
        expect_theory(other, "a cycle")


@pytest.mark.parametrize(("kind", "change", "words"), [
    ("switching", {"controller.P": None}, "controller.P is missing"),
    ("switching", {"controller.kind": "switched"}, "'predictor', 'switching', 'delayed-pid' or the module:name"),
    ("switching", {"controller.q_t": 0.1}, "controller.q_t"),
    ("switching", {"controller.position": "knee"}, "the plant's outputs are angle, speed"),
    ("switching", {"assumed.delay": None}, "the delay of the switching controller must be positive"),
    ("switching", {"controller.dead_zone": -1.0}, "controller.dead_zone"),
    ("predictor", {"assumed.delay": None, "actual.delay": None}, "predicts over a delay, and there is none"),
    ("predictor", {"actual.delay": None, "assumed.delay": 60.0}, "leaves no significant digit"),
    ("predictor", {"controller.q_t": 0.1}, "controller.q_t"),
    ("predictor", {"design.R_c": -1.0}, "R_c"),
    ("predictor", {"setpoint[0].output": "knee"}, "the assumed plant's outputs are"),
    ("predictor", {"simulation.observer": {"hinge": 0.1}}, "leave out where they start"),
])  # fmt: skip
def test_what_is_wrong_is_said(run_path: Path, predicting: Path, kind: str, change: dict, words: str) -> None:
    run = load_run(run_path if kind == "switching" else predicting)
    with pytest.raises(IcmjError, match=words):
        simulate(prepare(run.with_(**change)), "linear")


def test_a_controller_of_ones_own(run_path: Path) -> None:
    (run_path.parent / "mine.py").write_text(OWN, encoding="utf-8")
    text = RUN.split("[controller]")[0] + (
        '[controller]\nkind = "mine:Proportional"\nparameters = { P = 350.0, I = 20.0 }\n[simulation]\nduration = 4.0\n'
        "initial = { ankle = 0.02 }\n"
    )
    path = run_path.with_name("mine.toml")
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RunFileError, match="not run unasked"):
        prepare(load_run(path))
    result = run_case(load_run(path, allow_code=True), "linear")
    log = path.with_suffix(".rrd")
    write_log(result, log)
    (path.parent / "mine.py").unlink()
    law = read_log(log).controller
    assert isinstance(law, RecordedLaw)
    assert (law.reference, law.kind, law.parameters["P"]) == ("mine:Proportional", "proportional", 350.0)
    # the numbers that are kept move as the code did
    trial = prepare(load_run(run_path))
    again = simulate(replace(trial, controller=law, settings=load_run(path).simulation.settings()), "linear")
    np.testing.assert_array_equal(again.x, result.simulation.x)
    with pytest.raises(RunFileError, match="has no event rule"):
        expect_theory(trial, "a cycle")


def test_a_triggered_controller_of_ones_own_goes_all_the_way_without_a_prediction(tmp_path: Path) -> None:
    """It has no event rule that a prediction could be of, and its clock and its hold all the same."""
    (tmp_path / "mine.py").write_text(CLOCKED, encoding="utf-8")
    path = tmp_path / "clocked.toml"
    path.write_text(UNSTABLE, encoding="utf-8")
    case = prepare(load_run(path, allow_code=True))
    assert case.prediction is None
    result = run_case(case, "linear")
    np.testing.assert_allclose(result.simulation.events.interval, 0.1, atol=1e-12)
    assert "it had 50 events. The motion decays by a factor" in result.words
    write_log(result, tmp_path / "a.rrd")
    back = read_log(tmp_path / "a.rrd")
    assert back.simulation.x_h.tobytes() == result.simulation.x_h.tobytes()
    assert back.controller.facts() == result.controller.facts()
    with pytest.raises(ReportError, match=r"clocked\.toml: there is no live page of this case; .*this one has neither"):
        build_live(case, tmp_path / "a.html")


def test_what_is_no_controller_is_told(run_path: Path) -> None:
    (run_path.parent / "mine.py").write_text(OWN, encoding="utf-8")
    run = parse_run(RUN.split("[controller]")[0] + '[controller]\nkind = "mine:nothing"\n', run_path)
    run._allows_code = True
    with pytest.raises(RunFileError, match=r"makes a int; expected an icmj\.Law"):
        prepare(run)


def test_what_is_resampled_holds_beside_the_edge_of_a_push_and_its_echo(run_path: Path) -> None:
    step = [{"kind": "step", "input": "torque", "size": 3.0, "start": 2.003}]
    run = load_run(run_path).with_(**{"simulation.disturbance": step, "simulation.duration": 4.0})
    result, fine = (run_case(run.with_(**{"simulation.record_interval": dt}), "linear") for dt in (0.05, 0.001))
    taken, exact = result.to_series(1000.0), fine.to_series(1000.0)
    np.testing.assert_allclose(taken.t, exact.t, rtol=0, atol=1e-12)
    quiet = np.all(np.abs(taken.t[:, None] - result.simulation.events.t) > 0.06, axis=1)  # switches are not in question
    for name in ("y.angle", "y.speed"):
        i = taken.names.index(name)
        scale = np.abs(exact.values[:, i]).max()
        assert np.abs(taken.values[quiet, i] - exact.values[quiet, i]).max() < 1e-3 * scale
