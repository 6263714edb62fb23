"""The idea written by hand agrees with the package: the theory to rounding, the motion to the error that it states."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from patience import PATIENCE

from icmj import load_run, prepare, simulate

NUMBER = r"([\d.]+)"


@pytest.mark.slow
def test_what_is_written_by_hand_is_what_the_package_computes(root: Path, tmp_path: Path) -> None:
    script = root / "examples" / "by_hand.py"
    done = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=PATIENCE
    )
    assert done.returncode == 0, done.stderr
    predicted, measured, errs = done.stdout.splitlines()
    found = re.findall(rf"every {NUMBER} s, shank up to {NUMBER} rad", predicted + measured)
    (delta, amplitude), (interval, shank) = [map(float, pair) for pair in found]
    error, beyond = map(float, re.findall(rf"{NUMBER} s in this and {NUMBER}% in that", errs)[0])

    case = prepare(load_run("three-link-0.9"))
    assert case.prediction is not None
    assert case.prediction.amplitude is not None
    assert delta == pytest.approx(case.prediction.delta_crit, abs=1e-6)
    assert amplitude == pytest.approx(case.prediction.amplitude[0], abs=1e-6)
    run = simulate(case)
    last = run.events.t[-11:]
    assert abs(interval - (last[-1] - last[0]) / 10) < error < 1e-3
    exact = max(run.events.y_max[-10:, 0].max(), -run.events.y_min[-10:, 0].min())
    assert 0 <= shank / exact - 1 < beyond / 100 < 0.01
    assert (tmp_path / "by_hand.rrd").stat().st_size > 1e5


def test_it_is_short_and_needs_nothing_of_the_package(root: Path) -> None:
    text = (root / "examples" / "by_hand.py").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 150
    libraries = set(re.findall(r"^(?:import|from) (\w+)", text, re.MULTILINE))
    assert libraries == {"control", "mujoco", "numpy", "pathlib", "rerun", "scipy"}
