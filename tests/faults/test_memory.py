"""Memory stays flat over many refused runs in one process, and too little of it is one line."""

import gc
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import psutil
import pytest
from fault_cases import short_run
from patience import PATIENCE
from sweep_cases import GRID, sweep_file
from terminal_cases import told

from icmj.cli.main import main

pytestmark = pytest.mark.slow
RUNS = 75


def test_refused_runs_leave_no_memory_behind(root: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    good = short_run(tmp_path).read_text(encoding="utf-8")
    model = (root / "models" / "pendulum.xml").read_text(encoding="utf-8")
    (tmp_path / "crowd.xml").write_text(model.replace("<sensor>", '<sensor><user name="u" dim="5000"/>'))
    wrong = [
        good.replace("q_t = 0.01", "q_t = -1"),
        good.replace("R_c = 0.1", "Q_c = [[1, 2], [3, 4]]"),
        good.replace("gain = 0.8", "gain = [1, 2]"),
        good.replace("hinge =", "knee ="),
        re.sub(r'model = ".*"', 'model = "crowd.xml"', good),
    ]
    for i, text in enumerate(wrong):
        (tmp_path / f"{i}.toml").write_text(text, encoding="utf-8")
    process, sizes = psutil.Process(os.getpid()), []
    for i in range(RUNS):
        assert main(["run", str(tmp_path / f"{i % len(wrong)}.toml"), "--out", str(tmp_path / "out")]) == 2
        if i % len(wrong) == len(wrong) - 1:
            gc.collect()
            sizes.append(process.memory_info().rss / 1e6)
    capfd.readouterr()
    third = len(sizes) // 3  # the first ones fill caches
    assert sizes[-1] - sizes[third] < 15, sizes
    assert not (tmp_path / "out").exists()


def limited(room: int, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """``icmj`` with so many bytes of addresses."""
    return subprocess.run(
        [sys.executable, "-m", "icmj.cli", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (room, room)),
    )


@pytest.mark.skipif(sys.platform != "linux", reason="limits of addresses are kept by Linux")
@pytest.mark.parametrize("room", [200, 300, 400, 450, 500, 800])
def test_too_little_room_for_the_libraries_is_one_line(room: int, tmp_path: Path) -> None:
    """At 400 MB a library spun while it was loaded, and no signal was heard; at others status 1 or 70."""
    sweep = sweep_file(tmp_path, GRID.format(count=2))
    for command in (["analyse", "simple-0.8"], ["sweep", sweep, "--jobs", "1", "--out", tmp_path / "out"]):
        done = limited(room * 10**6, *command)
        assert done.returncode == 2
        assert (
            done.stderr
            == f"icmj: ulimit -v leaves {room / 1e3:.2g} GB of addresses, and the libraries need 1.1 GB; raise it\n"
        )
    assert not (tmp_path / "out").exists()


def test_help_needs_none_of_it() -> None:
    assert limited(300 * 10**6, "--help").returncode == 0
    assert limited(300 * 10**6, "--version").returncode == 0


@pytest.mark.skipif(sys.platform != "linux", reason="limits of addresses are kept by Linux")
@pytest.mark.parametrize("room", [1.1, 1.4, 1.8])
def test_little_room_is_used_or_told(room: float, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,a\n" + "".join(f"{i},{i % 7}\n" for i in range(40)))
    for command in (["run", "simple-0.8", "--out", tmp_path / "out"], ["measure", tmp_path / "a.csv"]):
        done = limited(int(room * 2**30), *command)
        lines = told(done.stderr)
        assert (done.returncode, len(lines)) in ((0, 0), (2, 1)), done.stderr
