"""Folders that a command trusts, changed by a bit or by a file: one line, or the same numbers; no wait, no memory."""

import json
import subprocess
import sys

import pytest
from fault_cases import ROOT

# bits, and changes of each kind of file, of which one takes memory; ``python -m tests.tampering`` hunts for longer
FLIPS, REPLACED, INSIDE = 4, 2, 2
MOST = 1500.0  # MB, of the process that reads them all, one after the other


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "least", "seed"), [("fit", 30, 0), ("sweep", 8, 1), ("experiment", 12, 2)])
def test_what_was_changed_is_refused_in_one_line_or_changes_nothing(kind: str, least: int, seed: int) -> None:
    """By another seed, other files take memory: each way to take it has its turn in one folder or another."""
    draws = ["--flips", str(FLIPS), "--replaced", str(REPLACED), "--inside", str(INSIDE), "--seed", str(seed)]
    command = [sys.executable, "-m", "tests.tampering", "--kind", kind, *draws]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    found = json.loads(done.stdout[done.stdout.index("{") :])
    assert found["failures"] == []
    assert sum(found["bits"].values()) == FLIPS
    assert sum(found["others"].values()) >= least
    assert found["bits"]["refused in one line"] > found["bits"].get("the same numbers", 0)
    assert found["peak"] < MOST
