"""Without what only Linux has, or only Unix: modules, signals, /proc. All is imported, and the commands work."""

import os
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import venv
from pathlib import Path

import numpy as np
import pytest
from patience import PATIENCE
from sweep_cases import GRID, THRESHOLDS, sweep_file

from icmj.work.shipped import MODELS, RUNS

ROOT = Path(__file__).resolve().parent.parent

# a `sitecustomize` of every process, workers too: what icmj imports lacks these, and libraries have their own ways
# elsewhere, so it is icmj that finds them absent
BARE = '''
import builtins, errno, io, os, stat, sys, types

ABSENT = os.environ["ABSENT"].split()
MODULES = {name for name in ABSENT if name.islower() and "." not in name and "/" not in name}
NAMES = {name for name in ABSENT if "." in name}
REFUSED = (errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))

class Bare(types.ModuleType):
    """A module without what this system does not have."""

    def __init__(self, whole, replaced):
        super().__init__(whole.__name__)
        self.__dict__.update(replaced, __whole__=whole)

    def __getattr__(self, name):
        whole = self.__dict__["__whole__"]
        if f"{whole.__name__}.{name}" in NAMES:
            raise AttributeError(f"module {whole.__name__!r} has no attribute {name!r}")
        return getattr(whole, name)

def replaced(name):
    """Functions of the module that are there and refuse."""

    def refuse(error):
        def function(*arguments, **named):
            raise error
        return function

    if name == "fcntl" and "LOCKS" in ABSENT:  # a file system that has none
        return {"flock": refuse(OSError(*REFUSED))}
    if name == "resource" and "LIMITS" in ABSENT:  # macOS
        return {"setrlimit": refuse(ValueError("current limit exceeds maximum limit"))}
    if name == "ctypes" and "PRCTL" in ABSENT:  # Windows: the program itself is no library
        import ctypes
        def library(name, *arguments, **named):
            if name is None:
                raise TypeError("bad argument type for built-in operation")
            return ctypes.CDLL(name, *arguments, **named)
        return {"CDLL": library}
    if name == "subprocess" and "DESCRIPTORS" in ABSENT:  # Windows
        import subprocess
        class Popen(subprocess.Popen):
            def __init__(self, *arguments, pass_fds=(), preexec_fn=None, **named):
                if pass_fds or preexec_fn:
                    raise ValueError("pass_fds, preexec_fn are not supported on Windows platforms")
                super().__init__(*arguments, **named)
        return {"Popen": Popen}
    if name == "os":
        found = {}
        if "FOLDERS" in ABSENT:  # Windows opens none, so that none is flushed
            def opened(path, *arguments, **named):
                if os.path.isdir(path):
                    raise PermissionError(errno.EACCES, "Permission denied", str(path))
                return os.open(path, *arguments, **named)
            found["open"] = opened
        if "POSIX" in ABSENT:
            found["name"] = "nt"
        return found
    return {}

BARES, load = {}, builtins.__import__

def importing(name, named=None, *more, **others):
    if not str((named or {}).get("__name__", "")).startswith("icmj."):
        return load(name, named, *more, **others)
    if name in MODULES:
        raise ModuleNotFoundError(f"No module named {name!r}")
    whole = load(name, named, *more, **others)
    if name not in ("os", "signal", "fcntl", "resource", "ctypes", "subprocess"):
        return whole
    if name not in BARES:
        BARES[name] = Bare(whole, replaced(name))
    return BARES[name]

def ours():
    frame = sys._getframe(2)
    passed_on = "pathlib", "io", "contextlib", "posixpath", "genericpath"
    while str(frame.f_globals.get("__name__")).split(".")[0] in passed_on:
        frame = frame.f_back
    return str(frame.f_globals.get("__name__", "")).startswith("icmj.")

def unless_proc(function):
    def found(path, *arguments, **named):
        if str(path).startswith("/proc") and ours():
            raise FileNotFoundError(2, "No such file or directory", str(path))
        return function(path, *arguments, **named)
    return found

builtins.__import__ = importing
if "/proc" in ABSENT:
    for module, name in ((builtins, "open"), (io, "open"), (os, "readlink"), (os, "stat")):
        setattr(module, name, unless_proc(getattr(module, name)))
'''
# what only Linux has, or only Unix, or only some file systems
FEATURES = {
    "fcntl": "fcntl",
    "locks of files": "LOCKS",
    "resource": "resource",
    "limits": "LIMITS",
    "prctl, terminals and users": "PRCTL pwd grp termios tty pty syslog readline curses",
    "proc and files in memory": "/proc os.memfd_create",
    "descriptors and forks": "DESCRIPTORS os.fork os.forkpty os.register_at_fork os.setsid os.killpg os.getppid",
    "signals": "signal.SIGKILL signal.SIGHUP signal.SIGXCPU os.waitpid",
    "timers": "signal.SIGALRM signal.setitimer signal.getitimer signal.ITIMER_REAL signal.alarm",
    "masks of signals": "signal.pthread_sigmask signal.SIG_BLOCK signal.SIG_UNBLOCK signal.SIG_SETMASK",
    "flags of files": "os.O_NONBLOCK os.O_NOFOLLOW os.O_CLOEXEC os.O_NOCTTY os.O_DIRECTORY os.sched_getaffinity",
    "flushed folders": "FOLDERS",
    "POSIX": "POSIX os.uname os.getuid os.geteuid os.getgid os.fchmod os.pread os.pwrite os.statvfs os.mkfifo",
}
ALL = " ".join(FEATURES.values())
# what is absent at once here, so that no other absence hides a way that is taken without it
TOGETHER = {
    "locks, limits and flushed folders": ("locks of files", "limits", "flushed folders", "timers"),
    "fcntl, resource and proc": ("fcntl", "resource", "proc and files in memory", "masks of signals"),
    "signals and flags": ("signals", "flags of files"),
    "terminals and descriptors": ("prctl, terminals and users", "descriptors and forks"),
    "POSIX": ("POSIX",),
}
EVERYTHING = """
import importlib, pkgutil, icmj
for module in pkgutil.walk_packages(icmj.__path__, "icmj."):
    if not module.name.startswith("icmj.shipped.runs."):
        importlib.import_module(module.name)
"""
HURRY = "from tampering import hurry; hurry()"  # what is trained, and how long, is the same anywhere
COMMANDS = """
import sys
from icmj.cli.main import main
for command in {commands!r}:
    status = main(command)
    assert status == 0, (command, status)
"""


def bare(program: str, folder: Path, absent: str = ALL, *more: str) -> subprocess.CompletedProcess[str]:
    """Run a program in ``folder`` where what is ``absent`` is, for it and for its workers."""
    shim = folder / "shim"
    shim.mkdir(exist_ok=True)
    (shim / "sitecustomize.py").write_text(BARE)
    path = os.pathsep.join([str(shim), *(place for place in sys.path if place)])
    environment = {**os.environ, "PYTHONPATH": path, "MPLCONFIGDIR": str(folder), "ABSENT": absent}
    command = [sys.executable, "-c", program, *more]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=PATIENCE)


def well(done: subprocess.CompletedProcess[str]) -> None:
    assert done.returncode == 0, done.stderr[-3000:]
    assert "mistake" not in done.stderr
    assert "Warning" not in done.stderr
    assert "Traceback" not in done.stderr


def experiment_file(folder: Path) -> Path:
    """Quiet standing of one case, two short trials."""
    path = folder / "short.toml"
    path.write_text(
        '[experiment]\nname = "short"\nplants = ["linear"]\nrepetitions = 2\nseed = 1\n'
        "[quiet_standing]\nduration = 20.0\nsettle = 2.0\n"
        '[[case]]\nrun = "quiet-standing"\n'
    )
    return path


def test_every_module_is_imported_without_what_only_linux_has(tmp_path: Path) -> None:
    well(bare(EVERYTHING, tmp_path))


def test_the_features_are_absent_for_icmj_in_its_workers_too(tmp_path: Path) -> None:
    """What these tests rest on: the same line, here and in a worker, as a module of icmj would have it."""
    program = """
import sys
from icmj.work.workers import Task, Workers
LOOK = '''
def look(progress):
    import os, signal, subprocess
    try:
        import fcntl
    except ImportError:
        fcntl = None
    return [fcntl, hasattr(os, "fork"), hasattr(os, "O_NOFOLLOW"), hasattr(signal, "SIGKILL"), os.name, os.getpid() > 0]
'''
class Look:
    __name__ = "look"
    def __reduce__(self):
        return eval, ("(lambda named: exec(%r, named) or named['look'])({'__name__': 'icmj.look'})" % LOOK,)
here = {"__name__": "icmj.look"}
exec(LOOK, here)
with Workers(1) as workers:
    (news,) = workers.run([Task("look", Look(), ())])
assert news.value == here["look"](None) == [None, False, False, False, "nt", True], news.value
"""
    well(bare(program, tmp_path))


ONE = ["--set", "simulation.duration=4.0", "--set", "study.growth_points=0", "--set", "study.attractor_starts=0"]
SHORT = ["--set", "simulation.duration=15.0", "--set", "study.growth_points=2", "--set", "study.attractor_starts=1"]


@pytest.mark.slow
@pytest.mark.parametrize("which", TOGETHER)
def test_a_run_and_a_sweep_without(which: str, tmp_path: Path) -> None:
    """A log, and a folder filled by two processes; what else there is writes and computes by the same means."""
    assert sorted(feature for features in TOGETHER.values() for feature in features) == sorted(FEATURES)
    sweep = sweep_file(tmp_path, GRID.format(count=3), chunk=1)
    commands = [
        ["run", "simple-0.8", *ONE, "--plant", "linear", "--out", "run"],
        ["sweep", str(sweep), "--out", "swept", "--jobs", "2"],
    ]
    well(bare(COMMANDS.format(commands=commands), tmp_path, " ".join(FEATURES[one] for one in TOGETHER[which])))
    assert (tmp_path / "run" / "simple-0.8.linear.rrd").is_file()


@pytest.mark.slow
def test_the_command_line_does_its_work_without_what_only_linux_has(tmp_path: Path) -> None:
    many = tmp_path / "many.xml"  # a model that is tried in a process of its own
    balls = '<replicate count="301" offset="0 0 1"><geom size="0.01"/></replicate>'
    bodies = f'<body pos="0 0 1"><joint name="lean" axis="0 1 0"/><geom size="0.1"/>{balls}</body>'
    motor = '<actuator><motor name="torque" joint="lean"/></actuator><sensor><jointpos name="y" joint="lean"/></sensor>'
    many.write_text(f"<mujoco><worldbody>{bodies}</worldbody>{motor}</mujoco>")
    short = ["simple-0.8", "--set", "simulation.duration=4.0"]
    commands = [
        ["--help"],
        ["analyse", "simple-0.8"],
        *(["run", *short, "--plant", plant, "--out", f"out-{plant}"] for plant in ("linear", "mujoco")),
        ["export", "out-linear/simple-0.8.linear.rrd", "--to", "csv", "--out", "sway.csv"],
        ["cycle", "simple-0.8"],
        ["linearise", str(many)],
        ["sweep", str(sweep_file(tmp_path, GRID.format(count=3) + THRESHOLDS)), "--out", "swept", "--jobs", "2"],
        ["experiment", str(experiment_file(tmp_path)), "--out", "experiment", "--jobs", "2"],
    ]
    well(bare(COMMANDS.format(commands=commands), tmp_path))


@pytest.mark.slow
def test_a_study_of_several_cases_and_a_fit_without_what_only_linux_has(tmp_path: Path) -> None:
    """The paper's case in three links, one without a cycle, one under noise; the cases are all one way."""
    noise = np.random.default_rng(0).normal(size=3000)
    sway = np.convolve(noise, np.exp(-np.arange(200) / 40))[:3000]
    rows = "".join(f"{0.02 * i:.2f},{y:.4f}\n" for i, y in enumerate(sway))
    (tmp_path / "sway.csv").write_text("t,cop\n" + rows)
    small = ["--model", "clock", "--simulations", "200", "--draws", "100", "--jobs", "2"]
    commands = [
        ["study", "three-link-0.9", "simple-exact", "quiet-standing", *SHORT, "--out", "study", "--yes"],
        ["fit", "sway.csv", "--columns", "cop", "--unit", "mm", *small, "--out", "fit", "--trained", "families"],
    ]
    well(bare(HURRY + COMMANDS.format(commands=commands), tmp_path))
    assert len([*(tmp_path / "study").glob("*.rrd")]) == 6
    assert (tmp_path / "study" / "report.html").is_file()
    assert (tmp_path / "fit" / "report.html").is_file()


def test_shipped_files_are_found_where_git_makes_no_links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shipped = tmp_path / "icmj" / "shipped"
    shipped.mkdir(parents=True)
    for shelf in (RUNS, MODELS):
        (shipped / shelf.kind).write_text(f"../../{shelf.kind}")
        (tmp_path / shelf.kind).symlink_to(ROOT / shelf.kind)
    found = {shelf.kind: set(shelf.files) for shelf in (RUNS, MODELS)}
    monkeypatch.setattr("icmj.work.shipped.SHIPPED", shipped)
    assert found == {shelf.kind: set(shelf.files) for shelf in (RUNS, MODELS)}
    assert "simple-0.8" in found["runs"]


@pytest.mark.slow
def test_a_script_in_the_folder_above_a_checkout_finds_the_package(tmp_path: Path) -> None:
    """It was ``module 'icmj' has no attribute 'read_log'``: the checkout's folder, taken for a package of no files."""
    checkout, place = tmp_path / "icmj", tmp_path / "environment"
    checkout.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE", "MANIFEST.in"):
        shutil.copy(ROOT / name, checkout)
    kept = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "icmj", checkout / "icmj", symlinks=True, ignore=kept)
    for shelf in ("models", "runs", "sweeps", "experiments", "families"):
        shutil.copytree(ROOT / shelf, checkout / shelf, ignore=shutil.ignore_patterns("out"))
    venv.create(place, with_pip=False)
    python = place / ("Scripts" if os.name == "nt" else "bin") / "python"
    # what it needs is lent; editable installs of the lender are not
    Path(sysconfig.get_path("purelib", vars={"base": str(place)}), "lent.pth").write_text(sysconfig.get_path("purelib"))
    hidden = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")
    environment = {key: value for key, value in os.environ.items() if key not in hidden}
    install = [sys.executable, *f"-m pip --python {python} install -q --no-deps --no-build-isolation".split()]
    subprocess.run([*install, "-e", str(checkout)], check=True, capture_output=True, env=environment, cwd=tmp_path)
    script = tmp_path / "script.py"
    script.write_text("import icmj\nprint(icmj.__file__, icmj.read_log.__name__)\n")
    done = subprocess.run([python, script], capture_output=True, text=True, env=environment, cwd=tmp_path)
    assert done.stdout.split() == [str(checkout / "icmj" / "__init__.py"), "read_log"], done.stderr


def test_workflows_call_the_commands_of_gate_and_readme_on_the_oldest_and_the_newest_python() -> None:
    yaml = pytest.importorskip("yaml")
    if not (ROOT / ".github").is_dir():
        pytest.skip("not a checkout")
    known = "".join((ROOT / name).read_text() for name in (".ci/run", ".ci/extras", "README.md", "CONTRIBUTING.md"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    versions = [word.rpartition(" ")[2] for word in project["classifiers"] if word.startswith("Programming Language")]
    jobs = {}
    for path in (ROOT / ".github" / "workflows").glob("*.yml"):
        jobs |= yaml.safe_load(path.read_text())["jobs"]
    commands = {step["run"] for job in jobs.values() for step in job["steps"] if "run" in step}
    docs = "sphinx-build -W -n docs docs/build/html"
    assert {"ruff check .", "ruff format --check .", "mypy", ".ci/run", docs} <= commands
    for command in commands - {"python -m build"}:  # what is published; the tests of the wheel build it too
        words = command.split(" --out ")[0].split(" --study=")[0].split(" --from-nothing")[0]
        assert words in known, command
    matrix = jobs["tests"]["strategy"]["matrix"]
    assert matrix["python"] == [project["requires-python"].removeprefix(">="), versions[-1]]
    assert [system.partition("-")[0] for system in matrix["system"]] == ["ubuntu", "macos", "windows"]
