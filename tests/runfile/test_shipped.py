"""Run files and models that come with icmj: found by name from any folder, after what lies in it."""

from pathlib import Path

import pytest
from terminal_cases import told

import icmj
from icmj.cli.main import main
from icmj.errors import ModelError, RunFileError
from icmj.runfile.reading import load_run, parse_run
from icmj.study.run_files import find_runs
from icmj.work.shipped import MODELS, RUNS, Shelf, model_file


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


RUN = """
case = { name = "mine", title = "Mine" }
assumed = { model = "three_link", keyframe = "upright" }
actual = { model = "three_link", gain = 0.9 }
design = { R_c = 1e-6, R_o = 0.1 }
controller = { q_t = 0.01 }
simulation = { duration = 1.0, initial = { ankle = 0.02 } }
"""


def test_a_model_is_found_by_its_name_wherever_a_file_is(elsewhere, root):
    """In a run file, in its log on a machine without it, in files of runs, and in Python."""
    model = root / "models" / "three_link.xml"
    run = parse_run(RUN, elsewhere / "mine.toml")
    assert run.assumed_path.resolve() == run.actual_path.resolve() == model
    assert run.fingerprint == parse_run(RUN.replace('"three_link"', f'"{model.as_posix()}"'), "mine.toml").fingerprint
    assert icmj.load_plant("three_link").xml == icmj.load_plant(model).xml
    # a file of that name beside the run file comes first
    (elsewhere / "three_link").write_text(model.read_text(encoding="utf-8"), encoding="utf-8")
    assert run.assumed_path == elsewhere / "three_link"
    with pytest.raises(ModelError, match=r"three_lnk: no such model file; did you mean three_link\?"):
        icmj.load_plant(Path(elsewhere, "three_lnk"))


def test_a_log_holds_the_shipped_model_that_its_run_file_names(elsewhere, monkeypatch):
    (elsewhere / "mine.toml").write_text(RUN, encoding="utf-8")
    result = icmj.run_case(load_run("mine.toml"), "linear")
    icmj.write_log(result, elsewhere / "mine.rrd")
    (elsewhere / "mine.toml").unlink()
    monkeypatch.setattr(Shelf, "files", {})  # an installation that does not ship it
    back = icmj.read_log(elsewhere / "mine.rrd")
    with back.run.at_hand() as run:
        assert icmj.prepare(run).prediction.delta_crit == pytest.approx(result.prediction.delta_crit, rel=1e-12)


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
    with pytest.raises(RunFileError, match=rf"cannot be read \(No such file or directory\); did you mean {meant}\?"):
        load_run(given)


def test_what_is_like_nothing_is_only_missing_and_a_bare_name_is_told_all_shipped_ones():
    with pytest.raises(RunFileError, match=r"cannot be read \(No such file or directory\)$"):
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
