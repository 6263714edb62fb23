"""``python -m tests.tampering`` from the checkout: what a trained folder, a sweep's and an experiment's hold, changed.

Single bits are flipped, and files replaced in some hundred ways: by pipes, folders and links, by what claims to be
gigabytes, by other types and shapes, most of them also with digests that fit. A command put to such a folder ends in
one line with status 2, or finds the same numbers as before; it never waits, and never takes much memory.
"""

import argparse
import functools
import hashlib
import io
import itertools
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

sys.path.insert(0, str(Path(__file__).parent))

from patience import PATIENCE
from sweep_cases import GRID, sweep_file
from terminal_cases import told

SUMS = "SHA256SUMS"
LONGEST = PATIENCE  # in which what is missing is simulated again
Change = Callable[[Path], object]

EXPERIMENT = """
[experiment]
name = "short"
plants = ["linear"]
repetitions = 2
[intersection_point]
duration = 4.0
settle = 1.0
[[case]]
run = "quiet-standing"
name = "own"
"""


@dataclass
class Tally:
    """What became of changed folders: counts, and each that ended otherwise than it should."""

    counts: Counter[str] = field(default_factory=Counter)
    failures: list[str] = field(default_factory=list)
    longest: float = 0.0


@dataclass(frozen=True)
class Subject:
    """A folder that a command trusts.

    Attributes:
        folder: whole; it is copied.
        commands: put to the copy one after the other; ``{}`` is its path.
        files: those in it that are read again.
    """

    folder: Path
    commands: tuple[tuple[str, ...], ...]
    files: tuple[str, ...]


# --- folders ----------------------------------------------------------------------------------------------------------


def hurry() -> None:
    """Fits of few and short simulations and small networks, compiled as they stand; what is trusted stays as it is."""
    os.environ["JAX_DISABLE_MOST_OPTIMIZATIONS"] = "1"  # they take longer than the training
    from icmj.fits import fit, network
    from icmj.fits import fit as families

    families.simulate_bank = functools.partial(families.simulate_bank, trials=1, duration=30.0)
    families.train_family.__kwdefaults__["check"] = 20
    families.MEMBERS = 1
    families.train_posterior = functools.partial(families.train_posterior, epochs=3, depth=1)
    families.train_choice = functools.partial(families.train_choice, epochs=3)
    network._WIDTHS = (16,)
    fit.PREDICTED = 25


def subject_of(kind: str, place: Path) -> Subject:
    """A folder of a kind in ``place``, made if it is not there."""
    from icmj.fits import page as fit_page

    generator = np.random.default_rng(0)
    x = np.cumsum(generator.normal(size=3100))
    x = 5 * (x - x.mean()) / x.std()
    (place / "anna.csv").write_text("t [s],ap [mm]\n" + "".join(f"{i / 100:.2f},{v:.6f}\n" for i, v in enumerate(x)))
    (place / "short.toml").write_text(EXPERIMENT)
    sweep = sweep_file(place, GRID.format(count=6), chunk=2, ask='motion = ["linear"]')
    fit = ("fit", str(place / "anna.csv"), "--model", "event", "--model", "predictor", "--simulations", "200")
    fit += ("--draws", "100", "--jobs", "1", "--json", "--trained", "{}/trained", "--out", "{}/out")
    commands = {
        "fit": (fit,),
        "sweep": (("sweep", str(sweep), "--jobs", "1", "--out", "{}"), ("report", "{}", "--out", "{}/../a.html")),
        "experiment": (("experiment", str(place / "short.toml"), "--jobs", "1", "--json", "--out", "{}"),),
    }
    folder = place / kind
    fit_page.write_fit = lambda *_: None  # of the numbers, which are compared
    for command in commands[kind] if not folder.exists() else ():
        status, said, _ = run(command, folder)
        assert status == 0, said
    patterns = ("bank.json", "sweep.json", "experiment.json", SUMS, "*.npz", "draws/*", "points/*", "trials/*")
    files = sorted({path for pattern in patterns for path in folder.rglob(pattern) if path.is_file()})
    return Subject(folder, commands[kind], tuple(path.relative_to(folder).as_posix() for path in files))


def run(command: tuple[str, ...], folder: Path) -> tuple[int, list[str], str]:
    """Status, lines of errors, and output of a command."""
    from icmj.cli.main import main

    with tempfile.TemporaryFile() as err, tempfile.TemporaryFile() as out:
        sys.stdout.flush()
        before = os.dup(1), os.dup(2)
        os.dup2(out.fileno(), 1), os.dup2(err.fileno(), 2)
        try:
            status = main([word.replace("{}", str(folder)) for word in command])
            sys.stdout.flush()
        finally:
            for handle, stream in zip(before, (1, 2), strict=True):
                os.dup2(handle, stream)
                os.close(handle)
        err.seek(0), out.seek(0)
        lines = told(err.read().decode(errors="replace"))
        return status, [line for line in lines if line.strip()], out.read().decode(errors="replace")


# --- changes ----------------------------------------------------------------------------------------------------------


def flip(bit: int) -> Change:
    def change(path: Path) -> None:
        content = bytearray(path.read_bytes())
        content[bit // 8 % len(content)] ^= 1 << bit % 8
        path.write_bytes(bytes(content))

    return change


def reseal(top: Path) -> None:
    """Make all digests those of the files that are there now, as whoever changes a file can."""
    for sums in top.rglob(SUMS):
        home, lines = sums.parent, []
        for line in sums.read_text().splitlines():
            path = home / line[66:]
            if path.is_file() and path.stat().st_size < 1e9:
                lines.append(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {line[66:]}\n")
        sums.write_text("".join(lines))


def instead(make: Change) -> Change:
    def change(path: Path) -> None:
        path.unlink()
        make(path)

    return change


def sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(10**12)


REPLACED: dict[str, Change] = {
    "a pipe": instead(os.mkfifo),
    "a folder": instead(Path.mkdir),
    "a link to zeros": instead(lambda path: path.symlink_to("/dev/zero")),
    "a link to nothing": instead(lambda path: path.symlink_to("nowhere")),
    "a link to itself": instead(lambda path: path.symlink_to(path.name)),
    "missing": Path.unlink,
    "empty": lambda path: path.write_bytes(b""),
    "half": lambda path: path.write_bytes(path.read_bytes()[: path.stat().st_size // 2]),
    "zeros": lambda path: path.write_bytes(bytes(path.stat().st_size)),
    "other": lambda path: path.write_bytes(b"PK\3\4PAR1{}[]\n"),
    "a terabyte": sparse,
}
DEEP = "[" * 100_000
ODD = (None, 0, -1, 10**30, float("nan"), "", "x", [], {}, [[1]], True)


def facts(**more: Any) -> Change:
    def change(path: Path) -> None:
        path.write_text(json.dumps(json.loads(path.read_text()) | more))

    return change


def without(key: str) -> Change:
    def change(path: Path) -> None:
        found = json.loads(path.read_text())
        del found[key]
        path.write_text(json.dumps(found))

    return change


def json_changes(path: Path) -> Iterator[tuple[str, Change]]:
    for text in ("", "{", "[1]", "null", DEEP, '{"seed": ' + "9" * 5000 + "}", "{}", "\xff"):
        yield f"JSON {text[:10]!r}", lambda there, text=text: there.write_text(text, encoding="latin-1")
    for key in json.loads(path.read_text()):
        yield f"without {key}", without(key)
        for odd in ODD:
            yield f"{key} = {odd!r}", facts(**{key: odd})


def rows(change: Callable[[pa.Table], pa.Table]) -> Change:
    def write(path: Path) -> None:
        table = change(pq.read_table(path))
        # without Arrow's own schema beside it, a dictionary is read as the text that it stands for
        plain = not any(pa.types.is_dictionary(each.type) for each in table.schema)
        pq.write_table(table, path, compression="zstd", store_schema=plain, dictionary_pagesize_limit=1 << 22)

    return write


def column(name: str, values: Callable[[int], pa.Array]) -> Change:
    def change(found: pa.Table) -> pa.Table:
        return found.set_column(found.column_names.index(name), name, values(len(found)))

    return rows(change)


def lists(values: Any, n: int, width: int) -> pa.Array:
    ends = np.arange(n + 1, dtype=np.int32) * width
    return pa.ListArray.from_arrays(pa.array(ends), pa.array(np.full(n * width, values)))


def long_row(found: pa.Table) -> pa.Table:
    """One row of a gigabyte and a half of zeros, in some kilobytes."""
    n, many = len(found), 200_000_000
    ends = np.r_[np.zeros(n, np.int32), np.int32(many)]
    big = pa.ListArray.from_arrays(pa.array(ends), pa.array(np.zeros(many)))
    i = next((i for i, f in enumerate(found.schema) if pa.types.is_list(f.type)), 0)
    return found.set_column(i, found.column_names[i], big)


def many_rows(found: pa.Table) -> pa.Table:
    """A hundred million rows, all like the first."""
    table = found.slice(0, 1)
    i = next(i for i, f in enumerate(found.schema) if pa.types.is_integer(f.type) or pa.types.is_floating(f.type))
    return pa.table({found.column_names[i]: np.zeros(100_000_000)}).replace_schema_metadata(table.schema.metadata)


def long_text(found: pa.Table) -> pa.Table:
    """A text of a megabyte in each of two thousand rows, which takes as much room as one."""
    text = pa.DictionaryArray.from_arrays(pa.array(np.zeros(2000, np.int32)), pa.array(["x" * (1 << 20)]))
    return pa.table({found.column_names[0]: text}).replace_schema_metadata(found.schema.metadata)


BOMBS = {change.__name__: change for change in (long_text, many_rows, long_row)}
"""Made in a process of their own, as the memory that they take is not that of the command."""


def table_changes(path: Path) -> Iterator[tuple[str, Change]]:
    found = pq.read_table(path)
    for name in found.column_names:
        yield f"without {name}", rows(lambda t, name=name: t.drop_columns([name]))
        for kind, one in (("text", "a"), ("null", None), ("whole", 10**15), ("list", [1.0]), ("map", {"a": 1})):
            yield f"{name} of {kind}", column(name, lambda n, one=one: pa.array([one] * n))
    for name in (each.name for each in found.schema if pa.types.is_list(each.type)):
        width = len(found[name][0])
        for value, w in ((np.nan, width), (np.inf, width), (0.0, width + 1), (0.0, 0), (1, width)):
            yield f"{name} {w} of {value!r}", column(name, lambda n, value=value, w=w: lists(value, n, w))
        ragged = [[0.0] * (width - 1), [0.0] * (width + 1)]
        yield f"{name} ragged", column(name, lambda n, ragged=ragged: pa.array((ragged * n)[:n]))
    for name in BOMBS:
        yield (
            name,
            lambda there, name=name: subprocess.run([sys.executable, __file__, "--bomb", name, there], check=True),
        )
    yield "no row", rows(lambda t: t.slice(0, 0))
    yield "twice as many rows", rows(lambda t: pa.concat_tables([t, t]))
    yield "no metadata", rows(lambda t: t.replace_schema_metadata({}))
    yield "another order", rows(lambda t: t.take(pa.array(np.arange(len(t))[::-1])))


def arrays(change: Callable[[dict[str, Any]], Mapping[str, Any]]) -> Change:
    def write(path: Path) -> None:
        with np.load(path) as data:
            found = {name: data[name] for name in data.files}
        content = io.BytesIO()
        np.savez(content, **change(found))
        path.write_bytes(content.getvalue())

    return write


@functools.cache
def unpacking() -> bytes:
    """An archive of an array whose header says that it has a terabyte, and of one that unpacks to two gigabytes."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as packed:
        head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (125000000000,), }\n"
        packed.writestr("stood.npy", b"\x93NUMPY\1\0" + len(head).to_bytes(2, "little") + head)
        with packed.open("head.npy", "w") as file:
            for _ in range(2000):
                file.write(bytes(1_000_000))
    return content.getvalue()


def huge(path: Path) -> None:
    path.write_bytes(unpacking())


def heads(**more: Any) -> Change:
    def change(found: dict[str, Any]) -> dict[str, Any]:
        return found | {"head": np.array(json.dumps(json.loads(str(found["head"])) | more))}

    return arrays(change)


def nets(**more: Any) -> Change:
    def change(found: dict[str, Any]) -> dict[str, Any]:
        head = json.loads(str(found["head"]))
        head["networks"] = [one | more for one in head["networks"]]
        return found | {"head": np.array(json.dumps(head))}

    return arrays(change)


def npz_changes(path: Path) -> Iterator[tuple[str, Change]]:
    yield "huge", huge
    yield "pickled", lambda there: np.savez(there.open("wb"), head=np.array([{}, None], dtype=object))
    with np.load(path) as data:
        names, head = data.files, json.loads(str(data["head"])) if "head" in data.files else {}
        for name in names:
            yield f"without {name}", arrays(lambda found, name=name: {k: v for k, v in found.items() if k != name})
            for odd in (np.nan, np.inf, 0.0, "x", [[[1.0]]], 1 + 1j):
                if data[name].dtype.kind == "f" and np.ndim(odd) == 0 and not isinstance(odd, str):
                    value = np.full(data[name].shape, odd)
                else:
                    value = np.array(odd)
                # a weight that is another finite number is a sound network, and only its digest tells
                if odd != 0.0 or not name.startswith("network"):
                    yield f"{name} = {odd!r}", arrays(lambda found, name=name, value=value: found | {name: value})
    for text in ("", "[", "[]", "null", DEEP):
        yield f"head {text[:5]!r}", arrays(lambda found, text=text: found | {"head": np.array(text)})
    for key in head:
        for odd in ODD:
            yield f"head.{key} = {odd!r}", heads(**{key: odd})
    for key in head.get("networks", [{}])[0]:
        for odd in (*ODD, 10**9):
            yield f"network.{key} = {odd!r}", nets(**{key: odd})
    if head:
        yield "names of others", heads(names=[f"{name}2" for name in head["names"]])


INSIDE = {".json": json_changes, ".parquet": table_changes, ".npz": npz_changes}


def cases(subject: Subject, most_replaced: int, most_inside: int, seed: int) -> Iterator[tuple[str, str, Change, bool]]:
    """File, what is done to it, how, and whether its digest is made to fit: one file of each kind, all its changes.

    Of fewer than all replacements, each file has those that come after the last file's, so that all have their turn;
    of fewer than all changes inside, it has one that takes memory, from the ``seed``-th on in turn.
    """
    turns = itertools.cycle(REPLACED.items())
    bombs = itertools.islice(itertools.cycle(BOMBS), seed % len(BOMBS), None)
    kinds: dict[str, str] = {}
    for name in subject.files:
        of_one = r"(?<=[/-])[\da-f.-]+(?=[./])|-[\da-f]{16}|(?<=[.])\d{4}(?=[.])|predictor|event|check-|bank-"
        kinds.setdefault(re.sub(of_one, "", name), name)
    for name in kinds.values():
        for what, change in itertools.islice(turns, min(most_replaced, len(REPLACED))):
            yield name, what, change, False
        inside = list(INSIDE.get(Path(name).suffix, lambda _: [])(subject.folder / name))
        random.Random(seed).shuffle(inside)
        if most_inside < len(inside):
            memory = next(bombs) if name.endswith(".parquet") else "huge"
            inside = [one for one in inside if one[0] not in {*BOMBS} - {memory}]
            inside.sort(key=lambda one: one[0] != memory)
        for what, change in inside[:most_inside]:
            # a sound series of other columns or rows is what another experiment writes, and only its digest tells
            if not (name.startswith("trials/") and what.startswith(("without", "no row"))):
                yield name, what, change, True


def put(subject: Subject, name: str, what: str, change: Change, forged: bool, tally: Tally, known: list[str]) -> None:
    """Change a copy of a folder, put the commands to it, and count what comes of it."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "folder"
        shutil.copytree(subject.folder, folder)
        change(folder / name)
        if forged:
            reseal(folder)
        begin = time.monotonic()
        outputs, label = [], f"{name}: {what}{', forged' if forged else ''}"
        signal.alarm(int(LONGEST))
        try:
            for command in subject.commands:
                status, lines, out = run(command, folder)
                lines = [line for line in lines if not line.startswith("note: ")]  # said before the folder is read
                outputs.append(told_apart(out, folder))
                if status:
                    break
        finally:
            signal.alarm(0)
        tally.longest = max(tally.longest, time.monotonic() - begin)
        if status == 2 and len(lines) == 1 and len(lines[0]) < 1000:
            tally.counts["refused in one line"] += 1
        elif status == 0 and outputs == known:
            tally.counts["the same numbers"] += 1
        else:
            tally.counts["failed"] += 1
            tally.failures.append(f"{label}: status {status}, {len(lines)} lines: {' / '.join(lines)[:300]}")


def told_apart(out: str, folder: Path) -> str:
    return out.replace(str(folder), "FOLDER") if out.startswith("{") else ""


def late(*_: object) -> None:
    raise AssertionError("it waits")


def hunt(kind: str, flips: int, replaced: int, inside: int, seed: int) -> dict[str, Any]:
    """Change a folder of one kind in every way; what became of it, and the most memory that was used [MB]."""
    signal.signal(signal.SIGALRM, late)
    hurry()
    with (
        tempfile.TemporaryDirectory(prefix="icmj-tampering-") as place,
        tempfile.TemporaryDirectory(prefix="icmj-tampering-") as compiled,
    ):
        # what makes the folder and what reads it compile the same networks
        os.environ["JAX_COMPILATION_CACHE_DIR"] = compiled
        os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"
        # simulating and training take more memory than reading what they left
        subprocess.run([sys.executable, __file__, "--make", kind, place], check=True)
        subject = subject_of(kind, Path(place))
        known = []
        for command in subject.commands:
            known.append(told_apart(run(command, subject.folder)[2], subject.folder))
        rng, bits, others = random.Random(seed), Tally(), Tally()
        for _ in range(flips):
            name = rng.choice(subject.files)
            put(subject, name, "a bit", flip(rng.randrange(1 << 40)), False, bits, known)
        for name, what, change, forged in cases(subject, replaced, inside, seed):
            put(subject, name, what, change, forged, others, known)
    # not ru_maxrss, which begins with what the process had that started this one
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    peak = int(status.partition("VmHWM:")[2].split()[0]) / 1e3
    return {
        "bits": bits.counts, "others": others.counts, "failures": bits.failures + others.failures, "peak": peak,
        "longest": max(bits.longest, others.longest),
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kind", choices=("fit", "sweep", "experiment"), action="append", help="all by default")
    parser.add_argument("--flips", type=int, default=150, help="single bits in each folder")
    parser.add_argument("--replaced", type=int, default=len(REPLACED), help="files put in the place of each")
    parser.add_argument("--inside", type=int, default=10**6, help="changes with digests that fit, of a file at most")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--bomb", nargs=2, help=argparse.SUPPRESS)
    parser.add_argument("--make", nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.bomb:
        rows(BOMBS[given.bomb[0]])(Path(given.bomb[1]))
        return
    if given.make:
        hurry()
        subject_of(given.make[0], Path(given.make[1]))
        return
    for kind in given.kind or ("fit", "sweep", "experiment"):
        found = hunt(kind, given.flips, given.replaced, given.inside, given.seed)
        print(json.dumps({"kind": kind, **found}, indent=1), flush=True)


if __name__ == "__main__":
    main()
