"""The examples run, and find what they promise."""

import re
import subprocess
import sys
import tomllib

import pytest
from patience import PATIENCE


@pytest.mark.slow
@pytest.mark.parametrize(("command", "said"), [
    ("own_plant.py", "Settled on a mirrored period-2 cycle of 2.24252 s"),
    ("disturbed_stance.py", "0.759203 s"),
    ("delay.py --points 2", "simple-0.8      1.8065 1.7719"),
    ("lean.py", "-26.95 N m hold the lean"),
    ("backpack.py", "Settled on a period-1 cycle of 0.362"),
    ("gymnasium_model.py", "Settled on a period-1 cycle of 0.61371"),
    ("dm_control_model.py", "Settled on a period-1 cycle of 0.65768"),
    ("ball_joint.py", "mujoco  first interval 0.3204"),
    ("muscle.py", "Settled on a period-1 cycle of 1.16"),
    ("rigid_person.py", "continuous, MuJoCo, 5.12 s: off by 0.37 % from 1 Hz on"),
    ("deciding.py --people 2 --trials 1", "events – predictor                        1            1"),
    ("sway.py", "intersection point, mujoco: 0.0"),
])  # fmt: skip
def test_example_runs(root, command, said):
    words = [sys.executable, *f"examples/{command}".split()]
    done = subprocess.run(words, cwd=root, capture_output=True, text=True, check=False, timeout=PATIENCE)
    if "is not installed" in done.stderr:
        pytest.skip(done.stderr.strip())
    assert done.returncode == 0, done.stderr
    assert said in done.stdout


def test_the_documentation_s_extra_brings_what_examples_look_for(root):
    """It did not, so that the documentation could be built only where the tests were installed."""
    extras = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    for example in (root / "examples").glob("*.py"):
        for name in re.findall(r'find_spec\("(\w+)"\)', example.read_text(encoding="utf-8")):
            assert any(re.match(rf"{name}\b", wanted) for wanted in extras["docs"]), example
