"""The folder of one release: files and results as it wrote them, and what stands in them.

Run once at a release, from a checkout of it: ``python tests/archive/make.py``. Never run again for the same version:
what later versions must read is what that version wrote.
"""

import json
import lzma
import shutil
import subprocess
import sys
from pathlib import Path

import icmj

HERE = Path(__file__).resolve().parent
THREE_LINK = """\
[case]
name = "three-link"
title = "Three links, a delay, noise and a push"

[assumed]
model = "three_link.xml"
keyframe = "upright"
delay = 0.1

[actual]
gain = 0.9

[design]
Q_c = "output"
R_c = 5e-07
Q_o = "input"
R_o = 2e-07

[controller]
hold = "system-matched"
Q_t = "output"
q_t = 0.01
delta_min = 0.01

[analysis]
delta_max = 3.0

[simulation]
duration = 1.5
initial = { ankle = 0.02 }
timestep = 0.002
record_interval = 0.05
limit = 1.0
disturbance = [
  { kind = "impulse", input = "ankle_torque", size = 1.0, start = 0.8, duration = 0.05 },
  { kind = "noise", input = "hip_torque", size = 0.01, bandwidth = 2.0, seed = 1, terms = 20 },
]
"""
MATRICES = """\
[case]
name = "matrices"
title = "A plant given by matrices"

[assumed]
A = [[0.0, 1.0], [1.0, 0.0]]
B = [[0.0], [1.0]]
C = [[1.0, 0.0]]
states = ["angle", "rate"]
inputs = ["torque"]
outputs = ["angle"]

[actual]
gain = 0.8

[design]
Q_c = "output"
R_c = 1e-2
Q_o = "input"
R_o = 1e-2

[controller]
hold = "system-matched"
Q_t = "output"
q_t = 0.01
delta_min = 0.01

[analysis]
delta_max = 4.0

[simulation]
limit = 1.0
timestep = 0.005
duration = 8.0
record_interval = 0.1
initial = { angle = 0.01 }
"""
SWEEP = """\
[sweep]
name = "gains"
run = "matrices.toml"

[[vary]]
field = "actual.gain"
name = "b"
values = [0.7, 0.8, 0.9]

[ask]
motion = ["linear"]
"""
EXPERIMENT = """\
[experiment]
name = "standing"
plants = ["linear"]
repetitions = 2
seed = 1

[quiet_standing]
settle = 2.0
rate = 50.0
low_pass = 5.0

[[case]]
run = "three-link.toml"
set.simulation.duration = 32.0
"""


def make(folder: Path) -> None:
    """Write run, sweep and experiment files, and with the commands of this version what they give."""
    folder.mkdir()
    shutil.copy(HERE.parents[1] / "models" / "three_link.xml", folder)
    for name, text in (("three-link", THREE_LINK), ("matrices", MATRICES)):
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    (folder / "sweep.toml").write_text(SWEEP, encoding="utf-8")
    (folder / "experiment.toml").write_text(EXPERIMENT, encoding="utf-8")
    for command in (
        ("run", "three-link.toml", "--out", "logs"),
        ("run", "matrices.toml", "--plant", "linear", "--out", "logs"),
        ("continue", "matrices.toml", "--parameter", "b", "--to", "0.75", "--points", "5", "--out", "branch"),
        ("sweep", "sweep.toml", "--jobs", "1", "--out", "sweep"),
        ("experiment", "experiment.toml", "--jobs", "1", "--out", "experiment"),
    ):
        subprocess.run([sys.executable, "-m", "icmj.cli", *command], cwd=folder, check=True)
    for path in sorted(folder.rglob("*")):
        if path.suffix == ".rrd":
            path.with_suffix(".rrd.xz").write_bytes(lzma.compress(path.read_bytes(), preset=9 | lzma.PRESET_EXTREME))
        if path.suffix in (".rrd", ".pdf", ".svg", ".html") or path.name == ".lock":
            path.unlink()


if __name__ == "__main__":
    make(HERE / icmj.__version__)
    sys.path.insert(0, str(HERE.parent))
    from test_archive import describe

    found = json.dumps(describe(HERE / icmj.__version__), indent=1)
    (HERE / icmj.__version__ / "expected.json").write_text(f"{found}\n", encoding="utf-8")
