"""``icmj new``: a run file to begin with; what is there is not overwritten."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from terminal_cases import told

from icmj import load_family, load_run, prepare, read_sweep
from icmj.cli import terminal
from icmj.cli.commands.fit import FitCommand, list_people
from icmj.cli.main import main
from icmj.cli.terminal import Terminal
from icmj.fits.bank import simulate_bank
from icmj.fits.family_file import FamilyFile, load_family_file
from icmj.runfile.editor_schema import docstrings
from icmj.runfile.sweep_tables import SweepFile, load_sweep
from icmj.study.experiment_file import ExperimentFile, load_experiment
from icmj.study.first_file import table_of
from icmj.work.shipped import EXPERIMENTS, FAMILIES, RUNS, SWEEPS


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_model_gets_a_run_file_that_analyse_takes(shell):
    shown = shell.says(["new", "pendulum"])
    assert "run file  pendulum.toml" in shown
    assert "inputs    torque" in shown
    assert "Δ_crit = " in shown
    assert "attracting" in shell.says(["analyse", "pendulum.toml"])
    before = Path("pendulum.toml").read_bytes()
    assert shell.refuses(["new", "pendulum"]) == "icmj: pendulum.toml: exists already; choose another name with --out\n"
    assert Path("pendulum.toml").read_bytes() == before
    assert main(["new", "pendulum", "--out", "another.toml"]) == 0
    assert load_run("another.toml").case.name == "pendulum"


def test_what_was_chosen_for_b_and_whether_it_stands_are_told(capsys, shell):
    shown = " ".join(shell.says(["new", "one_link"]).split())
    b = load_run("one_link.toml").actual.gain
    assert b == 0.9
    assert f"b {b}, an example: the actual inputs do {b} of what the controller assumes (actual.gain)" in shown
    peak = prepare(load_run("one_link.toml")).prediction.amplitude[0]
    stands = f"it stands, and sways on a cycle, with peaks of lean {peak:.4g} rad ({np.degrees(peak):.4g}°)"
    assert stands in shown.replace("\N{NO-BREAK SPACE}", " ")
    for gain, words in (
        (0.9, stands),
        (1.0, "No cycle is predicted; icmj run shows whether it stands."),
        (0.1, "Even continuous feedback of this design would not hold it; icmj run shows whether it falls."),
    ):
        assert main(["analyse", "one_link.toml", "--set", f"actual.gain={gain}"]) == 0
        assert words in " ".join(capsys.readouterr().out.replace("\N{NO-BREAK SPACE}", " ").split()), gain


def test_the_weights_are_told_and_that_shipped_cases_have_others(shell):
    """Δ_crit was 0.4045 s where the tutorial's was 0.7594 s, and nothing said why."""
    shown = " ".join(shell.says(["new", "three_link"]).split())
    assert "weights R_c = 2e-05, R_o = 2e-06, from the gain of the plant" in shown
    told = "the shipped case three-link-0.9 has this model with R_c = 5e-07 and R_o = 2e-07, and so another Δ_crit"
    assert told in shown
    assert main(["new", "three-link-0.9"]) == 0


def test_a_name_that_is_none_is_told_the_shipped_ones(shell):
    for command, listed in (
        ("analyse", "shipped cases: neglected-0.1, "),
        ("sweep", "shipped sweeps: basins, "),
        ("experiment", "shipped experiments: double-step"),
        ("new", "shipped models: one_link, pendulum, "),
    ):
        assert listed in shell.refuses([command, "nosuch"])
    assert "shipped" not in shell.refuses(["analyse", "none/such.toml"])


def test_a_value_changed_by_set_is_not_told_that_the_paper_has_another(shell, elsewhere):
    assert "case.paper" not in shell.says(["analyse", "three-link-0.9", "--set", "actual.gain=0.85"])
    command = ["run", "simple-0.8", "--plant", "linear", "--out", "out", "--set", "simulation.duration=3"]
    assert "case.paper" not in shell.says([*command, "--set", "actual.gain=0.85"])
    assert main(["new", "simple-0.8", "--out", "mine.toml"]) == 0
    mine = elsewhere / "mine.toml"
    mine.write_text(mine.read_text(encoding="utf-8").replace("gain = 0.8", "gain = 0.85"), encoding="utf-8")
    assert "differs from the published case" in shell.says(["analyse", "mine.toml"])


def test_a_shipped_case_comes_with_its_models(capsys, shell, root):
    assert main(["new", "neglected-0.1", "--out", "mine.toml"]) == 0
    assert {path.name for path in Path().iterdir()} == {"mine.toml", "pendulum.xml", "pendulum_neglected.xml"}
    run, shipped = load_run("mine.toml"), load_run("neglected-0.1")
    assert run.assumed_path.parent == Path()
    assert run.fingerprint == shipped.fingerprint
    assert run.case.paper == shipped.case.paper
    capsys.readouterr()
    Path("three_link.xml").write_text("<mujoco/>")
    assert "three_link.xml: exists already and is another model" in shell.refuses(["new", "three-link-0.9"])
    assert not Path("three-link-0.9.toml").exists()
    assert Path("three_link.xml").read_text() == "<mujoco/>"


STIMULI = ("quiet_standing", "perturbed_stance", "multisine", "double_step", "intersection_point")
FILES = [("sweep", SweepFile), ("family", FamilyFile), *((stimulus, ExperimentFile) for stimulus in STIMULI)]


def file_for(what: str, *more: str) -> Path:
    """What ``icmj new`` writes of this kind, or for this kind of experiment."""
    out = Path(f"{what}.toml")
    kind = ["experiment", "--stimulus", what] if what in STIMULI else [what]
    assert main(["new", *kind, *more, "--out", str(out), "-q"]) == 0
    return out


def keys_of(text: str) -> dict[str, list[str]]:
    """The lines with a key of each table, without the # of those in comments; an entry of a list counts once."""
    found: dict[str, list[str]] = {}
    at = ""
    for line in text.splitlines():
        if head := re.fullmatch(r"(?:# )?\[\[?([a-z_]+)\]?\]", line):
            at = head[1]
        elif key := re.fullmatch(r"(?:# )?(\S+ = .+)", line):
            found.setdefault(at, []).append(key[1])
    return found


@pytest.mark.parametrize(("what", "schema"), FILES)
def test_every_key_is_in_a_first_file_with_its_meaning(what, schema, capsys):
    text = file_for(what).read_text(encoding="utf-8")
    assert "note:" not in capsys.readouterr().out
    lines = keys_of(text)
    for name, field in schema.model_fields.items():
        if name in STIMULI and name != what:
            continue
        if (table := table_of(field)) is None:
            continue
        keys = [next(iter(tomllib.loads(line))) for line in lines[name]]  # each is TOML
        assert list(dict.fromkeys(keys)) == list(table.model_fields), name
        for line, key in zip(lines[name], keys, strict=True):
            said = docstrings(table)[key].replace("`", "").split()[:5]
            assert " ".join(said) in " ".join(text.replace("\n# ", " ").split())
            default = table.model_fields[key].default
            if f"# {line}" in text.splitlines() and default not in (None, "", {}):
                assert tomllib.loads(line)[key] == (list(default) if isinstance(default, tuple) else default)
    assert max(map(len, text.splitlines())) < 220
    assert all(len(line) <= 120 for line in text.splitlines() if line.startswith("#") and " = " not in line)


def test_a_first_sweep_runs_as_it_is(shell):
    file_for("sweep")
    shown = shell.says(["sweep", "sweep.toml", "--out", "out", "--jobs", "1"])
    swept = read_sweep(Path("out"))
    assert swept.title == "Simple system, b = 0.8, over b"
    assert swept.title in shown
    assert "next     icmj report out --out out.html" in shown
    printed = [line.split() for line in shown.splitlines() if re.match(r" [01]\.\d", line)]  # the rows of its table
    assert [float(row[0]) for row in printed] == pytest.approx([0.7, 0.8, 0.9, 1.0, 1.1, 1.2])
    assert float(printed[1][1]) == pytest.approx(swept.table["predicted_delta_crit"][1].as_py(), rel=1e-3)
    assert list(swept.table["b"].to_numpy()) == pytest.approx([0.7, 0.8, 0.9, 1.0, 1.1, 1.2])
    assert swept.table["linear_interval"][1].as_py() == pytest.approx(1.80654, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("stimulus", STIMULI)
def test_a_first_experiment_runs_as_it_is(stimulus, shell):
    shown = " ".join(shell.says(["experiment", str(file_for(stimulus)), "--out", "out", "--jobs", "1"]).split())
    assert "own, linear, 1 trial" in shown
    assert "continuous, linear, 1 trial" in shown
    assert Path("out/report.html").exists()


def test_a_first_family_is_simulated_as_it_is():
    family = load_family(file_for("family"))
    assert family.prior.names == ("q_t", "noise")
    bank = simulate_bank(family, 3, seed=1, trials=1, jobs=1)
    assert len(bank) == 3
    assert np.isfinite(bank.stood.summaries).all()


def test_a_first_table_lists_recordings_as_they_are_fitted(shell, root, elsewhere):
    (elsewhere / "of").mkdir()
    cells = np.loadtxt(root / "examples" / "standing.csv", delimiter=",", skiprows=4)[:, 0]
    rows = "".join(f"{i / 100},{value}\n" for i, value in enumerate(cells))
    Path("anna.csv").write_text(f"t [s],cop_ap [cm]\n{rows}")
    Path("ben.csv").write_text("t [s],cop.x\n0,1\n")
    said = shell.says(["new", "recordings", "anna.csv", "ben.csv", "--out", "of/people.csv"])
    assert "note: ben.csv" in said
    assert "note: anna.csv" not in said
    table = Path("of/people.csv")
    table.write_text(table.read_text(encoding="utf-8").replace("../ben.csv,,ben,,\n", ""), encoding="utf-8")
    (one,) = list_people(FitCommand(table=table))
    assert (one.label, len(one.trials)) == ("anna", 1)
    assert "no recording to list; give files" in shell.refuses(["new", "recordings"])


def test_a_first_file_is_of_the_run_file_that_is_given(capsys, elsewhere):
    assert main(["new", "run", "pendulum"]) == 0
    assert main(["new", "sweep", "pendulum.toml", "--out", "mine.toml"]) == 0
    sweep = load_sweep("mine.toml")
    assert (sweep.sweep.name, sweep.sweep.run, sweep.base.path) == ("mine", "pendulum.toml", Path("pendulum.toml"))
    (elsewhere / "below").mkdir()
    assert main(["new", "sweep", "pendulum.toml", "--out", "below/mine.toml"]) == 0
    assert load_sweep("below/mine.toml").sweep.run == "../pendulum.toml"
    assert load_sweep("below/mine.toml").base.fingerprint == sweep.base.fingerprint
    # of a controller without events there is nothing to be compared with, and no set-point
    assert main(["new", "experiment", "one-link-switching"]) == 0
    assert load_experiment("experiment.toml").names == ("own",)
    capsys.readouterr()
    assert main(["new", "experiment", "one-link-switching", "--stimulus", "double_step", "--out", "e.toml"]) == 0
    assert "note: it does not run as written; " in capsys.readouterr().out
    assert load_experiment("e.toml").kind == "double_step"


@pytest.mark.parametrize("name", [*SWEEPS.files, *EXPERIMENTS.files, *FAMILIES.files])
def test_what_is_shipped_is_copied_and_means_the_same(name, shell):
    assert "next      icmj " in shell.says(["new", name, "--out", "mine.toml"])
    for shelf, load in ((SWEEPS, load_sweep), (EXPERIMENTS, load_experiment), (FAMILIES, load_family_file)):
        if name in shelf.files:
            runs = [getattr(file, "runs", ()) or (file.base,) for file in (load("mine.toml"), load(name))]
            assert [run.fingerprint for run in runs[0]] == [run.fingerprint for run in runs[1]]
    assert "mine.toml: exists already" in shell.refuses(["new", name, "--out", "mine.toml"])


@pytest.mark.parametrize(("words", "said"), [
    (["pendulum", "three_link"], "three_link: one too many; icmj new takes one model or run file"),
    (["sweep", "nosuch"], "nosuch: cannot be read (No such file or directory); shipped cases: "),
    (["pendulm"], "pendulm: no such model file; did you mean pendulum?"),
    (["pendulum", "--out", "none/x.toml"], "none/x.toml: no such folder"),
    (["pendulum", "--keyframe", "lying"], "no keyframe 'lying'; it has upright"),
    (["bad.xml"], "bad.xml: not a usable MJCF model"),
])  # fmt: skip
def test_what_is_not_there_is_one_line_and_no_file(words, said, shell, elsewhere):
    (elsewhere / "bad.xml").write_text("<mujoco")
    err = shell.refuses(["new", *words])
    assert said in err
    assert len(told(err)) == 1
    assert [path.name for path in elsewhere.iterdir()] == ["bad.xml"]


def test_what_is_in_the_way_is_a_note(shell, elsewhere):
    body = '<body><joint name="a"/><geom size="1"/></body>'
    (elsewhere / "loose.xml").write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    assert "note: it does not run as written; model" in shell.says(["new", "loose.xml"])
    assert (elsewhere / "loose.toml").exists()


def test_all_that_is_shipped_is_listed_whole_at_sixty_columns(shell, monkeypatch):
    """A name that no command knew was answered by a row of names, and nothing said what they are."""
    listed = shell.answers(["cases", "--json"])
    names = [one["name"] for kind in ("cases", "rivals", "joystick") for one in listed[kind]]
    assert sorted(names) == sorted(RUNS.files)
    assert [one["name"] for one in listed["sweeps"]] == list(SWEEPS.files)
    assert [one["name"] for one in listed["experiments"]] == list(EXPERIMENTS.files)
    narrow = Terminal(width=60, force_terminal=True, color_system=None)
    monkeypatch.setattr(terminal, "OUT", narrow)
    shown = shell.says(["cases"])
    assert max(map(len, shown.splitlines())) <= narrow.width
    words = " ".join(shown.split())
    for one in (one for kind in listed.values() for one in kind):
        assert one["about"].endswith(".")
        assert 30 < len(one["about"]) < 200
        assert f"{one['name']}: {one['title']} {one['about']}" in words
    assert shell.refuses(["analyse", "nosuch"]).endswith("; icmj cases describes them\n")
