"""``--set`` from end to end: what was set is what ran, and what the log says."""

import numpy as np

from icmj.cli.main import main
from icmj.runfile.reading import load_run, parse_run


def test_a_log_stores_what_really_ran(root, tmp_path, shell):
    from icmj.log.reader import read_log

    path = root / "runs" / "simple-0.8.toml"
    changes = {"actual.gain": 0.85, "controller.q_t": 0.02, "simulation.duration": 9.0, "study.growth_points": 0}
    options = [word for key, value in changes.items() for word in ("--set", f"{key}={value}")]
    options += ["--set", "study.attractor_starts=0", "--set", "case.name=mine"]
    shell.says(["run", str(path), "--plant", "linear", "--out", str(tmp_path), *options])

    result = read_log(tmp_path / "mine.linear.rrd")
    assert list(result.run.changes) == [*changes, "study.attractor_starts", "case.name"]
    assert result.run.title == "Simple system, b = 0.85 (changed)"
    said = parse_run(result.run.text, result.run.path)
    for run in (result.run, said):
        assert (run.actual.gain, run.controller.q_t, run.simulation.duration) == (0.85, 0.02, 9.0)
    # not only said: the plant that ran has the gain, the run its length, the rule its threshold
    assert np.allclose(result.actual.B, 0.85 * result.assumed.B, atol=1e-9)
    assert result.simulation.t[-1] == 9.0
    assert result.controller.trigger.q_t == 0.02
    assert load_run(path).actual.gain == 0.8
    assert any("differs from the published case" in notice for notice in result.notices)


def test_what_was_set_is_said_wherever_the_title_of_the_file_stands(root, tmp_path, capsys, shell):
    """Terminal, replay and report named "b = 0.9" of a case with b = 1, and no mass was to be found on the page."""
    from icmj.log.reader import read_log, read_static_row

    words = "hanged from the file: assumed.person.mass = 68, actual.person.mass = 80, actual.gain = 1, "
    changes = ["assumed.person.mass=68", "actual.person.mass=80", "actual.gain=1", "simulation.duration=5"]
    options = [word for change in changes for word in ("--set", change)]
    path = str(root / "runs" / "three-link-0.9.toml")
    said = " ".join(shell.says(["analyse", path, *options]).split())
    assert "Three-link standing, b = 1 (changed)" in said
    assert f"C{words}" in said
    assert main(["run", path, "--plant", "mujoco", "--out", str(tmp_path), *options]) == 0
    assert f"three-link-0.9: c{words}" in " ".join(capsys.readouterr().out.split())

    log = tmp_path / "three-link-0.9.mujoco.rrd"
    (replayed,) = read_static_row(log, "/summary")["TextDocument:text"].to_pylist()
    assert "(changed)" in replayed
    assert f"C{words}" in replayed
    page = tmp_path / "report.html"
    record = shell.answers(["report", str(log), "--out", str(page), "--json"])["runs"][0]
    assert record["changes"] == read_log(log).run.changes_in_words
    text = page.read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    heading, _, rest = text.partition("<h1>")[2].partition("</h1>")
    assert "(changed)" in heading
    # beneath the title, in the table, beneath the title of the case, and among its settings
    assert rest.count(f"C{words}") == 4
    given = text.partition('<dl class="given"')[2].partition("</dl>")[0]
    assert "1.8 m, 80 kg" in given
    assert "1.8 m, 68 kg" in given


def test_analyse_and_study_take_it_too(root, tmp_path, shell):
    path = root / "runs" / "simple-0.8.toml"
    changed = shell.answers(["analyse", str(path), "--json", "--set", "actual.gain=1.2", "--set", "case.name=x"])
    shipped = shell.answers(["analyse", str(root / "runs" / "simple-1.2.toml"), "--json"])
    # the case of another b is the case that ships with it
    assert changed["delta_crit"] == shipped["delta_crit"]
    assert changed["eigenvalue"] == shipped["eigenvalue"]

    out = tmp_path / "out"
    assert "did you mean gain" in shell.refuses(["study", str(path), "--out", str(out), "--set", "actual.gian=1"])
    assert not out.exists()


def test_a_model_beside_the_user_and_not_beside_the_run_file_is_told_where_it_is_looked_for(
    root, tmp_path, monkeypatch, shell
):
    monkeypatch.chdir(tmp_path)
    light = tmp_path / "light.xml"
    light.write_bytes((root / "models" / "three_link.xml").read_bytes())
    case = str(root / "runs" / "three-link-0.9.toml")
    for given in ("light.xml", '"./light.xml"'):
        told = shell.refuses(["analyse", case, "--set", f"assumed.model={given}"])
        assert f"{root / 'runs' / 'light.xml'} does not exist" in told
        assert f"give its absolute path, as in --set 'assumed.model=\"{light}\"'" in told
        assert "Traceback" not in told
    shell.says(["analyse", case, "--json", "--set", f'assumed.model="{light}"'])
    assert "no such model file" in shell.refuses(["analyse", case, "--set", "assumed.model=dark.xml"])
