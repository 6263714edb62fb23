"""Code of the user's own: from the run file to the log, the report and the replay, and never run unasked."""

import json
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from icmj import Sinusoids, load_run, prepare, run_case, simulate, write_log
from icmj.case.case import expect_known
from icmj.cli.main import main
from icmj.controller.rules.quadratic import EventTrigger
from icmj.controller.trigger import RecordedRule
from icmj.errors import AnalysisError, ModelError, RunFileError
from icmj.log.reader import read_log, read_summary
from icmj.work.own_code import Code, digest_of, reference_of
from icmj.work.shipped import RUNS

RULES = '''
"""Rules of somebody's own."""
from __future__ import annotations
from dataclasses import dataclass, replace
import numpy as np
from icmj import EventRule
from icmj.controller import Faces, sines

@dataclass(frozen=True, eq=False)
class Diamond(EventRule):
    """|e_1|/a + |e_2|/b reaches 1: two pairs of parallel faces."""
    a: float
    b: float
    delta_min: float = 0.0

    @property
    def size(self):
        return self.a

    def resized(self, size):
        return replace(self, a=size, b=self.b * size / self.a)

    def faces(self, design):
        R = np.zeros((2, design.plant.n))
        R[:, 0], R[:, 1] = 1 / self.a, [1 / self.b, -1 / self.b]
        return Faces(R, np.arange(3))

    def facts(self):
        return {"a": self.a, "b": self.b}

def halved(design, share=0.5):
    return share * design.A_c

def heavier(spec, rho, factor=2.0):
    for body in spec.bodies:
        if body.name != "world":
            body.mass *= 1 + rho * (factor - 1)
            body.inertia = np.asarray(body.inertia) * (1 + rho * (factor - 1))

def longest(simulation):
    return {"longest interval [s]": simulation.events.interval.max(initial=0.0)}

def nothing(simulation):
    return "nothing"

def tremor(duration, size, seed=0):
    """Two sinusoids, and one in the second half of the run."""
    phase = np.random.default_rng(seed).uniform(0, 6, 3)
    rows = [(size, 50.0, phase[0], 0.0, np.inf), (size / 2, 71.0, phase[1], 0.0, np.inf)]
    return [*rows, (size / 3, 9.0, phase[2], duration / 2, np.inf)]

def staircase(duration, step, size):
    """A step of the set-point every ``step`` [s]."""
    times = np.arange(step, duration, step)
    return np.column_stack([np.full(len(times), size), *2 * [np.zeros(len(times))], times, times])

def swaying(size):
    return sines(size, 0.5, 0.3)

def broken(*given, **named):
    raise KeyError("a mistake of mine")
'''
RUN = """
[case]
name = "own"
title = "Own"
[assumed]
model = "{model}"
keyframe = "upright"
[actual]
gain = 0.8
[design]
R_c = 0.1
R_o = 0.01
[controller]
rule = "rules:Diamond"
parameters = {{ a = 0.01, b = 0.05 }}
delta_min = 0.02
[simulation]
duration = 6.0
initial = {{ hinge = 0.02 }}
[study]
growth_points = 2
measures = ["rules:longest"]
"""


@pytest.fixture
def own(tmp_path: Path, root: Path) -> Path:
    (tmp_path / "rules.py").write_text(RULES, encoding="utf-8")
    path = tmp_path / "own.toml"
    path.write_text(RUN.format(model=(root / "models" / "pendulum.xml").as_posix()), encoding="utf-8")
    return path


def test_a_rule_goes_from_run_file_to_log_report_and_replay(own: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = own.parent / "out"
    assert main(["run", str(own), "--out", str(out)]) == 2
    assert "rules:Diamond names Python code, which is not run unasked" in capsys.readouterr().err
    for plant in ("linear", "mujoco"):
        assert main(["run", str(own), "--out", str(out), "--allow-code", "--plant", plant]) == 0
    logs = [out / f"own.{plant}.rrd" for plant in ("linear", "mujoco")]
    assert main(["report", *map(str, logs), "--out", str(out / "report.html")]) == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "rules:Diamond" in page
    result = read_log(logs[1])
    assert read_summary(logs[1])["measures"]["longest interval [s]"] == result.simulation.events.interval.max()
    # what is drawn for a replay is made of the log alone
    write_log(result, out / "again.rrd")
    rule = read_log(out / "again.rrd").controller.trigger
    assert isinstance(rule, RecordedRule)


def test_the_rule_decides(own: Path) -> None:
    """Every event is where |e_1|/a + |e_2|/b is 1, and nowhere before it is more."""
    case = prepare(load_run(own, allow_code=True))
    run = simulate(case, "linear")
    e = run.events.x_h - run.events.x_o
    assert len(run.events) > 5
    np.testing.assert_allclose(np.abs(e[:, 0]) / 0.01 + np.abs(e[:, 1]) / 0.05, 1, rtol=1e-9)
    e = run.x_h - run.x_o
    assert (np.abs(e[:, 0]) / 0.01 + np.abs(e[:, 1]) / 0.05).max() < 1 + 1e-9
    assert case.rule.delta_min == 0.02


def test_a_log_is_read_where_the_code_is_not(own: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    result = run_case(load_run(own, allow_code=True), "linear")
    rule, log = result.controller.trigger, own.parent / "own.rrd"
    write_log(result, log)
    faces = rule.faces(result.controller.design)  # type: ignore[attr-defined]
    for allowed in (False, True):
        found = read_log(log, allow_code=allowed).controller.trigger
        assert isinstance(found, RecordedRule) is not allowed
        assert found.faces(result.controller.design).R.tobytes() == faces.R.tobytes()
    again = read_log(log, allow_code=True).controller.trigger
    assert reference_of(again) == "rules:Diamond"
    assert (again.a, again.b, again.delta_min) == (0.01, 0.05, 0.02)  # type: ignore[attr-defined]
    # of another source, it is another rule
    (own.parent / "rules.py").write_text(RULES.replace("1 / self.a", "2 / self.a"), encoding="utf-8")
    assert isinstance(read_log(log, allow_code=True).controller.trigger, RecordedRule)
    (own.parent / "rules.py").unlink()
    kept = read_log(log, allow_code=True).controller.trigger
    assert isinstance(kept, RecordedRule)
    assert (kept.reference, kept.sha256) == ("rules:Diamond", read_log(log).controller.trigger.sha256)  # type: ignore[attr-defined]
    assert kept.parameters == {"a": 0.01, "b": 0.05, "delta_min": 0.02}
    np.testing.assert_allclose(kept.resized(0.02).faces(result.controller.design).R, faces.R / 2, rtol=1e-15)


def test_a_source_that_was_changed_is_not_run(own: Path) -> None:
    log = own.with_suffix(".rrd")
    write_log(run_case(load_run(own, allow_code=True), "linear"), log)
    source, trace = own.parent / "rules.py", own.parent / "it-ran"
    source.write_text(source.read_text(encoding="utf-8") + f"\nopen({str(trace)!r}, 'w').close()\n", encoding="utf-8")
    assert isinstance(read_log(log, allow_code=True).controller.trigger, RecordedRule)
    assert not trace.exists()


def test_a_hold_of_ones_own(own: Path) -> None:
    run = load_run(own, allow_code=True).with_(**{"controller.hold": "rules:halved"})
    controller = prepare(run).controller
    np.testing.assert_array_equal(controller.hold.A_h, 0.5 * controller.design.A_c)
    assert controller.hold.name == "rules:halved"
    whole = prepare(run.with_(**{"controller.hold_parameters": {"share": 1.0}})).controller
    np.testing.assert_array_equal(whole.hold.A_h, whole.design.A_c)


def test_a_change_in_code_is_the_change_in_words(own: Path) -> None:
    plain = load_run(own, allow_code=True)
    in_words = prepare(plain.with_(**{"actual.change": [{"what": "mass", "factor": 2.0}], "actual.rho": 0.5}))
    in_code = prepare(plain.with_(**{"actual.edit": "rules:heavier", "actual.rho": 0.5}))
    pushed = (of.actual.linearisation.plant.B_d for of in (in_code, in_words))
    np.testing.assert_allclose(*pushed, rtol=1e-12, atol=1e-12)
    assert not np.allclose(in_code.actual.linearisation.plant.B_d, prepare(plain).actual.linearisation.plant.B_d)


def test_noise_of_ones_own_is_drawn_once_and_a_log_keeps_it(own: Path, shell) -> None:
    table = {"kind": "rules:tremor", "input": "torque", "parameters": {"size": 0.01, "seed": 3}}
    run = load_run(own, allow_code=True).with_(**{"simulation.disturbance": [table]})
    own.write_text(run.text, encoding="utf-8")
    assert "which is not run unasked" in shell.refuses(["run", str(own), "--out", str(own.parent), "--plant", "linear"])
    names: dict[str, object] = {}
    exec(RULES, names)
    rows = names["tremor"](6.0, 0.01, 3)  # type: ignore[operator]
    for plant in ("linear", "mujoco"):
        result = run_case(run, plant)
        assert result.simulation.noisy
        case = prepare(run)
        given = replace(case.settings, disturbance=(Sinusoids(input="torque", terms=tuple(rows)),))
        same = simulate(replace(case, settings=given), plant)
        np.testing.assert_array_equal(same.x, result.simulation.x)
        # d(t) is what the function says
        half = same.t >= 3.0
        waves = [a * np.cos(w * same.t + phi) * (half if start else 1.0) for a, w, phi, start, _ in rows]
        np.testing.assert_allclose(same.applied[:, 0] - same.u[:, 0], np.sum(waves, axis=0), atol=1e-15)
        write_log(result, own.with_suffix(".rrd"))
        source = (own.parent / "rules.py").read_text(encoding="utf-8")
        (own.parent / "rules.py").unlink()
        back = read_log(own.with_suffix(".rrd"))
        (kept,) = back.run.simulation.disturbance
        assert (kept.kind, kept.made_by, len(kept.sha256)) == ("sinusoids", "rules:tremor", 64)  # type: ignore[union-attr]
        assert back.to_series(100.0).values.shape == result.to_series(100.0).values.shape
        (own.parent / "rules.py").write_text(source, encoding="utf-8")


@pytest.mark.parametrize(("table", "words"), [
    ({"kind": "rules:absent"}, "the module has no 'absent'"),
    ({"kind": "rules:nothing", "parameters": {"simulation": 1.0}}, "expected rows"),
    ({"kind": "rules:broken"}, "a mistake of mine"),
    ({"kind": "rules:tremor"}, "fails"),
    ({"kind": "sinusoid"}, "or the module:name of code of your own, got 'sinusoid'; did you mean sinusoids"),
    ({"kind": "sinusoids", "terms": []}, "0 terms: expected between 1 and 2000"),
    ({"kind": "sinusoids", "terms": [[1.0, 2.0]]}, "has 2 entries"),
    ({"kind": "sinusoids", "terms": [[1.0, 2.0, 3.0, 1.0]]}, "got 4 numbers"),
    ({"kind": "sinusoids", "terms": [[1.0, -2.0, 3.0]]}, "is negative"),
    ({"kind": "sinusoids", "terms": [[1.0, 2.0, 3.0, 2.0, 1.0]]}, "to a later end"),
])  # fmt: skip
def test_noise_that_is_none_is_one_line(own: Path, table: dict, words: str) -> None:
    with pytest.raises(RunFileError, match=words):
        prepare(load_run(own, allow_code=True).with_(**{"simulation.disturbance": [{"input": "torque"} | table]}))


def test_a_set_point_of_ones_own_is_followed_and_a_log_keeps_it(own: Path, shell) -> None:
    stairs = {"kind": "rules:staircase", "output": "angle", "start": 0.5, "parameters": {"step": 1.5, "size": 0.01}}
    sway = {"kind": "rules:swaying", "output": "angle", "start": 2.0, "parameters": {"size": 0.005}}
    run = load_run(own, allow_code=True).with_(setpoint=[stairs, sway])
    own.write_text(run.text, encoding="utf-8")
    assert "which is not run unasked" in shell.refuses(["run", str(own), "--out", str(own.parent), "--plant", "linear"])
    for plant in ("linear", "mujoco"):
        result = run_case(run, plant)
        t, r = result.simulation.t, result.simulation.r[:, 0]
        expected = 0.01 * sum((t >= at).astype(float) for at in (2.0, 3.5, 5.0))
        expected += np.where(t >= 2.0, 0.005 * np.sin(np.pi * (t - 2.0) + 0.3), 0.0)
        np.testing.assert_allclose(r, expected, atol=1e-12)
        write_log(result, own.with_suffix(".rrd"))
        source = (own.parent / "rules.py").read_text(encoding="utf-8")
        (own.parent / "rules.py").unlink()
        back = read_log(own.with_suffix(".rrd"))
        np.testing.assert_array_equal(back.simulation.r[:, 0], r)
        kept = [(table.kind, table.made_by, len(table.sha256)) for table in back.run.setpoint]  # type: ignore[attr-defined]
        assert kept == [("sinusoids", "rules:staircase", 64), ("sinusoids", "rules:swaying", 64)]
        # what the log has is the set-point, without the code; a longer one only the code knows
        again = run_case(back.run.with_(**{"controller.rule": "box", "controller.threshold": 0.01,
                                           "controller.parameters": None, "study.measures": []}), "linear")  # fmt: skip
        np.testing.assert_array_equal(again.simulation.setpoint(t)[:, 0], result.simulation.setpoint(t)[:, 0])
        (own.parent / "rules.py").write_text(source, encoding="utf-8")
    with pytest.raises(RunFileError, match="set-point of kind 'sinusoids' is known for a run of 6 s, not of 8 s"):
        expect_known(result.run, 8.0, 6.0, result.run.setpoint)


def test_a_case_that_follows_a_set_point_of_ones_own_goes_through_a_pickle(own: Path) -> None:
    """As from one process to another."""
    table = {"kind": "rules:swaying", "output": "angle", "parameters": {"size": 0.005}}
    changes = {"controller.rule": "quadratic", "controller.q_t": 0.01, "controller.parameters": None}
    case = prepare(load_run(own, allow_code=True).with_(setpoint=[table], **changes))
    again = pickle.loads(pickle.dumps(case.controller))
    t = np.linspace(0.0, 6.0, 50)
    np.testing.assert_array_equal(again.setpoint(t), case.controller.setpoint(t))  # type: ignore[attr-defined, misc]


@pytest.mark.parametrize(("table", "words"), [
    ({"kind": "rules:absent"}, "the module has no 'absent'"),
    ({"kind": "rules:nothing", "parameters": {"simulation": 1.0}}, "rows .a, ω, φ, start, end., got 'nothing'"),
    ({"kind": "rules:broken"}, "a mistake of mine"),
    ({"kind": "rules:staircase"}, "fails"),
    ({"kind": "sinusoids", "rate": []}, "has 0 entries; expected at least 1"),
    ({"kind": "sinusoids", "rate": [[1.0, 2.0, 3.0]]}, "setpoint"),
    ({"kind": "sinusoids", "rate": [[1.0, 2.0, 3.0, 2.0, 1.0]]}, "times not negative"),
    ({"kind": "stair"}, "or the module:name of code of your own, got 'stair'"),
])  # fmt: skip
def test_a_set_point_that_is_none_is_one_line(own: Path, table: dict, words: str) -> None:
    with pytest.raises((RunFileError, AnalysisError), match=words) as told:
        prepare(load_run(own, allow_code=True).with_(setpoint=[{"output": "angle"} | table]))
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(("changes", "error", "words"), [
    ({"controller.rule": "absent:Rule"}, RunFileError, "importing it fails"),
    ({"controller.rule": "rules:Absent"}, RunFileError, "the module has no 'Absent'"),
    ({"controller.rule": "rules:halved"}, RunFileError, "fails"),
    ({"controller.rule": "rules:broken"}, RunFileError, "a mistake of mine"),
    ({"controller.parameters": {"c": 1.0}}, RunFileError, "fails"),
    ({"controller.q_t": 0.1}, RunFileError, "has no key q_t"),
    ({"controller.rule": "box", "controller.threshold": 0.1}, RunFileError, "the box rule has no parameters"),
    ({"controller.hold": "rules:broken"}, RunFileError, "a mistake of mine"),
    ({"controller.hold_parameters": {"a": 1}}, RunFileError, "hold has no parameters"),
    ({"actual.edit": "rules:broken"}, ModelError, "a mistake of mine"),
])  # fmt: skip
def test_what_is_wrong_is_one_line(own: Path, changes: dict, error: type, words: str) -> None:
    with pytest.raises(error, match=words):
        prepare(load_run(own, allow_code=True).with_(**changes))


def test_a_measure_that_gives_no_numbers_is_told(own: Path) -> None:
    run = load_run(own, allow_code=True).with_(**{"study.measures": ["rules:nothing"]})
    with pytest.raises(RunFileError, match="must return numbers by name, and returned 'nothing'"):
        run_case(run, "linear")


@pytest.mark.parametrize("name", ["simple-0.8", "one-link-delayed-pd"])
@pytest.mark.parametrize(("reference", "allowed", "words"), [
    ("rules:longest", [], "rules:longest names Python code, which is not run unasked"),
    ("rules:absent", ["--allow-code"], "the module has no 'absent'"),
])  # fmt: skip
def test_a_measure_that_cannot_be_taken_costs_no_run(
    tmp_path, root, monkeypatch, shell, name, reference, allowed, words
) -> None:
    """It was refused after the run, of which nothing was left."""
    text = RUNS.meant(Path(name)).read_text(encoding="utf-8").replace("../", "").partition("[study]")
    (tmp_path / "models").symlink_to(root / "models")
    study = f"[study]\nmeasures = ['{reference}']\n{text[2]}"
    (tmp_path / "own.toml").write_text(f"{text[0]}\n{study}", encoding="utf-8")
    (tmp_path / "rules.py").write_text(RULES, encoding="utf-8")
    (tmp_path / "sweep.toml").write_text(SWEEP, encoding="utf-8")
    monkeypatch.setattr("icmj.case.case.simulate_plant", ran)
    for command in (
        ["run", "own.toml", "--plant", "linear"],
        ["study", "own.toml", "--jobs", "1"],
        ["sweep", "sweep.toml"],
    ):
        monkeypatch.chdir(tmp_path)
        assert words in shell.refuses([*command, "--out", "out", *allowed])
        assert not (tmp_path / "out").exists()
    run = load_run(tmp_path / "own.toml", allow_code=bool(allowed))
    with pytest.raises(RunFileError, match=words):
        run_case(run, "linear")


SWEEP = """
[sweep]
name = "own"
run = "own.toml"
[[vary]]
field = "simulation.duration"
values = [5.0, 6.0]
[ask]
motion = ["linear"]
"""


def ran(*given: object, **named: object) -> None:
    raise AssertionError("it was simulated")


def test_reading_runs_nothing(own: Path) -> None:
    (own.parent / "rules.py").write_text("raise SystemExit('it was run')", encoding="utf-8")
    run = load_run(own)
    with pytest.raises(RunFileError, match="not run unasked"):
        prepare(run)
    with pytest.raises(RunFileError, match="not run unasked"):
        Code(own.parent).find("rules:Diamond")


def test_an_object_is_taken_by_the_api(own: Path) -> None:
    """What a run file names, a script passes."""
    case = prepare(load_run(own, allow_code=True))
    run = simulate(case, "linear", trigger=EventTrigger(np.eye(2), 0.01, 0.02))
    assert len(run.events) > 0
    assert digest_of(case.rule) == digest_of(Code(own.parent, True).find("rules:Diamond"))


@pytest.mark.slow
def test_summary_has_what_measures_say(own: Path, shell) -> None:
    out = own.parent / "study"
    shell.says(["study", str(own), "--out", str(out), "--allow-code", "--jobs", "2"])
    records = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    rows = records if isinstance(records, list) else records["cases"]
    assert {row["measures"]["longest interval [s]"] > 0 for row in rows} == {True}
