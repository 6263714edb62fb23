"""The examples run, and find what they promise."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    ("name", "words"),
    [("own_plant.py", "Settled on a mirrored period-2 cycle of 2.24252 s"), ("disturbed_stance.py", "0.759203 s")],
)
def test_example_runs(root, name, words):
    done = subprocess.run(
        [sys.executable, f"examples/{name}"], cwd=root, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert words in done.stdout
