"""Start-up: the command line's help against numpy's import, what each import costs, and where a second run's time goes.

Times are of the processor, least of several: what a command takes on an idle machine, on any.
"""

from __future__ import annotations

import importlib.util
import os
import pstats
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.row import Row, interleaved, median

ROOT = Path(__file__).resolve().parent.parent
REPEATS = 5
SECOND_RUN = 20.0
GROUP = "start-up"
ICMJ = "from icmj.cli.main import main; main()"

# where a profile shows that the time went: label, end of the file's name, function
PARTS = [
    ("imports", "importlib._bootstrap>", "_find_and_load"),
    ("compiled code from the disk cache", "numba/core/caching.py", "load_overload"),
    ("stepping", "engine/native/loop.py", "advance"),
    ("writing the log", "log/writer.py", "write_log"),
]


# what is imported, and by whom
IMPORTS = {
    "numpy": "all but --help",
    "scipy.linalg": "matrix exponential, Riccati equation: every command",
    "pydantic": "run files: every command",
    "mujoco": "models and linearisation: every command",
    "scipy.optimize": "operating points by balance; branches of eigenvalues that meet",
    "numba": "simulation: run, study",
    "rerun": "writing and reading logs: run, study, report, replay",
    "matplotlib.figure": "figures: study, report",
    "control": "plants to and from python-control: from Python alone",
}


def rows() -> list[Row]:
    """Times of fresh processes."""
    numpy = [sys.executable, "-c", "import numpy"]
    help_ = [sys.executable, "-c", ICMJ, "--help"]
    runs = {"numpy": lambda: _run(numpy), "help": lambda: _run(help_)}
    interleaved(runs, 1)
    times = interleaved(runs, REPEATS)
    ratio = median(a / b for a, b in zip(times["help"], times["numpy"], strict=True))
    return [
        Row(GROUP, "python -c 'import numpy'", median(times["numpy"]), "s"),
        Row(GROUP, "icmj --help", median(times["help"]), "s"),
        Row(GROUP, "icmj --help / import numpy", ratio, "×", f"median of {REPEATS} pairs", 3.0),
        *_imports(),
        *_second_run(),
    ]


def _imports() -> list[Row]:
    """What each library adds to a process that has numpy."""
    bare = _processor([sys.executable, "-c", "pass"])
    numpy = _processor([sys.executable, "-c", "import numpy"])
    table = [Row(GROUP, "import numpy", 1e3 * (numpy - bare), "ms", IMPORTS["numpy"])]
    for name, use in list(IMPORTS.items())[1:]:
        if importlib.util.find_spec(name.split(".")[0]) is not None:
            took = _processor([sys.executable, "-c", f"import numpy, {name}"]) - numpy
            table.append(Row(GROUP, f"import {name}", 1e3 * took, "ms", use))
    return table


def _second_run() -> list[Row]:
    """The whole of ``icmj run`` on the three-link case cut to 10 s, in a second process, and its parts."""
    case = ROOT / "runs" / "three-link-0.9.toml"
    if not case.exists():
        return [Row(GROUP, "second icmj run", None, "s", f"skipped: no {case.name}")]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        text = case.read_text(encoding="utf-8").replace('"../models/', f'"{ROOT.as_posix()}/models/')
        lines = ["duration = 10.0" if line.startswith("duration") else line for line in text.splitlines()]
        (folder / case.name).write_text("\n".join(lines), encoding="utf-8")
        arguments = ["run", str(folder / case.name), "--plant", "mujoco", "--out", name]
        command = [sys.executable, "-c", ICMJ, *arguments]
        _run(command)
        linear = [word.replace("mujoco", "linear") for word in command]
        _run(linear)
        bare = [sys.executable, "-c", "import numpy"]
        pairs = [(_spent(command), _spent(bare)) for _ in range(REPEATS)]
        ratio = min(mine for mine, _ in pairs) / min(numpy for _, numpy in pairs)
        asked = [sys.executable, "-c", ICMJ, "analyse", str(folder / case.name)]
        note = f"{case.stem}, 10 s"
        table = [
            Row(GROUP, "icmj analyse", _processor(asked), "s", case.stem, 1.0),
            Row(GROUP, "second icmj run", _processor(command), "s", f"{note}, with its amplitude law", 2.5),
            Row(GROUP, "second icmj run / import numpy", ratio, "×", f"processor time, least of {REPEATS}", SECOND_RUN),
            Row(GROUP, "second icmj run --plant linear", _processor(linear), "s", f"{note}, with its attractors", 2.5),
        ]
        script = folder / "icmj_main.py"
        script.write_text(ICMJ, encoding="utf-8")
        _run([sys.executable, "-m", "cProfile", "-o", str(folder / "profile"), str(script), *arguments])
        stats = pstats.Stats(str(folder / "profile"))
    total = float(stats.total_tt)  # type: ignore[attr-defined]
    for label, file, function in PARTS:
        seconds = max(
            (entry[3] for key, entry in stats.stats.items() if key[0].endswith(file) and key[2] == function),  # type: ignore[attr-defined]
            default=0.0,
        )
        table.append(
            Row(
                GROUP,
                f"second icmj run: {label}",
                100 * seconds / total,
                "%",
                "of a profiled run; imports happen inside the others, too",
            )
        )
    return table


def _processor(command: list[str]) -> float:
    """Least processor time of a command [s], user and system together."""
    return min(_spent(command) for _ in range(REPEATS))


def _spent(command: list[str]) -> float:
    """Processor time of a command [s]."""

    def spent() -> float:
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    begin = spent()
    _run(command)
    return spent() - begin


def _run(command: list[str]) -> str:
    # with bytecode kept, as on any user's machine
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    return subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT, env=environment).stdout
