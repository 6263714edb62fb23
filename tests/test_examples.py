"""The examples run, and find what they promise."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("own_plant.py", "Settled on a mirrored period-2 cycle of 2.24252 s"),
        ("disturbed_stance.py", "0.759203 s"),
        ("delay.py --points 2", "simple-0.8      1.8065 1.7719"),
    ],
)
def test_example_runs(root, command, words):
    done = subprocess.run(
        [sys.executable, *f"examples/{command}".split()],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert words in done.stdout
