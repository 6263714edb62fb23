"""What the environment asks of Python and of libraries, and which of them is installed: never a mistake of icmj."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from patience import PATIENCE

SHORT = ("--plant", "linear", "--set", "simulation.duration=3", "--out", "out")


def icmj(folder: Path, *words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    root = str(Path(__file__).resolve().parents[2])
    paths = os.pathsep.join(filter(None, (environment.pop("PYTHONPATH", ""), root)))
    command = [sys.executable, "-m", "icmj.cli", *words]
    env = os.environ | {"PYTHONPATH": paths} | environment
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, timeout=PATIENCE, check=False)


@pytest.mark.slow
@pytest.mark.parametrize("environment", [
    {"NUMBA_DISABLE_JIT": "1"}, {"PYTHONWARNINGS": "error"}, {"PYTHONOPTIMIZE": "2", "PYTHONDEVMODE": "1"},
], ids=str)  # fmt: skip
def test_what_is_asked_of_python_and_numba_changes_no_result(environment: dict[str, str], tmp_path: Path) -> None:
    done = icmj(tmp_path, "run", "simple-0.8", *SHORT, **environment)
    assert done.returncode == 0, done.stderr
    assert "out/simple-0.8.linear.rrd" in done.stdout
    assert icmj(tmp_path, "measure", "out", **environment).returncode == 0


def test_another_minor_version_of_mujoco_is_named(tmp_path: Path) -> None:
    """By its metadata, as pip leaves it, before anything of it is imported."""
    about = tmp_path / "path" / "mujoco-3.17.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: mujoco\nVersion: 3.17.0\n\n")
    for words in (("analyse", "simple-0.8"), ("linearise", "pendulum")):
        done = icmj(tmp_path, *words, PYTHONPATH=str(about.parent), ICMJ_INTERPRETED="")
        assert done.returncode == 2
        assert "icmj needs mujoco 4.0, found 3.17.0; pip install 'mujoco==4.0.*'" in done.stderr
    assert icmj(tmp_path, "cases", PYTHONPATH=str(about.parent)).returncode == 0
