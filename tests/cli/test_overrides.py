"""``--set`` from end to end: what was set is what ran, and what the log says."""

import json

import numpy as np

from icmj.cli.main import main
from icmj.runfile.reading import load_run, parse_run


def test_a_log_stores_what_really_ran(root, tmp_path, capsys):
    from icmj.log import read_log

    path = root / "runs" / "simple-0.8.toml"
    changes = {"actual.gain": 0.85, "controller.q_t": 0.02, "simulation.duration": 9.0, "study.growth_points": 0}
    options = [word for key, value in changes.items() for word in ("--set", f"{key}={value}")]
    options += ["--set", "study.attractor_starts=0", "--set", "case.name=mine"]
    assert main(["run", str(path), "--plant", "linear", "--out", str(tmp_path), *options]) == 0
    capsys.readouterr()

    result = read_log(tmp_path / "mine.linear.rrd")
    said = parse_run(result.run.text, result.run.path)
    for run in (result.run, said):
        assert (run.actual.gain, run.controller.q_t, run.simulation.duration) == (0.85, 0.02, 9.0)
    # not only said: the plant that ran has the gain, the run its length, the rule its threshold
    assert np.allclose(result.actual.B, 0.85 * result.assumed.B, atol=1e-9)
    assert result.simulation.t[-1] == 9.0
    assert result.controller.trigger.q_t == 0.02
    assert load_run(path).actual.gain == 0.8


def test_analyse_and_study_take_it_too(root, tmp_path, capsys):
    path = root / "runs" / "simple-0.8.toml"
    assert main(["analyse", str(path), "--json", "--set", "actual.gain=1.2", "--set", "case.name=x"]) == 0
    changed = json.loads(capsys.readouterr().out)
    assert main(["analyse", str(root / "runs" / "simple-1.2.toml"), "--json"]) == 0
    shipped = json.loads(capsys.readouterr().out)
    # the case of another b is the case that ships with it
    assert changed["delta_crit"] == shipped["delta_crit"]
    assert changed["eigenvalue"] == shipped["eigenvalue"]

    out = tmp_path / "out"
    assert main(["study", str(path), "--out", str(out), "--set", "actual.gian=1"]) == 2
    assert "did you mean gain" in capsys.readouterr().err
    assert not out.exists()


def test_a_model_beside_the_user_and_not_beside_the_run_file_is_told_where_it_is_looked_for(
    root, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    light = tmp_path / "light.xml"
    light.write_bytes((root / "models" / "three_link.xml").read_bytes())
    case = str(root / "runs" / "three-link-0.9.toml")
    for given in ("light.xml", '"./light.xml"'):
        assert main(["analyse", case, "--set", f"assumed.model={given}"]) == 2
        told = capsys.readouterr().err
        assert f"{root / 'runs' / 'light.xml'} does not exist" in told
        assert f"give its absolute path, as in --set 'assumed.model=\"{light}\"'" in told
        assert "Traceback" not in told
    assert main(["analyse", case, "--json", "--set", f'assumed.model="{light}"']) == 0
    capsys.readouterr()
    assert main(["analyse", case, "--set", "assumed.model=dark.xml"]) == 2
    assert "no such model file" in capsys.readouterr().err
