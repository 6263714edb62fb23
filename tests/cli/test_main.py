"""The command line's contract: JSON keys, exit status, one line on standard error, nothing written on bad input."""

import math
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from terminal_cases import told

import icmj
from icmj.case.case import revise
from icmj.cli.comparisons import collect_notes
from icmj.cli.main import main
from icmj.errors import SimulationError
from icmj.simulation.disturbance import make_disturbance

COMMANDS = (
    "study", "analyse", "run", "report", "replay", "linearise", "person", "cycle", "sweep",
    "continue", "new", "identify", "experiment", "fit", "live",
)  # fmt: skip


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example(command, shell):
    shown = " ".join(shell.says([command, "--help"]).split())
    assert f"Example: icmj {command}" in shown


def assert_loads_none_of(heavy: str, *words: str) -> None:
    script = (
        f"import sys\nfrom icmj.cli.main import main\nassert main({list(words)}) == 0\n"
        f"sys.exit(', '.join(sorted(set({heavy.split()}) & set(sys.modules))) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_help_imports_nothing_heavy():
    assert_loads_none_of("numpy scipy mujoco rerun numba matplotlib control pydantic rich", "--help")


@pytest.mark.parametrize(
    ("command", "file"), [("analyse", "runs/simple-0.8.toml"), ("linearise", "models/three_link.xml")]
)
def test_a_command_loads_only_what_it_needs(root, command, file):
    parts = " scipy.optimize scipy.signal scipy.stats scipy.interpolate scipy.sparse"
    assert_loads_none_of("control matplotlib rerun pyarrow numba jinja2" + parts, command, str(root / file))


def test_analyse_json_is_the_contract(root, shell):
    found = shell.answers(["analyse", str(root / "runs" / "simple-1.7.toml"), "--json"])
    assert {"delta_crit", "eigenvalue", "cycle", "period", "gamma", "amplitude", "crossings"} <= found.keys()
    assert found["delta_crit"] == pytest.approx(1.112, abs=5e-4)
    assert found["eigenvalue"] == pytest.approx([-1, 0], abs=1e-9)
    assert found["cycle"] is False
    assert found["period"] is None
    assert found["continuous_stable"] == {"state_feedback": True, "observer_feedback": True}
    first, second = found["crossings"]
    assert {"delta", "eigenvalue", "largest_other"} <= first.keys()
    assert first["delta"] == pytest.approx(0.476, abs=5e-4)
    assert second["largest_other"] == pytest.approx(1.20, abs=5e-3)


def test_analyse_json_has_nulls_and_the_stability_of_either_feedback(root, shell):
    found = shell.answers(["analyse", str(root / "runs" / "simple-exact.toml"), "--json"])
    assert (found["delta_crit"], found["eigenvalue"], found["period"], found["gamma"]) == (None, None, None, None)
    assert (found["cycle"], found["crossings"]) == (False, [])
    for name, stable in (("neglected-0.1", False), ("neglected-0.5", True)):
        found = shell.answers(["analyse", str(root / "runs" / f"{name}.toml"), "--json"])
        assert found["continuous_stable"] == {"state_feedback": stable, "observer_feedback": True}


STILL = [
    "design.R_c=0.01", "design.R_o=1e-4", "controller.Q_t=identity", "controller.hold=zero-order", "actual.gain=1.3",
]  # fmt: skip
TWINS = """
[case]
name = "twins"
title = "Two equal pendulums"
[assumed]
A = [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1], [0, 0, 1, 0]]
B = [[1, 0], [0, 0], [0, 1], [0, 0]]
C = [[0, 1, 0, 0], [0, 0, 0, 1]]
[actual]
gain = 0.8
[design]
R_c = 0.1
R_o = 0.01
[controller]
q_t = 0.01
"""


def test_cycle_and_analyse_say_family_of_one_and_the_same_orbit(tmp_path, shell):
    """``cycle --json``, and later the sentence, said ``attracting`` of cycles beside which runs settle on others."""
    (tmp_path / "alike.toml").write_text(TWINS, encoding="utf-8")
    still = ["simple-1.2", *(word for change in STILL for word in ("--set", change))]
    for given, verdict in (
        (still, "family"),
        ([str(tmp_path / "alike.toml")], "family"),
        (["simple-0.8"], "attracting"),
    ):
        found = shell.answers(["cycle", *given, "--plant", "linear", "--json"])
        assert (found["verdict"], found["attracting"]) == (verdict, verdict == "attracting")
        assert found["prediction"]["verdict"] == verdict
        assert found["words"].startswith("An attracting") == (verdict == "attracting")
        assert ("on another of which a run that starts beside it settles" in found["words"]) == (verdict == "family")


def test_analyse_prints_a_table(root, shell):
    shown = shell.says(["analyse", str(root / "runs" / "three-link-0.9.toml")])
    assert "0.759379 s" in shown
    assert "attracting" in shown


def test_linearise_json_has_matrices_poles_and_names(root, shell):
    found = shell.answers(["linearise", str(root / "models" / "pendulum.xml"), "--keyframe", "upright", "--json"])
    assert found["states"] == ["hinge", "hinge_rate"]
    assert found["inputs"] == ["torque"]
    assert found["outputs"] == ["angle"]
    assert found["A"][1][0] == pytest.approx(1)
    assert [pole[0] for pole in found["poles"]] == pytest.approx([1, -1])


def test_run_writes_a_log_that_reads_back(root, tmp_path, capsys):
    from icmj.log.reader import read_log

    text = (root / "runs" / "simple-0.8.toml").read_text(encoding="utf-8")
    text = text.replace("../models", str(root / "models")).replace("duration = 40.0", "duration = 12.0")
    run_file = tmp_path / "short.toml"
    run_file.write_text(text.replace('name = "simple-0.8"', 'name = "short"'), encoding="utf-8")
    assert main(["run", str(run_file), "--plant", "linear", "--out", str(tmp_path / "out")]) == 0
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["short.linear.rrd"]
    result = read_log(log := tmp_path / "out" / "short.linear.rrd")
    assert result.simulation.t[-1] == pytest.approx(12.0)
    assert result.growth is None
    said = " ".join(capsys.readouterr().out.split())
    peak, predicted = (math.degrees(float(of.amplitude[0])) for of in (result.measurement, result.prediction))
    for words in (
        "1.8065",
        f"with {len(result.simulation.events)} events.",
        f"Peaks, predicted ones in brackets: angle {peak:.4g}° ({predicted:.4g}°).",
        f"show icmj replay {log}",
    ):
        assert words in said, words
    assert main(["run", str(run_file), "--plant", "linear", "--study", "--out", str(tmp_path / "out")]) == 0
    assert read_log(log).growth is not None


@pytest.mark.parametrize(("arguments", "words"), [
    (["analyse"], "arguments are required: PATH"),
    (["analyse", "none.toml"], "none.toml: cannot be read"),
    (["analyse", "bad.toml"], "bad.toml: not TOML"),
    (["analyse", "lost.toml"], "no such model file"),
    (["run", "lost.toml"], "no such model file"),
    (["cycle", "lost.toml"], "no such model file"),
    (["continue", "lost.toml", "--parameter", "strength", "--to", "1"], "no parameter 'strength'"),
    (["continue", "lost.toml", "--parameter", "b", "--to", "2"], "no such model file"),
    (["run", "lost.toml", "--plant", "paper"], "--plant"),
    (["study", "lost.toml"], "no such model file"),
    (["study", "empty"], "no run file"),
    (["study", "--jobs", "0", "lost.toml"], "--jobs 0"),
    (["report", "none.rrd"], "none.rrd"),
    (["report"], "at least one log"),
    (["replay", "none.rrd", "--screenshot", "a.png"], "none.rrd"),
    (["linearise", "bad.toml"], "bad.toml: not a usable MJCF model"),
    (["dance"], "dance"),
    (["analyse", "bad.toml", "--yaml"], "--yaml"),
])  # fmt: skip
def test_bad_input_is_one_line_status_2_and_no_file(arguments, words, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "bad.toml").write_text("x = [\n3 = 4")
    lost = 'case = { name = "lost", title = "Lost" }\nassumed.model = "gone.xml"\ncontroller.q_t = 0.01\n'
    (tmp_path / "lost.toml").write_text(lost)
    before = sorted(tmp_path.rglob("*"))
    assert main(arguments) == 2
    out, err = capfd.readouterr()
    (line,) = told(err.strip())
    assert words in line
    assert "Traceback" not in err + out
    assert sorted(tmp_path.rglob("*")) == before


def test_a_notice_on_a_case_is_told_once():
    class Told:
        def __init__(self, case, plant, *notices):
            self.case, self.plant, self.notices = case, plant, notices

    runs = [Told("a", "linear", "both"), Told("a", "mujoco", "both", "one"), Told("b", "mujoco", "both")]
    assert list(collect_notes(runs)) == ["a: both", "a (mujoco): one", "b (mujoco): both"]


DRIFT = """
[case]
name = "drift"
title = "An output that nothing but a drift moves"
[assumed]
A = [[0, 1, 0], [1, 0, 0], [1, 0, 0]]
B = [0, 1, 0]
C = [[1, 0, 0], [0, 0, 1]]
states = ["hinge", "hinge_rate", "place"]
inputs = ["torque"]
outputs = ["angle", "place"]
[actual]
gain = 0.8
[design]
k = [4.31662479, 2.9382392, 0]
L = [[4.70103725, 0], [11.04987562, 0], [0, 0]]
[controller]
Q_t = [1.0, 0.0, 0.0]
q_t = 0.01
delta_min = 0.01
[simulation]
duration = 10.0
initial = { hinge = 0.02 }
"""


def test_a_number_that_there_is_not_is_a_dash_with_its_reason_or_null(tmp_path, shell):
    file, why = tmp_path / "drift.toml", "a neutral mode may add any constant"
    file.write_text(DRIFT, encoding="utf-8")
    shown = shell.says(["analyse", str(file)])
    assert not re.search(r"\b(nan|inf)\b", shown)
    assert sum(line.rstrip().endswith(" –") for line in shown.splitlines()) >= 1
    assert f"A dash stands where there is no number: {why}." in " ".join(shown.split())
    found = shell.answers(["analyse", str(file), "--json"])
    assert found["amplitude"][1] is None
    assert found["missing"] == why
    seen = icmj.prepare(icmj.load_run(file)).prediction
    unseen = replace(seen.orbit, gamma=np.inf, y_peak=np.full(2, np.inf))
    unseen = replace(seen, orbit=unseen, gamma=np.inf, amplitude=unseen.y_peak)
    assert unseen.missing == "the event rule does not detect this orbit"


@pytest.mark.slow
def test_noise_slower_than_the_run_is_told_with_what_this_one_has(root, tmp_path, shell):
    noise = '[[simulation.disturbance]]\nkind = "noise"\ninput = "torque"\nsize = 0.002\nseed = 5\nbandwidth = {}\n'
    text = (root / "runs" / "simple-0.8.toml").read_text(encoding="utf-8").replace("../models", str(root / "models"))
    slow, fast, file = (tmp_path / name for name in ("slow.toml", "fast.toml", "simple-0.8.linear.rrd"))
    slow.write_text(text.replace("[study]", noise.format(0.02) + "[study]"), encoding="utf-8")
    fast.write_text(text.replace("[study]", noise.format(2.0) + "[study]"), encoding="utf-8")
    case = icmj.prepare(icmj.load_run(slow))
    t = np.arange(0, 40, 1e-3)
    acting = make_disturbance(case.settings.disturbance, ("torque",))(t)[:, 0]
    told = f"whose SD is {acting.std():.2g} about a mean of {acting.mean():.2g} with this seed (nominal 0.002;"
    # another duration or seed of the same case is told anew
    later = case.run.with_(**{"simulation.duration": 2000.0, "simulation.record_interval": 1.0})
    assert not revise(case, later).notices
    assert str(revise(case, case.run.with_(**{"simulation.disturbance[0].seed": 6})).notices) != str(case.notices)
    assert "slow" not in shell.says(["analyse", str(fast)])
    commands = [
        ["analyse", str(slow)],
        ["analyse", str(slow), "--json"],
        ["run", str(slow), "--plant", "linear", "--out", str(tmp_path)],
        ["report", str(file), "--out", str(tmp_path / "report.html")],
        ["measure", str(file)],
        ["measure", str(file), "--json"],
    ]
    for command in commands:
        assert told in " ".join(shell.says(command).split()), command
    assert "too short for the slow noise" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_what_libraries_do_when_the_interpreter_ends_changes_no_status(tmp_path):
    """Of 191 refusals of a CSV two aborted after their message: a thread was at work while the interpreter ended."""
    script = (
        "import atexit, os, sys\natexit.register(os.abort)\n"
        "from icmj.cli.main import entry\nsys.argv = ['icmj', *sys.argv[1:]]\nentry()"
    )
    (tmp_path / "a.csv").write_text("t,a\n0,1\n1,x\n")
    for command, status in ((["measure", str(tmp_path / "a.csv")], 2), (["--version"], 0)):
        done = subprocess.run([sys.executable, "-c", script, *command], capture_output=True, text=True, check=False)
        assert done.returncode == status
        assert len(told(done.stdout + done.stderr)) == 1


@pytest.mark.parametrize("there", [False, True])
def test_what_fails_while_it_runs_names_its_file_and_leaves_no_folder(there, root, tmp_path, monkeypatch, capsys):
    """524288 stretches of motion to be remembered are found only while the run goes on."""

    def fail(*args: object, **kwargs: object) -> None:
        raise SimulationError("too much is to be remembered")

    monkeypatch.setattr("icmj.case.case.simulate", fail)
    out, run = tmp_path / "out", root / "runs" / "rivals" / "one-link-switching.toml"
    if there:
        out.mkdir()
    assert main(["run", str(run), "--yes", "--out", str(out)]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == f"icmj: {run}: too much is to be remembered"
    assert out.exists() == there
