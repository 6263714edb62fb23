"""rerun's own program, from inside the wheel and never from PATH: recordings are verified and salvaged by it."""

from __future__ import annotations

import importlib.util
import subprocess
from pathlib import Path

from icmj.base.bounded_program import run_bounded
from icmj.base.text import one_line
from icmj.errors import LogError

LONGEST = 120.0  # s on the clock; a log of a gigabyte takes a few
SECONDS, BYTES_A_SECOND = 5, 20_000_000  # of processor time; 240 MB take one second
MEMORY, PER_BYTE = 2 << 30, 8  # of which 240 MB take a quarter
_NONE = "0 files verified"


def find_program() -> Path:
    """The program in the rerun wheel.

    Raises:
        LogError: if rerun-sdk is not installed, or without its program.
    """
    spec = importlib.util.find_spec("rerun_cli")
    if spec is not None and spec.origin is not None:
        for name in ("rerun", "rerun.exe", "Rerun.app/Contents/MacOS/Rerun"):
            if (path := Path(spec.origin).parent / name).is_file():
                return path
    raise LogError("rerun's viewer is not installed; reinstall it with: pip install --force-reinstall rerun-sdk")


def verify(path: Path) -> str:
    """Decode the whole recording in a separate process; returns a description of its fault, or nothing.

    A damaged file can abort the process that decodes it (one in four thousand with a single bit flipped), or have it
    ask for all the memory there is (one wrong byte among the sizes at the file's end); that must not be ours. Takes
    0.05 s.
    """
    try:
        done = _run_bounded(["verify", str(path)], path)
    except subprocess.TimeoutExpired:
        return f"reading it took more than {LONGEST:g} s"
    none = _NONE in done.stderr  # so it ends, with status 0, where memory is short
    if done.returncode == 0 and not none:
        return ""
    lines = [line for line in map(one_line, done.stderr.splitlines()) if line and not (none or " WARN " in line)]
    reason = lines[0] if lines else "reading it takes more time or memory than a whole one"
    return reason.removeprefix(f'"{path}":').strip()[:200]


def salvage(path: Path, copy: Path) -> str:
    """Copy every whole chunk of a recording cut short to ``copy``; returns one sentence on what was saved.

    Raises:
        LogError: if nothing can be saved.
    """
    lost = f"{path}: not a rerun recording, or cut so short that nothing can be saved; run the case again"
    try:
        done = _run_bounded(["merge", "--continue-on-error", "-o", str(copy), str(path)], path)
    except subprocess.TimeoutExpired as error:
        raise LogError(lost) from error
    if done.returncode != 0 or not copy.is_file() or verify(copy):
        raise LogError(lost)
    return f"{path}: incomplete; what is whole of its {path.stat().st_size / 1e6:.2f} MB is salvaged, the rest is lost"


def _run_bounded(arguments: list[str], path: Path) -> subprocess.CompletedProcess[str]:
    """``rerun rrd`` with these arguments, held to what the recording at ``path`` could need if it were whole."""
    command, size = [str(find_program()), "rrd", *arguments], path.stat().st_size
    processor, data = SECONDS + size // BYTES_A_SECOND, MEMORY + PER_BYTE * size
    return run_bounded(command, LONGEST, processor=processor, data=data, environment={"NO_COLOR": "1"})
