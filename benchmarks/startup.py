"""Start-up: the command line's help against numpy's import, and where the time of a second run goes."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.row import Row, interleaved, median

ROOT = Path(__file__).resolve().parent.parent
REPEATS = 7
GROUP = "start-up"

# a process of its own, which times its own parts of the three-link case for 10 s
PARTS = """
import json, sys
from time import perf_counter as now
marks = [("start", now())]
def mark(name): marks.append((name, now()))
import mujoco; mark("import mujoco")
from icmj.controller import Controller, EventTrigger, output_weight, system_matched
from icmj.design import design_lq
from icmj.disturbance import no_disturbance
from icmj.engine.closed_loop import close_loop
from icmj.engine.plant import load_plant
from icmj.engine.model import Deviation
from icmj.runfile import SimulationSettings; mark("import icmj")
assumed, actual = load_plant(sys.argv[1], None, "upright"), load_plant(sys.argv[1], Deviation(0.9), "upright")
mark("load and linearise")
gains = design_lq(assumed.linearisation.plant, R_c=5e-7, R_o=2e-7); mark("design (imports python-control)")
loop = close_loop(actual, Controller(gains, system_matched(gains), EventTrigger(output_weight(gains), 0.01)),
                  no_disturbance(3)); mark("compose")
import numba; mark("import numba")
from icmj.engine.native import callbacks
callbacks(); mark("callbacks from the disk cache")
import numpy as np
settings = SimulationSettings(duration=10.0)
def run(duration):
    data = loop.start(0.01 * np.ones(6), np.zeros(6), np.zeros(6))
    loop.run(data, loop.schedule(SimulationSettings(duration=duration), 2e-3))
run(0.01); mark("loop from the disk cache")
run(10.0); mark("10 s of simulation")
print(json.dumps([(name, t - before) for (_, before), (name, t) in zip(marks, marks[1:])]))
"""


def rows() -> list[Row]:
    """Times of fresh processes."""
    table = []
    numpy = [sys.executable, "-c", "import numpy"]
    if importlib.util.find_spec("icmj.cli") is None:
        table.append(Row(GROUP, "icmj --help", None, "s", "skipped: there is no command line in this version"))
    else:
        help_ = [sys.executable, "-c", "from icmj.cli import main; main()", "--help"]
        runs = {"numpy": lambda: _run(numpy), "help": lambda: _run(help_)}
        interleaved(runs, 1)
        times = interleaved(runs, REPEATS)
        ratio = median(a / b for a, b in zip(times["help"], times["numpy"], strict=True))
        table += [
            Row(GROUP, "python -c 'import numpy'", median(times["numpy"]), "s"),
            Row(GROUP, "icmj --help", median(times["help"]), "s"),
            Row(GROUP, "icmj --help / import numpy", ratio, "×", f"median of {REPEATS} pairs", 3.0),
        ]
        table += _second_run()
    model = str(ROOT / "models" / "three_link.xml")
    command = [sys.executable, "-c", PARTS, model]
    _run(command)  # fills the caches
    for name, seconds in json.loads(_run(command)):
        table.append(Row(GROUP, f"second process: {name}", seconds, "s", "three-link, 10 s"))
    return table


def _second_run() -> list[Row]:
    """The whole of ``icmj run`` on the three-link case, cut to 10 s, the second time."""
    cases = sorted((ROOT / "runs").glob("*three*.toml"))
    if not cases:
        return [Row(GROUP, "second icmj run", None, "s", "skipped: no three-link run file")]
    with tempfile.TemporaryDirectory() as folder:
        text = cases[0].read_text(encoding="utf-8").replace('"../models/', f'"{ROOT}/models/')
        lines = ["duration = 10.0" if line.startswith("duration") else line for line in text.splitlines()]
        case = Path(folder) / cases[0].name
        case.write_text("\n".join(lines), encoding="utf-8")
        command = [sys.executable, "-c", "from icmj.cli import main; main()", "run", str(case)]
        command += ["--plant", "mujoco", "--out", folder]
        times = interleaved({"run": lambda: _run(command)}, 2)["run"]
    return [Row(GROUP, "second icmj run", times[1], "s", f"{cases[0].stem} cut to 10 s, log included")]


def _run(command: list[str]) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout
