"""Folders of sweeps, damaged: files cut, replaced, made pipes or links, facts and chunks of other types."""

import json
import os
import random
import shutil
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from sweep_cases import GRID, sweep_file
from tampering import reseal

Mutate = Callable[[random.Random, bytes], bytes]
ODD = (
    *(None, 0, -1, 10**30, 1e308, float("nan"), "", "x", "\x1b[31m", "[/]"),
    *([], {}, [[]], [1], ["a", "a"], {"a": []}, True),
)
_whole: list[Path] = []


def _dataset() -> Path:
    """A whole sweep of six points in three chunks, with its file; made once for a process."""
    from icmj.cli.main import main

    if not _whole:
        folder = Path(tempfile.mkdtemp(prefix="icmj-dataset-"))
        file = sweep_file(folder, GRID.format(count=6), chunk=2)
        main(["sweep", str(file), "--out", str(folder / "data"), "--jobs", "1"])
        _whole.append(folder)
    return _whole[0]


def damaged_folder(rng: random.Random, folder: Path, mutate_bytes: Mutate) -> list[str]:
    """A sweep's folder with a few things wrong in it, in ``folder``, and the command to put it to."""
    shutil.copytree(_dataset(), folder, dirs_exist_ok=True)
    (folder / "kept").write_text("somebody else's\n", encoding="utf-8")
    data = folder / "data"
    for _ in range(rng.choice((1, 1, 2, 3))):
        names = ("sweep.json", "sweep.json", "sweep.json", "points", "timing.csv", ".lock")
        places = [*names, *(f"points/{i:08d}.parquet" for i in range(3))]
        _damage(rng, data / rng.choice(places), folder, mutate_bytes)
    with suppress(OSError, UnicodeError):
        if rng.random() < 0.7:  # as whoever changes a file can
            reseal(data)
    if rng.random() < 0.5:
        return ["report", "data", "--out", "out.html"]
    return ["sweep", "sweep.toml", "--out", "data", "--jobs", "1"]


def _damage(rng: random.Random, place: Path, folder: Path, mutate_bytes: Mutate) -> None:
    if not place.parent.is_dir():  # what came before took its folder
        return None
    regular = place.is_file() and not place.is_symlink()
    if regular and place.name == "sweep.json" and rng.random() < 0.6:
        return _other_facts(rng, place)
    if regular and place.suffix == ".parquet" and rng.random() < 0.5:
        return _other_rows(rng, place)
    what = rng.randrange(8)
    if what == 0 and regular:
        place.write_bytes(mutate_bytes(rng, place.read_bytes()))
        return None
    if what == 1 and regular:
        odd = (b"", b"\0" * 100, b"[" * 10_000, b"{}", b"[]", b"null", place.read_bytes()[:-20])
        place.write_bytes(rng.choice(odd))
        return None
    if what == 2 and place.parent.is_dir():
        other = place.with_name(rng.choice(("x.parquet", "9.parquet", "99999999.parquet", "0.parquet", ".tmp", "ζ")))
        if not other.exists() and not other.is_symlink():
            other.write_bytes(rng.choice((b"", b"PAR1")))
        return None
    if place.is_symlink() or not place.is_dir():
        place.unlink(missing_ok=True)
    else:
        shutil.rmtree(place)
    if not place.parent.is_dir():
        return None
    if what == 3:
        os.mkfifo(place)
    elif what == 4:
        place.symlink_to(folder / "kept")
    elif what == 5:
        place.symlink_to(rng.choice((place, Path("/dev/zero"), Path("/dev/null"), folder / "nothing", folder)))
    elif what == 6:
        place.mkdir()
    return None


def _other_facts(rng: random.Random, place: Path) -> None:
    try:
        facts = json.loads(place.read_bytes())
    except (ValueError, RecursionError):
        return
    if not isinstance(facts, dict) or not facts:
        return
    for _ in range(rng.choice((1, 1, 2))):
        key = rng.choice(sorted(facts))
        if rng.random() < 0.2:
            facts.pop(key)
            if not facts:
                break
        else:
            facts[key] = rng.choice(ODD)
    place.write_text(json.dumps(facts), encoding="utf-8")


def _other_rows(rng: random.Random, place: Path) -> None:
    """A chunk whose columns are others, or have other types, or rows."""
    try:
        table = pq.read_table(place)
    except (pa.ArrowException, OSError):
        return
    what, i = rng.randrange(6), rng.randrange(max(table.num_columns, 1))
    if table.num_columns == 0 or what == 0:
        table = pa.table({})
    elif what == 1:
        table = table.drop_columns([table.column_names[i]])
    elif what == 2:
        odd = rng.choice((["x"], [None], [float("nan")], [10**15], [[1.0]], [{"a": 1}], [True], [b"\xff"]))
        table = table.set_column(i, table.column_names[i], pa.array(odd * table.num_rows))
    elif what == 3:
        table = table.slice(0, rng.choice((0, 1)))
    elif what == 4:
        table = pa.concat_tables([table, table])
    else:
        table = table.rename_columns([rng.choice(("a", "b", "point")) for _ in table.column_names])
    pq.write_table(table, place)
