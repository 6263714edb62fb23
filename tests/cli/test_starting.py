"""``icmj new``: a run file to begin with; what is there is not overwritten."""

import json
from pathlib import Path

import pytest
from terminal_cases import told

from icmj.cli import files
from icmj.cli.main import main
from icmj.cli.terminal import Terminal
from icmj.runfile.reading import load_run
from icmj.work.own_code import EXPERIMENTS, RUNS, SWEEPS


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_model_gets_a_run_file_that_analyse_takes(capsys):
    assert main(["new", "pendulum"]) == 0
    shown = capsys.readouterr().out
    assert "run file  pendulum.toml" in shown
    assert "inputs    torque" in shown
    assert "Δ_crit = " in shown
    assert main(["analyse", "pendulum.toml"]) == 0
    assert "attracting" in capsys.readouterr().out
    before = Path("pendulum.toml").read_bytes()
    assert main(["new", "pendulum"]) == 2
    assert capsys.readouterr().err == "icmj: pendulum.toml: exists already; choose another name with --out\n"
    assert Path("pendulum.toml").read_bytes() == before
    assert main(["new", "pendulum", "--out", "another.toml"]) == 0
    assert load_run("another.toml").case.name == "pendulum"


def test_the_weights_are_told_and_that_shipped_cases_have_others(capsys):
    """Δ_crit was 0.4045 s where the tutorial's was 0.7594 s, and nothing said why."""
    assert main(["new", "three_link"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "weights R_c = 2e-05, R_o = 2e-06, from the gain of the plant" in shown
    told = "the shipped case three-link-0.9 has this model with R_c = 5e-07 and R_o = 2e-07, and so another Δ_crit"
    assert told in shown
    assert main(["new", "three-link-0.9"]) == 0


def test_a_name_that_is_none_is_told_the_shipped_ones(capsys):
    for command, listed in (
        ("analyse", "shipped cases: neglected-0.1, "),
        ("sweep", "shipped sweeps: basins, "),
        ("experiment", "shipped experiments: double-step"),
        ("new", "shipped models: one_link, pendulum, "),
    ):
        assert main([command, "nosuch"]) == 2
        assert listed in capsys.readouterr().err
    assert main(["analyse", "none/such.toml"]) == 2
    assert "shipped" not in capsys.readouterr().err


def test_a_value_changed_by_set_is_not_told_that_the_paper_has_another(capsys, elsewhere):
    assert main(["analyse", "three-link-0.9", "--set", "actual.gain=0.85"]) == 0
    assert "case.paper" not in capsys.readouterr().out
    command = ["run", "simple-0.8", "--plant", "linear", "--out", "out", "--set", "simulation.duration=3"]
    assert main([*command, "--set", "actual.gain=0.85"]) == 0
    assert "case.paper" not in capsys.readouterr().out
    assert main(["new", "simple-0.8", "--out", "mine.toml"]) == 0
    mine = elsewhere / "mine.toml"
    mine.write_text(mine.read_text(encoding="utf-8").replace("gain = 0.8", "gain = 0.85"), encoding="utf-8")
    assert main(["analyse", "mine.toml"]) == 0
    assert "differs from the published case" in capsys.readouterr().out


def test_a_shipped_case_comes_with_its_models(capsys, root):
    assert main(["new", "neglected-0.1", "--out", "mine.toml"]) == 0
    assert {path.name for path in Path().iterdir()} == {"mine.toml", "pendulum.xml", "pendulum_neglected.xml"}
    run, shipped = load_run("mine.toml"), load_run("neglected-0.1")
    assert run.assumed_path.parent == Path()
    assert run.fingerprint == shipped.fingerprint
    assert run.case.paper == shipped.case.paper
    capsys.readouterr()
    Path("three_link.xml").write_text("<mujoco/>")
    assert main(["new", "three-link-0.9"]) == 2
    assert "three_link.xml: exists already and is another model" in capsys.readouterr().err
    assert not Path("three-link-0.9.toml").exists()
    assert Path("three_link.xml").read_text() == "<mujoco/>"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["pendulm"], "pendulm: no such model file; did you mean pendulum?"),
        (["pendulum", "--out", "none/x.toml"], "none/x.toml: no such folder"),
        (["pendulum", "--keyframe", "lying"], "no keyframe 'lying'; it has upright"),
        (["bad.xml"], "bad.xml: not a usable MJCF model"),
    ],
)
def test_what_is_not_there_is_one_line_and_no_file(words, said, capsys, elsewhere):
    (elsewhere / "bad.xml").write_text("<mujoco")
    assert main(["new", *words]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(told(err)) == 1
    assert [path.name for path in elsewhere.iterdir()] == ["bad.xml"]


def test_what_is_in_the_way_is_a_note(capsys, elsewhere):
    (elsewhere / "loose.xml").write_text(
        '<mujoco><worldbody><body><joint name="a"/><geom size="1"/></body></worldbody></mujoco>'
    )
    assert main(["new", "loose.xml"]) == 0
    assert "note: it does not run as written: model" in capsys.readouterr().out
    assert (elsewhere / "loose.toml").exists()


def test_all_that_is_shipped_is_listed_whole_at_sixty_columns(capsys, monkeypatch):
    """A name that no command knew was answered by a row of names, and nothing said what they are."""
    assert main(["cases", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    names = [one["name"] for kind in ("cases", "rivals", "joystick") for one in listed[kind]]
    assert sorted(names) == sorted(RUNS.files)
    assert [one["name"] for one in listed["sweeps"]] == list(SWEEPS.files)
    assert [one["name"] for one in listed["experiments"]] == list(EXPERIMENTS.files)
    monkeypatch.setattr(files, "OUT", terminal := Terminal(width=60, force_terminal=True, color_system=None))
    assert main(["cases"]) == 0
    shown = capsys.readouterr().out
    assert max(map(len, shown.splitlines())) <= terminal.width
    words = " ".join(shown.split())
    for one in (one for kind in listed.values() for one in kind):
        assert one["about"].endswith(".")
        assert 30 < len(one["about"]) < 200
        assert f"{one['name']}: {one['title']} {one['about']}" in words
    assert main(["analyse", "nosuch"]) == 2
    assert capsys.readouterr().err.endswith("; icmj cases describes them\n")
