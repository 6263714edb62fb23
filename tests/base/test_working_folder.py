"""The working folder may hold somebody else's data: neither numba nor matplotlib takes settings from it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from patience import PATIENCE


def told(code: str, folder: Path, **variables: str) -> list[str]:
    """What a program prints that is somewhere else and works in ``folder``; a warning ends it."""
    script = folder.parent / f"{folder.name}.script"
    script.write_text(code)
    path = os.pathsep.join(place for place in sys.path if place)
    environment = {**os.environ, "PYTHONPATH": path, **variables}
    command = [sys.executable, "-W", "error", str(script)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, cwd=folder, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


@pytest.mark.parametrize(("before", "content"), [
    ("", "cache_dir: cache\ndisable_jit: 1\n"),
    ("import yaml", "cache_dir: cache\ndisable_jit: 1\n"),
    ("", "- no mapping\n"),
])  # fmt: skip
def test_numba_takes_no_settings_from_the_working_folder(before: str, content: str, tmp_path: Path) -> None:
    """Neither when it is imported nor when it compiles, for which it looks again; PyYAML is there for others."""
    pytest.importorskip("yaml")
    (tmp_path / ".numba_config.yaml").write_text(content)
    code = f"""
{before}
import icmj.base.compilation
from numba.core import config
config.reload_config()
import yaml
print(config.CACHE_DIR or "none", config.DISABLE_JIT, yaml.safe_load("1"))
"""
    assert told(code, tmp_path) == ["none", "0", "1"]


@pytest.mark.parametrize(("content", "variable"), [
    (b"text.usetex: True\nlines.linewidth: 8\n", "MPLCONFIGDIR"),
    (b"\xff\xfe\xff", "MATPLOTLIBRC"),
])  # fmt: skip
def test_matplotlib_takes_settings_from_the_user_alone(content: bytes, variable: str, tmp_path: Path) -> None:
    """What lies in the working folder is not even opened: bytes that are no text ended the import."""
    (tmp_path / "matplotlibrc").write_bytes(content)
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "matplotlibrc").write_text("lines.linewidth: 7\n")
    code = """
import os
from icmj.base.process import load_matplotlib_apart
before = os.getcwd()
load_matplotlib_apart()
import matplotlib
print(matplotlib.rcParams["text.usetex"], matplotlib.rcParams["lines.linewidth"], os.getcwd() == before)
"""
    assert told(code, tmp_path, **{variable: "own"}) == ["False", "7.0", "True"]
