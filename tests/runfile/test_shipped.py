"""Run files and models that come with icmj: found by name from any folder, after what lies in it."""

from pathlib import Path

import pytest
from terminal_cases import told

from icmj.cli.main import main
from icmj.errors import ModelError, RunFileError
from icmj.runfile.reading import load_run
from icmj.runfile.shipped import MODELS, RUNS, model_file
from icmj.study.study import find_runs


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_in_a_checkout_they_are_the_checkout_s(root):
    assert RUNS.folder == root / "runs"
    assert MODELS.folder == root / "models"
    there = [*(root / "runs").glob("*.toml"), *(root / "runs" / "rivals").glob("*.toml")]
    there += (root / "runs" / "joystick").glob("*.toml")
    assert {path.name for path in there} == {path.name for path in RUNS.files.values()}


def test_a_bare_name_is_the_shipped_case(root):
    run = load_run("three-link-0.9")
    assert run.path == root / "runs" / "three-link-0.9.toml"
    assert run.assumed_path.is_file()
    assert model_file(Path("three_link")) == root / "models" / "three_link.xml"


def test_every_case_has_the_name_of_its_file():
    assert {name: load_run(name).case.name for name in RUNS.files} == {name: name for name in RUNS.files}


def test_what_lies_in_the_folder_comes_first(elsewhere, root):
    text = (root / "runs" / "simple-0.8.toml").read_text(encoding="utf-8").replace("gain = 0.8 ", "gain = 0.7 ")
    (elsewhere / "three-link-0.9").write_text(text, encoding="utf-8")
    assert load_run("three-link-0.9").actual.gain == 0.7
    assert load_run(Path("three-link-1.1")).actual.gain == 1.1


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("three-link-0.8", "three-link-0.9"),
        ("runs/simple-0.8.toml", "simple-0.8"),
        ("simpel-1.2", "simple-1.2"),
        ("my-caes.toml", "my-case.toml"),
        ("folder/mine.tml", "folder/mine.toml"),
    ],
)
def test_a_near_miss_is_told(given, meant, elsewhere):
    (elsewhere / "my-case.toml").touch()
    (elsewhere / "folder").mkdir()
    (elsewhere / "folder" / "mine.toml").touch()
    with pytest.raises(RunFileError, match=rf"cannot be read: No such file or directory; did you mean {meant}\?"):
        load_run(given)


def test_what_is_like_nothing_is_only_missing_and_a_bare_name_is_told_all_shipped_ones():
    with pytest.raises(RunFileError, match=r"cannot be read: No such file or directory$"):
        load_run("quite/another thing.toml")
    with pytest.raises(
        RunFileError,
        match=r"No such file.*; shipped cases: neglected-0.1, .*, joystick-0, .*; icmj cases describes them$",
    ):
        load_run("quite another thing")
    with pytest.raises(ModelError, match=r"thre_link.xml: no such model file; did you mean three_link\?"):
        model_file(Path("models/thre_link.xml"))


def test_a_study_of_nothing_named_is_of_the_folder_runs_or_of_all_shipped(elsewhere, root):
    ours = [name for name, path in RUNS.files.items() if path.parent.name == "runs"]  # rivals are not of the study
    assert [run.case.name for run in find_runs([])] == ours
    (elsewhere / "runs" / "out").mkdir(parents=True)  # what an earlier study left
    assert len(find_runs([])) == len(ours)
    (elsewhere / "runs" / "mine.toml").write_text((root / "runs" / "simple-0.8.toml").read_text(encoding="utf-8"))
    assert [run.path for run in find_runs([])] == [Path("runs/mine.toml")]
    assert [run.case.name for run in find_runs([Path("simple-0.8"), Path("simple-1.2")])] == [
        "simple-0.8",
        "simple-1.2",
    ]


def test_commands_take_names_of_models(capsys):
    assert main(["linearise", "pendulum", "--keyframe", "upright", "--json"]) == 0
    assert '"hinge_rate"' in capsys.readouterr().out
    assert main(["linearise", "pendulm"]) == 2
    assert told(capsys.readouterr().err) == ["icmj: pendulm: no such model file; did you mean pendulum?"]
