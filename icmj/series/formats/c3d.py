"""C3D files of motion capture and force plates, read by ezc3d in a separate process.

ezc3d is the maintained reader of this format, with a peer-reviewed description and with the centre of pressure of all
types of force plates. A damaged file can end the process that reads it, so that this is another one, with limits on
time and memory; it hands the signals back as arrays.
"""

from __future__ import annotations

import importlib.util
import os
import struct
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from icmj.base.array import Array
from icmj.base.bounded_program import run_bounded
from icmj.base.files import open_file
from icmj.base.text import one_line
from icmj.errors import DataError
from icmj.series.c3d_reader import LEAST_LOAD, REFUSED
from icmj.series.columns import MOST_NUMBERS
from icmj.series.series import Series, expect_names_differ, place

SUFFIXES = (".c3d",)

LONGEST_READ = 120.0  # s on the clock
# bytes of addresses: at most, for the libraries, and for each byte of a file, of which ezc3d takes 14 for floats
MEMORY, LIBRARIES, PER_BYTE = 1_400_000_000, 400_000_000, 30
_MOST = 65535  # frames that a header can count
GROUPS = ("centres of pressure", "forces", "points", "analog channels", "centres of single plates")
# each more takes 40 MB of the addresses that the reader may use, on a machine of sixty processors all of them
_ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_READER = Path(__file__).parents[1] / "c3d_reader.py"


@dataclass(frozen=True)
class Group:
    """Signals of one kind, which share a rate.

    Attributes:
        kind: one of :data:`GROUPS`.
        names, units: of the signals.
        rate: rows per second [Hz].
        start: of the first row [s].
        values: shape (N, w).
        fault: why there are none of these though there should be; "" if there are.
        odd: what is odd about them, in words.
    """

    kind: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    rate: float
    start: float
    values: Array
    fault: str = ""
    odd: str = ""


def read_groups(path: Path, longest: float = LONGEST_READ) -> tuple[Group, ...]:
    """The groups of a C3D file that have signals: centres of pressure and forces of plates, points, analog channels.

    Raises:
        DataError: if ezc3d is not installed, the file cannot be read, or it has fewer frames than its header says.
        OSError: if it cannot be opened.
    """
    if importlib.util.find_spec("ezc3d") is None:
        raise DataError("ezc3d, which reads C3D, is not installed; `pip install ezc3d`")
    with tempfile.TemporaryDirectory(prefix="icmj-c3d-") as folder:
        found = Path(folder, "found.npz")
        try:
            command = [sys.executable, "-I", str(_READER), str(path.absolute()), str(found)]
            most = min(MEMORY, LIBRARIES + PER_BYTE * path.stat().st_size)
            done = run_bounded(command, longest, addresses=most, environment=_ONE_THREAD)
        except subprocess.TimeoutExpired as error:
            raise DataError(f"not a C3D file that can be read (it takes more than {longest:g} s)") from error
        if done.returncode or not found.exists():
            said = done.stderr.strip().splitlines()
            own = said and done.returncode == REFUSED
            why = one_line(said[-1], 120) if own else f"reading it ended the reader, which may use {MEMORY / 1e9:g} GB"
            raise DataError(f"not a C3D file that can be read ({why})")
        with np.load(found, allow_pickle=False) as data:
            _refuse_part(int(data["frames"][0]), _frames(path, data["ends"].tolist()))
            fault = one_line(data["fault"].item(), 120)
            lost = (Group(GROUPS[0], (), (), 0.0, 0.0, np.empty((0, 0)), fault),) if fault else ()
            return lost + tuple(
                Group(
                    kind,
                    tuple(data[f"{i} names"].tolist()),
                    tuple(data[f"{i} units"].tolist()),
                    float(data[f"{i} rate"]),
                    float(data[f"{i} start"]),
                    data[f"{i} values"],
                    odd=data["odd"].item() if "odd" in data and kind in (GROUPS[0], GROUPS[-1]) else "",
                )
                for i, kind in enumerate(GROUPS)
                if f"{i} values" in data.files
            )


def _frames(path: Path, ends: Sequence[int]) -> int:
    """The number of frames that a file says that it has; ezc3d replaces it by the number that it found.

    Its header counts to 65535. In a longer file the group TRIAL has the numbers of the first frame and the last; where
    it does not, the number follows from the size, but for the rest of a block that the data do not fill.
    """
    with open_file(path, np.inf) as file:
        size = os.fstat(file.fileno()).st_size
        head = file.read(4096).lstrip(b"\0")[:20].ljust(20, b"\0")  # some begin with zeros
        file.seek(512 * (max(head[0], 1) - 1) + 3)
        order = ">" if file.read(1) == b"V" else "<"  # 86: numbers as of MIPS
    points, analogs, first, last, _, scale, begin = struct.unpack(f"{order}5HfH", head[2:18])
    if last == _MOST and len(ends) == 4:
        first, last = (low % 65536 + 65536 * (high % 65536) for low, high in (ends[:2], ends[2:]))
    elif last == _MOST:
        frame = (4 * points + analogs) * (4 if scale < 0 else 2)  # bytes
        return max(last - first + 1, (size - 512 * (begin - 1) - 511) // max(frame, 1))
    return int(last - first + 1)


def _refuse_part(read: int, promised: int) -> None:
    if read < promised and read == _MOST:
        raise DataError(f"{promised} frames or more, of which ezc3d reads {read}; cut it into parts")
    if read < promised:
        raise DataError(f"{read} frames where its header says {promised}; was it cut short?")


def group_for(groups: Sequence[Group], columns: Sequence[str]) -> Group:
    """The signals of these names, which may be in several groups; without names, the first group.

    Raises:
        DataError: if there is no signal or none of a name, or the rows of two are not at the same times.
    """
    if not groups:
        raise DataError("no signals in it")
    if not columns and (fault := groups[0].fault):
        some = ", ".join([name for group in groups for name in group.names][:3])
        raise DataError(f"its force plates cannot be read ({fault}); name what to read instead, such as {some}")
    if not columns:
        return groups[0]
    known = [name for group in groups for name in group.names]
    owner = [group for group in groups for _ in group.names]
    at = [place(known, name) for name in columns]
    times = {(owner[i].rate, owner[i].start, len(owner[i].values)) for i in at}
    if len(times) > 1:
        rates = " and ".join(f"{rate:g}" for rate in sorted({rate for rate, _, _ in times}))
        raise DataError(f"columns at {rates} Hz, which have no rows in common; ask for those of one rate")
    values = [owner[i].values[:, owner[i].names.index(known[i])] for i in at]
    units = tuple(owner[i].units[owner[i].names.index(known[i])] for i in at)
    first = owner[at[0]]
    odd = "; ".join(dict.fromkeys(owner[i].odd for i in at if owner[i].odd))
    names = tuple(known[i] for i in at)
    return Group(first.kind, names, units, first.rate, first.start, np.column_stack(values), odd=odd)


def read(path: Path, file: BinaryIO, columns: Sequence[str], rate: float | None) -> tuple[Series, ...]:
    group = group_for(read_groups(path), columns)
    expect_names_differ(group.names)
    if group.values.size > MOST_NUMBERS:
        raise DataError(f"{group.values.size} numbers; expected at most {MOST_NUMBERS / 1e6:g} million")
    t = group.start + np.arange(len(group.values)) / group.rate
    centres = np.array([".cop." in name for name in group.names])
    facts = {"odd": group.odd} if group.odd else {}
    if np.isnan(group.values[:, centres]).any():
        facts["load"] = f"below {LEAST_LOAD:g} N a plate has no centre of pressure"
    return (Series(t, group.values, group.names, group.units, facts),)
