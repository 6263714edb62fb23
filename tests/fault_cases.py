"""icmj as a process of its own, to be ended at any moment, and what must hold of what it leaves."""

import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import psutil
from patience import PATIENCE

ROOT = Path(__file__).resolve().parent.parent
GONE_WITHIN = 5.0  # s after a signal until no process and no open stream is left; workers notice within two
COMMAND = ("-m", "icmj.cli")
# says at once and ten times a second what it does, so that its moments can be met however fast the processor is
TALKATIVE = (
    "-c",
    "from icmj.cli import main, progress as working; working.FIRST = working.LEAST = working.SHARE = 0.0; "
    "working.PAUSE = 0.1; main.entry()",
)
SHORT = """
[case]
name = "{name}"
title = "Short"
[assumed]
model = "{model}"
keyframe = "upright"
[actual]
gain = 0.8
[design]
R_c = 0.1
R_o = 0.01
[controller]
q_t = 0.01
delta_min = 0.01
[simulation]
duration = {duration}
initial = {{ hinge = 0.02 }}
{more}
[study]
growth_points = 2
"""


def short_run(folder: Path, name: str = "short", duration: float = 60.0, more: str = "") -> Path:
    """A run file whose run takes about a second; ``more`` stands in its simulation's table."""
    path = folder / f"{name}.toml"
    path.write_text(SHORT.format(name=name, model=ROOT / "models" / "pendulum.xml", duration=duration, more=more))
    return path


def start(*arguments: str | Path, program: tuple[str, str] = COMMAND, **options: object) -> subprocess.Popen[str]:
    """``icmj`` in a session of its own, ready to be signalled."""
    process = subprocess.Popen(
        [sys.executable, *program, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | {"PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"},
        **options,  # type: ignore[call-overload]
    )
    return process


@dataclass(frozen=True)
class End:
    """How a process ended: status, what it said, how long after the signal it and its streams were gone [s]."""

    status: int
    out: str
    err: str
    took: float


def seen(sign: Callable[[], bool], within: float = PATIENCE) -> None:
    """Wait for a sign of what a process does."""
    deadline = time.monotonic() + within
    while not sign():
        assert time.monotonic() < deadline, "no sign of it"
        time.sleep(0.002)


def says(process: subprocess.Popen[str], words: str) -> None:
    """Read a process's standard error until it says this, as a pattern."""
    assert process.stderr is not None
    for line in process.stderr:
        if re.search(words, line):
            return
    raise AssertionError(f"it ended without a word of {words!r}")


def end(process: subprocess.Popen[str], signum: int, after: float) -> End:
    """Signal a process ``after`` so many seconds from when it can take one, as a terminal would signal Ctrl-C.

    One that has ended by then is not waited for.
    """
    _handles_signals(process)
    session, due = process.pid, time.monotonic() + after
    while process.poll() is None and (left := due - time.monotonic()) > 0:
        time.sleep(min(left, 0.02))
    if process.poll() is None:
        (os.killpg if signum == signal.SIGINT else os.kill)(session, signum)
    begin = time.monotonic()
    try:
        out, err = process.communicate(timeout=PATIENCE)  # until every holder of the streams is gone
    except subprocess.TimeoutExpired:
        os.killpg(session, signal.SIGKILL)
        raise
    took = time.monotonic() - begin
    while members(session) and time.monotonic() - begin < PATIENCE:
        time.sleep(0.05)
        took = time.monotonic() - begin
    return End(process.returncode, out, err, took)


def members(session: int) -> list[psutil.Process]:
    """Processes of a session that have not ended."""
    found = []
    for process in psutil.process_iter():
        try:
            if os.getsid(process.pid) == session and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process)
        except (psutil.Error, OSError):
            continue
    return found


def moments(seed: int, count: int, longest: float) -> list[tuple[int, float]]:
    """Signals and when to send them [s]."""
    rng = random.Random(seed)
    signals = (signal.SIGTERM, signal.SIGINT, signal.SIGKILL)
    return [(int(signals[i % 3]), rng.uniform(0, longest)) for i in range(count)]


def check(found: End, signum: int) -> None:
    """What must hold however and whenever it was ended."""
    assert "Traceback" not in found.err, found.err
    assert found.took < GONE_WITHIN, found
    if signum == signal.SIGKILL:
        assert found.status in (-9, 0)
    else:
        assert found.status in (0, 128 + signum), found
    if found.status == 128 + signum:
        assert found.err.strip().splitlines()[-1] == "icmj: interrupted"


def check_folder(folder: Path) -> None:
    """Every file under its name is whole, and what else there is goes with the next run."""
    from icmj.log.reader import read_log
    from icmj.study.study import open_folder

    if not folder.exists():
        return
    for log in folder.glob("[!.]*.rrd"):
        read_log(log)
    for page in folder.glob("[!.]*.html"):
        assert page.read_text(encoding="utf-8").rstrip().endswith("</html>")
    open_folder(folder)
    assert not list(folder.glob(".*"))


def _handles_signals(process: subprocess.Popen[str]) -> None:
    """Wait until the handler for SIGTERM is there: before, it is the interpreter that starts and not icmj."""
    status = Path(f"/proc/{process.pid}/status")
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline and process.poll() is None:
        try:
            caught = next(line for line in status.read_text().splitlines() if line.startswith("SigCgt"))
        except (OSError, StopIteration):
            return
        if int(caught.split()[1], 16) >> (signal.SIGTERM - 1) & 1:
            return
        time.sleep(0.01)
