"""Recordings of people and tables of them, damaged: OpenSim's tables, CSV, C3D, lists of people, the public data's own.

A fit begins with reading; a family that is not there ends the command after that, before anything is simulated.
"""

import functools
import os
import random
import tempfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np

Mutate = Callable[[random.Random, bytes], bytes]

FORMATS = ("c3d", "mot", "sto", "csv", "people.csv", "BDSinfo.txt")
NUMBERS = ("0", "-1", "1", "12", "3000", "1e3", "9" * 10, "9" * 400, "-0", "0x10", "nan", "inf", "1e308", "", "x", "ζ")
CELLS = (
    *("", " ", "x", "..", "/", "/dev/zero", "a\0b", "x" * 5000, '"', '"a', "a,b", "\t"),
    *("1.txt", "trial.csv", "pipe.csv", "loop.csv"),
)
COLUMNS = (
    *("file", "person", " person ", "column", "group", "condition", "age", ""),
    *("Trial", "Subject", "Vision", "Surface", "AgeGroup"),
)


def damaged_recording(rng: random.Random, folder: Path, mutate_bytes: Mutate, kind: str = "") -> list[str]:
    """A recording or a table of them with a few things wrong in it, in ``folder``, and the command to put it to."""
    kinds = FORMATS if find_spec("ezc3d") else FORMATS[1:]
    kind = kind or rng.choice(kinds)
    path = folder / (kind if "." in kind else f"trial.{kind}")
    if kind == "c3d":
        content = _damaged_c3d(rng)
    elif kind in ("mot", "sto", "csv"):
        content = _damaged_lines(rng, _recording(rng, header=kind != "csv"))
    else:
        for name in ("trial.csv", "1.txt", "2.txt"):
            (folder / name).write_text(_recording(rng, header=False, whole=True), encoding="utf-8")
        (folder / "loop.csv").symlink_to("loop.csv")
        os.mkfifo(folder / "pipe.csv")
        content = _damaged_table(rng, public=kind == "BDSinfo.txt")
    if rng.random() < 0.3:
        content = mutate_bytes(rng, content)
    what = rng.random()
    if what < 0.02:
        os.mkfifo(path)
    elif what < 0.04:
        path.symlink_to("/dev/zero")
    elif what < 0.05:
        path.mkdir()
    else:
        path.write_bytes(content)
    if "." in kind:
        return ["fit", "--table", path.name, "--model", "none.toml"]
    if rng.random() < 0.3:
        return ["fit", path.name, "--model", "none.toml", *(["--columns", "ap"] if rng.random() < 0.5 else [])]
    since = ["--since", rng.choice(NUMBERS[:5])] if rng.random() < 0.2 else []
    columns = ["--columns", "P0.x"] if kind == "c3d" and rng.random() < 0.5 else []
    return ["measure", path.name, "--json", *since, *columns]


def _recording(rng: random.Random, header: bool, whole: bool = False) -> str:
    """Sway of 31 s at 100 Hz in millimetres; it may begin before 0."""
    rows = 3100 if whole or rng.random() < 0.7 else rng.choice((0, 1, 2, 30))
    noise = np.random.default_rng(rng.randrange(2**32))
    x = noise.normal(size=rows).cumsum()
    x = 5 * (x - x.mean()) / max(x.std(), 1e-9) if rows else x
    t = np.arange(rows) / 100 - rng.choice((0, 2.5))
    lines = ["Coordinates", "version=1", f"nRows={rows}", "nColumns=2", "inDegrees=yes", "endheader"] if header else []
    gap = "\t" if header else ","
    lines += [gap.join(("time", "ap" if header else "ap [mm]"))]
    return "\n".join((*lines, *(f"{a:.2f}{gap}{b:.6f}" for a, b in zip(t, x, strict=True)))) + "\n"


def _damaged_lines(rng: random.Random, text: str) -> bytes:
    lines = text.splitlines()
    for _ in range(rng.choice((0, 1, 1, 2))):
        lines = lines or [""]
        at = rng.randrange(min(len(lines), 9)) if rng.random() < 0.7 else rng.randrange(len(lines))
        what = rng.randrange(5)
        if what == 0 and "=" in lines[at]:
            lines[at] = f"{lines[at].split('=')[0]}={rng.choice((*NUMBERS, 'maybe', 'yes', 'no', 'YES'))}"
        elif what == 1:
            gap = "\t" if "\t" in lines[at] else ","
            cells = lines[at].split(gap)
            cells[rng.randrange(len(cells))] = rng.choice(NUMBERS)
            lines[at] = gap.join(cells)
        elif what == 2:
            del lines[at : len(lines) if rng.random() < 0.3 else at + 1]
        elif what == 3:
            lines.insert(at, rng.choice((lines[at], "", "# said", "endheader", "x" * 1000)))
        else:
            lines[at] = rng.choice((lines[at].replace("\t", ","), lines[at].upper(), f" {lines[at]} "))
    return "\n".join(lines).encode("utf-8", errors="surrogateescape")


def _damaged_table(rng: random.Random, public: bool) -> bytes:
    gap = "\t" if public else ","
    if public:
        head = ["Trial", "Subject", "Vision", "Surface", "AgeGroup"]
        rows = [head, *([trial, "1", "Open", "Firm", "Young"] for trial in "12")]
    else:
        head = ["file", "person", "condition"]
        rows = [head, ["trial.csv", "anna", "a"], ["1.txt", "anna", "a"], ["2.txt", "ben", ""]]
    for _ in range(rng.choice((0, 1, 1, 2, 3))):
        row = rng.choice(rows)
        what = rng.randrange(6)
        if what == 0 and row:
            row[rng.randrange(len(row))] = rng.choice(COLUMNS if row is rows[0] else CELLS)
        elif what == 1:
            del row[rng.randrange(len(row) + 1) :]
        elif what == 2:
            row.append(rng.choice(CELLS))
        elif what == 3:
            rows.insert(rng.randrange(len(rows) + 1), list(rng.choice(rows)))
        elif what == 4 and sum(map(len, map("".join, rows))) < 500:
            rows = [rows[0], *(rows[1:] * rng.choice((2, 1000, 100_000)))]
        else:
            rows[0] = [rng.choice((name, f" {name}", f"{name} ", name.upper())) for name in rows[0]]
    return rng.choice(("\n", "\r\n", "\r")).join(map(gap.join, rows)).encode("utf-8", errors="surrogateescape")


def _damaged_c3d(rng: random.Random) -> bytes:
    """Header and parameters are damaged more often than data, which any number may be."""
    content = bytearray(_c3d(rng.choice((0, 1))))
    for _ in range(rng.choice((0, 1, 2, 20))):
        at = rng.randrange(rng.choice((24, 512, 2048, len(content))))
        content[at] = rng.choice((0, 1, 127, 128, 255, rng.randrange(256)))
    if rng.random() < 0.4:
        del content[rng.randrange(len(content)) :]
    return bytes(content)


@functools.cache
def _c3d(analogs: int) -> bytes:
    """Two points at 100 Hz over 31 s, and perhaps four channels at 1000 Hz."""
    import ezc3d

    file, noise, rows = ezc3d.c3d(), np.random.default_rng(0), 3100
    points = np.ones((4, 2, rows))
    points[:3] = noise.normal(size=(3, 2, rows)).cumsum(axis=2)
    file["parameters"]["POINT"]["RATE"]["value"] = [100]
    file["parameters"]["POINT"]["LABELS"]["value"] = ("P0", "P1")
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["data"]["points"] = points
    if analogs:
        file["parameters"]["ANALOG"]["RATE"]["value"] = [1000]
        file["parameters"]["ANALOG"]["LABELS"]["value"] = ("A0", "A1", "A2", "A3")
        file["parameters"]["ANALOG"]["UNITS"]["value"] = ("V",) * 4
        file["data"]["analogs"] = noise.normal(size=(1, 4, 10 * rows))
    with tempfile.TemporaryDirectory() as folder:
        file.write(f"{folder}/trial.c3d")
        return Path(folder, "trial.c3d").read_bytes()
