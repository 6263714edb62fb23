"""Memory stays flat over many refused runs in one process."""

from __future__ import annotations

import gc
import os
import re
from pathlib import Path

import psutil
import pytest
from fault_cases import short_run

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
