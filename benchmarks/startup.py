"""Start-up: the command line's help against numpy's import, what each import costs, and where a second run's time goes.

Times are of the processor, least of several: what a command takes on an idle machine, on any.
"""

import importlib.util
import pstats
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks import SHELL, second_run
from benchmarks.row import Row, interleaved, median

ROOT = Path(__file__).resolve().parent.parent
REPEATS = 5
SECOND_RUN = 12.0
GROUP = "start-up"
ICMJ = "from icmj.cli.main import entry; entry()"  # what the program icmj does

# where a profile shows that the time went: label, end of the file's name, function
PARTS = [
    ("imports", "importlib._bootstrap>", "_find_and_load"),
    ("compiled code from the disk cache", "base/linking.py", "load_overload"),
    ("stepping", "engine/native/steps.py", "advance"),
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
    """The whole of ``icmj run`` on the three-link case, in a second process: against numpy's import, counted, in parts.

    A case that the study adds to (``--study``) and one on the linear plant stand beside it.
    """
    case = second_run.CASE.stem
    with tempfile.TemporaryDirectory() as name:
        words = ["run", str(second_run.CASE), "--out", name]
        command, bare = [sys.executable, "-c", ICMJ, *words], [sys.executable, "-c", "import numpy"]
        others = {"--study": [*command, "--study"], "--plant linear": [*command, "--plant", "linear"]}
        for each in (command, *others.values()):
            _run(each)
        pairs = [(_spent(command), _spent(bare)) for _ in range(REPEATS)]
        ratio = median(mine / numpy for mine, numpy in pairs)
        asked = [sys.executable, "-c", ICMJ, "analyse", str(second_run.CASE)]
        table = [
            Row(GROUP, "icmj analyse", _processor(asked), "s", case, 1.0),
            Row(GROUP, "second icmj run", min(mine for mine, _ in pairs), "s", case, 2.5),
            Row(GROUP, "second icmj run / import numpy", ratio, "×", f"median of {REPEATS} pairs", SECOND_RUN),
            *(Row(GROUP, f"second icmj run {option}", _processor(each), "s", case) for option, each in others.items()),
            *(
                Row(GROUP, f"second icmj run: {what}", value, "", case, second_run.MOST.get(what))
                for what, value in second_run.count().items()
            ),
        ]
        script = Path(name) / "icmj_main.py"
        script.write_text(ICMJ.replace("entry", "main"), encoding="utf-8")  # which returns, with a profile
        _run([sys.executable, "-m", "cProfile", "-o", f"{name}/profile", str(script), *words])
        stats = pstats.Stats(f"{name}/profile")
    total = float(stats.total_tt)  # type: ignore[attr-defined]
    for label, file, function in PARTS:
        seconds = max(
            (entry[3] for key, entry in stats.stats.items() if key[0].endswith(file) and key[2] == function),  # type: ignore[attr-defined]
            default=0.0,
        )
        note = "of a profiled run; imports happen inside the others, too"
        table.append(Row(GROUP, f"second icmj run: {label}", 100 * seconds / total, "%", note))
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
    # with bytecode kept and as many threads of BLAS as there are by default, as on any user's machine
    environment = {key: value for key, value in SHELL.items() if key != "PYTHONDONTWRITEBYTECODE"}
    return subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT, env=environment).stdout
