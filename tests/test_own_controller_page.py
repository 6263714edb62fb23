"""docs/own_controller.md: its file, its script and its run file run as they are printed, and stand upright."""

import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

import icmj
from icmj.cli.main import main


def blocks(root: Path, language: str) -> list[str]:
    page = (root / "docs" / "own_controller.md").read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", page, flags=re.S | re.M)


@pytest.fixture
def folder(root, tmp_path, monkeypatch):
    (tmp_path / "laws.py").write_text(blocks(root, "python")[0], encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "laws", raising=False)
    yield tmp_path
    sys.modules.pop("laws", None)


@pytest.mark.slow
def test_the_law_runs_in_python_on_both_plants(root, folder, capsys):
    known: dict = {"__name__": "page"}
    exec(compile(blocks(root, "python")[1], "own_controller.md", "exec"), known)
    assert capsys.readouterr().out.count("completed") == 2
    for run in known["runs"]:
        assert np.abs(run.y[-1]).max() < 1e-3 < np.abs(run.y[0]).max()


def test_the_law_is_what_its_formula_says(root, folder):
    """Against the matrix exponential of the loop with the integral and without the taps, short beside the motion."""
    import laws

    plant = icmj.load_plant("one_link", keyframe="upright").linearisation.plant
    law = laws.Reflexes(plant, 0.0005, P=300.0, D=100.0, I=20.0, slow=0.001)
    run = icmj.simulate_plant(plant, law, icmj.Settings(duration=2.0, initial={"ankle": 0.02}))
    loop = np.zeros((3, 3))
    loop[:2, :2] = plant.A - plant.B @ np.array([[300.0, 100.0]]) @ plant.C
    loop[:2, 2:] = -20.0 * plant.B
    loop[2, :2] = plant.C[0]
    at = np.array([1.0, 2.0])
    exact = [(plant.C @ (expm(loop * t) @ [0.02, 0.0, 0.0])[:2])[0] for t in at]
    fastest = np.abs(np.linalg.eigvals(loop)).max()
    np.testing.assert_allclose(np.interp(at, run.t, run.y[:, 0]), exact, atol=0.02 * 3 * fastest * 0.001)


@pytest.mark.slow
def test_the_run_file_and_every_command(root, folder, capsys):
    (folder / "law.toml").write_text(blocks(root, "toml")[0], encoding="utf-8")
    commands = [line for block in blocks(root, "sh") for line in block.splitlines()]
    assert len(commands) == 2
    for line in commands:
        assert main(shlex.split(line)[1:]) == 0, line
        assert "fell" not in capsys.readouterr().out
    for plant in ("linear", "mujoco"):
        assert icmj.read_log(folder / "runs" / "out" / f"law.{plant}.rrd").simulation.outcome.kind == "completed"


def test_a_model_where_a_linear_plant_is_meant_is_refused_in_one_line(root, folder):
    import laws

    body = icmj.load_plant("one_link", keyframe="upright")
    with pytest.raises(icmj.errors.IcmjError, match=r"is a MujocoPlant; expected a LinearPlant; give its"):
        icmj.simulate_plant(body, laws.Reflexes(body, 0.001, P=300.0, D=100.0), icmj.Settings(duration=1.0))
