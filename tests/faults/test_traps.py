"""Nothing beside data, above it or in the working folder is run, imported or obeyed, whatever command is given."""

import json
import os
import pkgutil
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from patience import PATIENCE

from icmj import load_run, write_log
from icmj.cli.commands import COMMANDS as KNOWN
from icmj.study.study import run_case

ROOT = Path(__file__).resolve().parent.parent.parent
# a `sitecustomize` of every process of the command, workers too: it notes each trap that is opened
WATCH = """
import json, os, sys
with open(os.environ["TRAPS"]) as file:
    traps = set(json.load(file))
def watch(event, values):
    if event == "open" and isinstance(values[0], (str, bytes)):
        path = os.path.abspath(os.fsdecode(values[0]))
        if path in traps:
            with open(os.environ["MARKS"], "a") as file:
                file.write(f"read {path}\\n")
sys.addaudithook(watch)
"""
GROUPS = (
    "numba_extensions",
    "xarray.backends",
    "jax_plugins",
    "pydantic",
    "matplotlib.backend",
    "distributed.comm.backends",
)
SETTINGS = {
    ".numba_config.yaml": "cache_dir: cache\ndisable_jit: 1\n",
    "matplotlibrc": "text.usetex: True\n",
    "arvizrc": "plot.backend: trap\n",
    "kittest.toml": "[",  # of the viewer that draws without a screen
    "trap-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: trap\nVersion: 1.0\n",
    "trap-1.0.dist-info/entry_points.txt": "".join(f"[{group}]\ninit = trap:init\n" for group in GROUPS),
    **dict.fromkeys(
        ("MUJOCO_LOG.TXT", ".env", ".netrc", "dask.yaml", ".dask/dask.yaml", ".config/dask/dask.yaml"), "trap"
    ),
    **dict.fromkeys(
        ("keras.json", ".keras/keras.json", "setup.cfg", "pyproject.toml", "fonts.conf", "trap.pth"), "trap"
    ),
}
# git obeys these: where they are beside the data, above it, and in a folder that is itself a repository
GIT = {
    "HEAD": "ref: refs/heads/main\n",
    "refs/heads/main": "a" * 40 + "\n",
    "objects/info/packs": "",
    "config": '[core]\n\trepositoryformatversion = 0\n\tfsmonitor = {program}\n[filter "trap"]\n\tclean = {program}\n',
}
PROGRAMS = ("git", "latex", "pdflatex", "xelatex", "dvipng", "kpsewhich", "rerun", "python", "python3", "lscpu")


@dataclass(frozen=True)
class Place:
    """A folder of data in a folder of traps; ``marks`` has what was run or read of them."""

    work: Path
    data: Path
    environment: dict[str, str]
    marks: Path
    traps: dict[Path, bytes]

    def ask(self, *words: str) -> subprocess.CompletedProcess[str]:
        """``icmj`` as it is installed: a script elsewhere."""
        script = self.work.parent.parent / "icmj"
        command = [sys.executable, str(script), *words]
        return subprocess.run(
            command, cwd=self.work, env=self.environment, capture_output=True, text=True, timeout=PATIENCE
        )


def set_traps(folder: Path, marks: Path, program: Path, bare: bool) -> dict[Path, bytes]:
    modules = {module.name for module in pkgutil.iter_modules()} | sys.stdlib_module_names
    names = {*modules, "icmj", "trap", "sitecustomize", "usercustomize"} - {"__main__"}
    files = {f"{name}.py": f"open({str(marks)!r}, 'a').write('run {name}\\n')\n" for name in names}
    files |= SETTINGS | {"jax_plugins/trap/__init__.py": files["trap.py"]}
    files |= {f"{'' if bare else '.git/'}{name}": text.format(program=program) for name, text in GIT.items()}
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return {folder / name: text.encode() for name, text in files.items()}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Place:
    top = tmp_path_factory.mktemp("traps")
    above, marks = top / "above", top / "marks"
    work, data, programs, shim = above / "work", above / "data", top / "programs", top / "shim"
    for folder in (work, data, programs, shim):
        folder.mkdir(parents=True)
    for name in PROGRAMS:
        (programs / name).write_text(f"#!/bin/sh\necho run {name} >> {marks}\nexit 1\n")
        (programs / name).chmod(0o755)
    traps = set_traps(above, marks, programs / "git", bare=False)
    traps |= set_traps(work, marks, programs / "git", bare=False)
    traps |= set_traps(data, marks, programs / "git", bare=True)
    (top / "traps.json").write_text(json.dumps([str(path) for path in traps if ".git" not in path.parts]))
    (top / "icmj").write_text("from icmj.cli.main import entry\nentry()\n")
    (shim / "sitecustomize.py").write_text(WATCH)
    shutil.copy(ROOT / "models" / "pendulum.xml", data)
    shutil.copy(ROOT / "examples" / "standing.csv", data)
    run = (ROOT / "runs" / "simple-0.8.toml").read_text().replace("../models/", "")
    (data / "run.toml").write_text(run)
    vary = '[[vary]]\nfield = "actual.gain"\nlow = 0.7\nhigh = 1.3\ncount = 3\n'
    (data / "sweep.toml").write_text(f'[sweep]\nname = "s"\nrun = "run.toml"\nchunk = 1\n{vary}')
    quiet = "[quiet_standing]\nduration = 20.0\nsettle = 2.0\n"
    head = '[experiment]\nname = "e"\nplants = ["linear"]\nrepetitions = 2\nseed = 1\n'
    (data / "experiment.toml").write_text(f'{head}{quiet}[[case]]\nrun = "quiet-standing"\n')
    write_log(run_case(load_run(data / "run.toml"), "linear"), data / "run.rrd")
    path = os.pathsep.join([str(shim), *(place for place in sys.path if place)])
    found = {"TRAPS": str(top / "traps.json"), "MARKS": str(marks), "PYTHONPATH": path}
    found["PATH"] = f"{programs}{os.pathsep}{os.environ['PATH']}"
    return Place(work, data, {**os.environ, **found}, marks, traps)


SHORT = " --set ".join(
    ("", "simulation.duration=4.0", "study.growth_points=0", "study.attractor_starts=0", "study.law_q_t=[]")
)
# every command, with what it is asked; DATA is the folder of data
COMMANDS = {
    "cases": ["cases"],
    "new": ["new DATA/pendulum.xml --out new.toml"],
    "person": ["person three_link"],
    "linearise": ["linearise DATA/pendulum.xml"],
    "schema": ["schema run"],
    "analyse": ["analyse DATA/run.toml"],
    "cycle": ["cycle DATA/run.toml --plant linear"],
    "continue": ["continue DATA/run.toml --plant linear --parameter b --to 0.79 --points 3"],
    "run": ["run DATA/run.toml SHORT"],
    "study": ["study DATA/run.toml SHORT --jobs 2"],
    "live": ["live DATA/run.toml"],
    "sweep": ["sweep DATA/sweep.toml --jobs 2"],
    "experiment": [
        "experiment DATA/experiment.toml --jobs 2 --out simulated",
        "experiment DATA/experiment.toml --recording DATA/standing.csv --rate 100 --out recorded",
    ],
    "report": ["report DATA/run.rrd"],
    "replay": ["replay DATA/run.rrd --screenshot picture.png"],
    "export": ["export DATA/run.rrd --to csv --out rows.csv"],
    "measure": ["measure DATA/standing.csv --rate 100"],
    "identify": ["identify DATA/run.rrd"],
    "fit": ["fit DATA/standing.csv --model event --rate 100 --columns ap --draws 1"],
}


def spring_none(place: Place, words: str) -> subprocess.CompletedProcess[str]:
    place.marks.write_text("")
    done = place.ask(*words.replace("SHORT", SHORT).replace("DATA", str(place.data)).split())
    assert place.marks.read_text() == ""
    assert not (place.work / "cache").exists()
    assert [path for path, content in place.traps.items() if path.read_bytes() != content] == []
    return done


def test_the_commands_are_all_there() -> None:
    assert set(COMMANDS) == set(KNOWN.names)


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_no_command_springs_a_trap(command: str, place: Place) -> None:
    for words in COMMANDS[command]:
        done = spring_none(place, words)
        refused = {"fit": "--draws 1: expected at least 100"}.get(command, "")
        assert done.returncode == (2 if refused else 0), done.stderr
        assert refused in done.stderr
