"""Mutants of run files, models, time series and logs, what grammars make, and a bench that puts them to icmj.

A case is made from a seed alone, so that what failed can be made again, and is put to icmj in a process of its own.
"""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import random
import re
import resource
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from grammar_experiments import grammar_experiment
from grammar_folders import damaged_folder
from grammar_models import grammar_model
from grammar_recordings import damaged_recording
from grammar_runs import grammar_run, grammar_sweep

ROOT = Path(__file__).resolve().parent.parent
SILENCE = 10.0  # s of work without a word that count as a hang; on a busy machine they are longer on the clock
STANDSTILL = 600.0  # s on the clock without a word that count as a hang, worked or not
PATIENCE = 25.0  # s after which what still shows progress is ended, and counted as long
MEMORY = 2e9  # bytes that no case may take, its processes together
LEAN = {"recording": 1.5e9}  # of some kinds

NUMBERS = (
    *("0", "-0.0", "1", "-1", "2", "0.5", "1e-3", "1e3", "1e6", "-1e6", "1e12", "-1e12", "1e15", "1e300", "-1e308"),
    *("1e309", "5e-324", "1e-15", "1e-300", "inf", "-inf", "nan", "9" * 25, "9" * 400),
    *("0x10", "1_000", "1e", "2000000000"),
)
VALUES = (
    *NUMBERS,
    *("true", "false", "''", "'x'", "'output'", "'identity'", "'ζ'", "'a/b'", "'..'", "'\\u0000'", '"\\u001b[31m"'),
    *("[]", "[[]]", "[0, 0]", "[1, 2]", "[1, [2]]", "[[1, 2], [3]]", "[[1, 2], [3, 4]]", "[[0, 0], [0, 0]]"),
    *("[1, 1, 1, 1, 1, 1]", "[1e300, 1e300]", "[-1, 1]", "['a', 1]", "{}", "{ a = 1 }", "{ hinge = 1e308 }"),
    *("{ hinge = nan }", "1979-05-27", "07:32:00", f"'{'x' * 300}'", f"[{'1, ' * 300}]", "[" * 60 + "]" * 60),
)
KEYS = ("qt", "Q_T", "gains", "delta", "duration_s", "x", "'ζ'", "''", "a.b.c", "model", "name", "seed", "q_t", "yes")


@dataclass(frozen=True)
class Job:
    """One mutant: what is put to icmj, in an empty folder of its own.

    Attributes:
        kind: one of ``KINDS``.
        seed: makes it again.
    """

    kind: str
    seed: int


@dataclass
class Tally:
    """What came of many mutants."""

    done: int = 0
    accepted: int = 0
    refused: int = 0
    long: list[str] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        return (
            f"{self.done} mutants: {self.accepted} accepted, {self.refused} refused, {len(self.long)} ended after "
            f"{PATIENCE:g} s of progress, {len(self.failures)} failures"
        )


def mutant_run_file(rng: random.Random, folder: Path) -> list[str]:
    """A run file in ``folder``, and the command to put it to."""
    original = rng.choice(sorted((ROOT / "runs").glob("*.toml")))
    text = original.read_text(encoding="utf-8").replace("../models", str(ROOT / "models"))
    lines = [line.split("#")[0].rstrip() for line in text.splitlines()]
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        lines = _mutate_lines(rng, lines)
    content = "\n".join(lines).encode("utf-8", errors="surrogateescape")
    if rng.random() < 0.08:
        content = mutate_bytes(rng, content)
    (folder / "case.toml").write_bytes(content)
    commands = (["analyse", "--json"], ["run", "--plant", "linear"], ["run"], ["cycle", "--json"])
    command = rng.choices((*commands, ["continue"]), (6, 2, 1, 3, 1))[0]
    if command[0] == "continue":
        of = rng.choice(("b", "b", "q_t", "delay", "rho", "delta_min", "hinge", ""))
        command = ["continue", "--parameter", of, "--to", rng.choice((*NUMBERS, "0.7", "1.2")), "--points", "5"]
    return [command[0], "case.toml", *command[1:], *(["--out", "out"] if command[0] in ("run", "continue") else [])]


def _mutate_lines(rng: random.Random, lines: list[str]) -> list[str]:
    lines = list(lines)
    keyed = [i for i, line in enumerate(lines) if "=" in line]
    tables = [i for i, line in enumerate(lines) if line.startswith("[")]
    if not keyed or not tables:
        return lines
    i, what = rng.choice(keyed), rng.random()
    key = lines[i].split("=")[0].strip()
    if what < 0.55:
        lines[i] = f"{key} = {rng.choice(VALUES)}"
    elif what < 0.7:
        lines[i] = re.sub(r"\d[\d.e-]*", lambda _: rng.choice(NUMBERS), lines[i], count=1)
    elif what < 0.78:
        lines.insert(rng.choice(tables) + 1, f"{rng.choice(KEYS)} = {rng.choice(VALUES)}")
    elif what < 0.84:
        lines[i] = lines[i].replace(key, "".join(rng.sample(key, len(key))), 1)
    elif what < 0.9:
        del lines[i]
    elif what < 0.94:
        lines.insert(i, lines[i])
    elif what < 0.97:
        j = rng.choice(tables)
        lines[j] = rng.choice(("[x]", "[[simulation.disturbance]]", "[case.paper.x]", "[", lines[rng.choice(tables)]))
    else:
        extra = "\n".join(f"{k} = {rng.choice(VALUES)}" for k in ("kind", "input", "size", "bandwidth", "seed"))
        lines.append(f"[[simulation.disturbance]]\n{extra}")
    return lines


ELEMENTS = (
    '<body pos="0 0 3"><freejoint/><geom size=".1" mass="1"/></body>',
    '<replicate count="{n}"><body><geom size=".1" mass="1"/></body></replicate>',
    '<include file="{n}"/>',
    '<size nkey="{n}" nuser_body="{n}"/>',
    '<size memory="{n}"/>',
    '<option gravity="0 0 {n}" timestep="{n}"/>',
    '<option integrator="implicitfast" solver="CG" iterations="{n}"/>',
    '<custom><numeric name="icmj_controller" data="{n}"/></custom>',
    '<sensor><user name="u" dim="{n}"/></sensor>',
    '<sensor><subtreeangmom name="h" body="world"/></sensor>',
    '<sensor><accelerometer name="a" site="none"/></sensor>',
    '<equality><joint joint1="hinge" polycoef="{n} 1"/></equality>',
    '<asset><hfield name="f" nrow="{n}" ncol="{n}" size="1 1 1 1"/></asset>',
    '<asset><texture name="t" type="2d" builtin="flat" width="{n}" height="{n}"/></asset>',
    '<actuator><general name="g" joint="hinge" dyntype="user" actdim="{n}"/></actuator>',
    '<compiler balanceinertia="true" boundmass="{n}"/>',
    '<default><joint damping="{n}" stiffness="{n}" armature="{n}"/></default>',
)


def mutant_model(rng: random.Random, folder: Path) -> list[str]:
    """A model in ``folder``, and the command to put it to."""
    original = rng.choice(sorted((ROOT / "models").glob("*.xml")))
    text = re.sub(r"<!--.*?-->", "", original.read_text(encoding="utf-8"), flags=re.DOTALL)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        text = _mutate_xml(rng, text)
    content = text.encode("utf-8", errors="surrogateescape")
    if rng.random() < 0.08:
        content = mutate_bytes(rng, content)
    (folder / "model.xml").write_bytes(content)
    if rng.random() < 0.5:
        return ["linearise", "model.xml", "--json"]
    source = {"three_link": "three-link-0.9", "pendulum_neglected": "neglected-0.1"}.get(original.stem, "simple-0.8")
    run = (ROOT / "runs" / f"{source}.toml").read_text(encoding="utf-8")
    run = run.replace(f"../models/{original.name}", "model.xml").replace("../models", str(ROOT / "models"))
    run = re.sub(r"(?m)^law_q_t.*$", "", re.sub(r"duration = [\d.]+", "duration = 3.0", run))
    (folder / "case.toml").write_text(run, encoding="utf-8")
    return ["analyse", "case.toml", "--json"] if rng.random() < 0.7 else ["run", "case.toml", "--out", "out"]


def _mutate_xml(rng: random.Random, text: str) -> str:
    attributes = list(re.finditer(r'([\w]+)="([^"]*)"', text))
    numbers = list(re.finditer(r"(?<=[\" ])-?\d[\d.e-]*(?=[\" ])", text))
    elements = list(re.finditer(r"<\w[^<>]*/>", text))
    if not attributes or not numbers or not elements:
        return text
    what = rng.random()
    if what < 0.5:
        found = rng.choice(numbers)
        return text[: found.start()] + rng.choice(NUMBERS) + text[found.end() :]
    if what < 0.6:
        found = rng.choice(attributes)
        other = rng.choice(("", "x", "0 0 0", "true", "icmj_controller", "hinge", "1 2 3 4 5 6 7 8 9 10 11 12"))
        return text[: found.start(2)] + other + text[found.end(2) :]
    if what < 0.7:
        found = rng.choice(attributes)
        return text[: found.start()] + text[found.end() :]
    found = rng.choice(elements)
    if what < 0.78:
        return text[: found.start()] + text[found.end() :]
    if what < 0.83:
        return text[: found.start()] + found.group() + text[found.start() :]
    new = rng.choice(ELEMENTS).replace("{n}", rng.choice((*NUMBERS, "100000", "300", "20", "5K", "30K", "1T")))
    places = [m.end() for m in re.finditer(r'(<mujoco[^>]*>|<worldbody>|<body name="rod">)', text)]
    at = rng.choice(places) if places else 0
    return text[:at] + new + text[at:]


def mutate_bytes(rng: random.Random, content: bytes) -> bytes:
    content = bytearray(content)
    for _ in range(rng.randint(1, 5)):
        at = rng.randrange(len(content)) if content else 0
        what = rng.random()
        if what < 0.5 and content:
            content[at] = rng.randrange(256)
        elif what < 0.7:
            content[at:at] = bytes(rng.randrange(256) for _ in range(rng.randint(1, 8)))
        elif what < 0.85:
            del content[at : at + rng.randint(1, 200)]
        elif what < 0.9:
            del content[at:]
    return bytes(content)


def mutant_series(rng: random.Random, folder: Path) -> list[str]:
    """A file of time series in ``folder``, and the command to put it to."""
    import icmj

    noise = np.random.default_rng(rng.randrange(2**32))
    rows = rng.choice((0, 1, 2, 5, 30, *(300,) * 10))
    t, y = np.arange(rows) / 100.0, 1e-3 * noise.normal(size=(rows, rng.choice((1, 2, 2, 3)))).cumsum(axis=0)
    for _ in range(rng.choice((0, 0, 0, 1, 2))):
        values = rng.choice((t, y))
        at = rng.choice((slice(None), rng.randrange(rows) if rows else 0, slice(rows // 2, None)))
        with np.errstate(all="ignore"):
            if rng.random() < 0.5 and rows:
                values[at] = float(rng.choice(("nan", "inf", "-inf", "0", "-1", "1e300", "5e-324", "1e12", "1e-12")))
            elif rows:
                values[at] *= float(rng.choice(("-1", "1e300", "1e-300", "1e9", "1e-9", "0")))
    kind, path = rng.choice(("csv", "parquet", "npz")), folder / "sway"
    path = path.with_suffix(f".{kind}")
    known = ("ap", "ml", "t", "", "x [m]", "weight", "\u03b6", "a,b")
    names = tuple(rng.sample(known, y.shape[1]) if rng.random() < 0.9 else rng.choices(known, k=y.shape[1]))
    long = rng.random() < 0.3
    try:
        icmj.write_series(icmj.Series(t, y, names, ("m",) * len(names)), path)
        if long:
            _write_long_table(rng, t, y, names, path)
    except icmj.IcmjError:  # it is no series; a table all the same
        kind, path = "csv", folder / "sway.csv"
        cells = (",".join(map(repr, row)) for row in np.column_stack([t, y]).tolist())
        path.write_text("\n".join((",".join(("t", *names)), *cells)), encoding="utf-8")
    content = path.read_bytes()
    if kind == "csv" and rng.random() < 0.4:
        content = _mutate_cells(rng, content)
    if rng.random() < 0.15:
        content = mutate_bytes(rng, content)
    path.write_bytes(content)
    command = ["measure", path.name, *(["--json"] if rng.random() < 0.5 else [])]
    for option, count in (("--rate", 1), ("--since", 1), ("--low-pass", 1), ("--band", 2), ("--columns", 2)):
        if rng.random() < 0.15:
            numbers = ("0", "0.1", "1", "5", "100", "1e-9", "1e12", "nan", "inf")
            values = (*names, "y") if option == "--columns" else numbers
            command += [option, *(rng.choice(values) for _ in range(count))]
    return command


def _write_long_table(rng: random.Random, t: np.ndarray, y: np.ndarray, names: Sequence[str], path: Path) -> None:
    """Trials one below the other, with one or several columns of labels, some damaged or of other names."""
    import pandas as pd

    table = pd.DataFrame(dict(zip([f"{name} [m]" for name in names], y.T, strict=True)))
    if rng.random() < 0.8:
        table.insert(0, "t [s]", t)
    table = pd.concat([table] * (trials := rng.choice((1, 2, 2, 3, 40))), ignore_index=True)
    number = np.repeat(np.arange(trials), len(t))
    words = {"trial": number + 1, "subject": number // 2, "condition": np.array(["open", "closed"])[number % 2]}
    others = {"session": number, "eyes": np.array(["open", "closed", ""])[number % 3], "Trial No": number / 1.0}
    labels = words if rng.random() < 0.7 else {**words, **others}
    for name in rng.sample(sorted(labels), rng.choice((1, 1, 2, 3))):
        table.insert(rng.randrange(table.shape[1] + 1), name, labels[name])
        if rng.random() < 0.1 and len(table):
            odd = rng.choice((0, 9, 10**9))
            table.loc[rng.randrange(len(table)), name] = odd if table[name].dtype.kind in "if" else str(odd)
    if rng.random() < 0.2:
        table = table.sample(frac=1.0, random_state=rng.randrange(2**32))
    if path.suffix == ".csv":
        table.to_csv(path, index=rng.random() < 0.3)
    elif path.suffix == ".parquet":
        table.astype(rng.choice(({}, dict.fromkeys(set(labels) & set(table), "string")))).to_parquet(path)
    else:
        text = [name for name in table if table[name].dtype.kind not in "fiu"]
        np.savez(path, **{name: table[name].to_numpy(str if name in text else None) for name in table})


def _mutate_cells(rng: random.Random, content: bytes) -> bytes:
    """Another word in a table, another separator, or a line more or less."""
    lines = content.decode("utf-8", errors="surrogateescape").splitlines() or [""]
    at, what = rng.randrange(len(lines)), rng.randrange(5)
    if what == 0:
        cells = lines[at].split(",")
        cells[rng.randrange(len(cells))] = rng.choice((*NUMBERS, "", "x", '"', "1,5", "\t", "1e5 m"))
        lines[at] = ",".join(cells)
    elif what == 1:
        lines = [line.replace(",", rng.choice((";", "\t", " ", ",,"))) for line in lines]
    elif what == 2:
        lines.insert(at, rng.choice(("", "# said", ",".join("1" * rng.randrange(9)), lines[-1])))
    elif what == 3:
        del lines[at]
    else:
        lines = lines[1:]
    return "\n".join(lines).encode("utf-8", errors="surrogateescape")


def mutant_log(rng: random.Random, tree: dict[str, Any], arrays: dict[str, np.ndarray]) -> tuple[str, dict[str, Any]]:
    """An archive whose digest will be right, with something else in it."""
    tree, arrays = json.loads(json.dumps(tree)), dict(arrays)
    for _ in range(rng.choice((1, 1, 2))):
        if rng.random() < 0.5:
            _mutate_arrays(rng, arrays)
        else:
            _mutate_tree(rng, tree)
    return json.dumps(tree), arrays


def _mutate_arrays(rng: random.Random, arrays: dict[str, Any]) -> None:
    key = rng.choice(sorted(arrays))
    values, what = arrays[key].copy(), rng.randrange(8)
    if what == 0:
        del arrays[key]
        return
    if what == 1:
        values = values[: len(values) // 2]
    elif what == 2:
        values = np.concatenate([values, values])
    elif what == 3:
        values = values[::-1].copy()
    elif len(values) and values.dtype.kind == "f":
        at = rng.randrange(len(values))
        values[at if what < 7 else slice(None)] = rng.choice((np.nan, np.inf, -np.inf, 0.0, -1.0, 1e300, 5e-324, 1e12))
    arrays[key] = values


ODD = (
    *(None, 0, -1, 1, 2, 10**9, 10**30, 1.5, float("nan"), float("inf"), "", "x", True, [], {}, [1, 2], "event"),
    *({"@": "Result"}, {"@": "Popen"}, {"@tuple": [1]}, {"@array": "simulation.t", "dtype": "<f8", "shape": [3]}),
    *({"@complex": [1]}, {"@run": "x", "path": "y"}, {"@complex": [1, 2]}),
)


def _mutate_tree(rng: random.Random, tree: Any) -> None:
    """Another value, at a random place of a JSON tree."""
    places: list[tuple[Any, Any]] = []

    def walk(value: Any) -> None:
        for key in value if isinstance(value, dict) else range(len(value)):
            places.append((value, key))
            if isinstance(value[key], dict | list):
                walk(value[key])

    walk(tree)
    holder, key = rng.choice(places)
    other = rng.choice(places)
    holder[key] = rng.choice((*ODD, json.loads(json.dumps(other[0][other[1]]))))
    if rng.random() < 0.2 and isinstance(holder, dict):
        del holder[key]


def put(job: Job) -> tuple[str, str]:
    """Put one mutant to icmj in this process: ``accepted``, ``refused`` or ``failure``, and the words that came."""
    rng = random.Random(f"{job.kind} {job.seed}")
    return _put_log(rng) if job.kind == "log" else _put_files(job, rng)


def _put_files(job: Job, rng: random.Random) -> tuple[str, str]:
    from icmj.cli import progress
    from icmj.cli.main import main

    progress.SHARE = 0.0  # a line every five seconds: silence is a hang
    folder = Path(tempfile.mkdtemp(prefix="icmj-mutant-"))
    try:
        os.chdir(folder)
        command = _FILES[job.kind](rng, folder)
        before = _contents(folder)
        mark = os.lseek(2, 0, os.SEEK_CUR)
        Path("/proc/self/clear_refs").write_text("5")  # the peak is counted anew
        status = main(command)
        sys.stdout.flush()
        sys.stderr.flush()
        said = os.pread(2, 100_000, mark).decode(errors="replace")
        lines = [line for line in said.splitlines() if not _PROGRESS.search(line)]
        words = f"{' '.join(command)}: status {status}: {said[-600:]}"
        if (peak := _peak()) > LEAN.get(job.kind, MEMORY):
            return "failure", f"{words} (took {peak / 1e9:.1f} GB)"
        if status not in (0, 2) or "Traceback" in said or _contents(folder) != before:
            return "failure", words
        if status == 2:
            # a sweep that had begun keeps what was finished, and so does an experiment
            clean = command[0] == "sweep" or not (folder / "out").exists() or any((folder / "out/trials").glob("*"))
            whole = len(lines) == 1 and lines[0].startswith("icmj: ") and clean
            return ("refused" if whole and not re.search(r"[\x00-\x08\x0b-\x1f]", lines[0]) else "failure"), words
        return ("accepted" if not lines else "failure"), words
    finally:
        os.chdir(ROOT)
        shutil.rmtree(folder, ignore_errors=True)


_PROGRESS = re.compile(
    r"(?<! s),? after \d+ s(, about .* left)?$|^icmj: about .* of work$"
    r"|^icmj: \d+ of \d+ chunks are finished in .*; the same command goes on$"
)


def _peak() -> float:
    """Bytes that this process held at most since the mark, or one that it started, ever."""
    found = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    assert found is not None
    return 1024.0 * max(int(found[1]), resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)


def _contents(folder: Path) -> dict[str, bytes]:
    """What a command must leave as it is: all files of a case, by name, but for what it writes."""
    return {
        path.name: path.read_bytes() if path.is_file() else b""
        for path in sorted(folder.iterdir())
        if not path.name.startswith("out")
    }


def _archive() -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    from log_cases import made_up

    from icmj.log.archive import pack

    if not _packed:
        tree, arrays = pack(made_up(duration=20.0)[0])
        _packed.append((json.loads(tree), arrays))
    return _packed[0]


_packed: list[tuple[dict[str, Any], dict[str, np.ndarray]]] = []


def _put_log(rng: random.Random) -> tuple[str, str]:
    from log_cases import made_up

    from icmj.errors import IcmjError, LogError
    from icmj.log.archive import unpack
    from icmj.log.reader import read_log
    from icmj.log.writer import write_log

    if rng.random() < 0.1:  # the bytes of a whole log; each read starts a process
        folder = Path(tempfile.mkdtemp(prefix="icmj-mutant-"))
        try:
            if not _log:
                write_log(made_up(duration=3.0)[0], folder / "whole.rrd")
                _log.append((folder / "whole.rrd").read_bytes())
            (folder / "a.rrd").write_bytes(mutate_bytes(rng, _log[0]))
            read_log(folder / "a.rrd")
        except LogError as error:
            good = not re.search(r"[\x00-\x1f]", str(error))
            return ("refused" if good else "failure"), str(error)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        return "accepted", ""
    tree, arrays = mutant_log(rng, *_archive())
    try:
        result = unpack(tree, arrays)
    except LogError as error:
        return ("refused" if "\n" not in str(error) else "failure"), str(error)
    except IcmjError as error:
        return "refused", str(error)
    _use(result, rng)
    return "accepted", ""


_log: list[bytes] = []


def _use(result: Any, rng: random.Random) -> None:
    """What readers do with a log that was believed."""
    from icmj.case.comparison import compare, to_json
    from icmj.errors import IcmjError
    from icmj.log import groups, summary
    from icmj.report.builder import build_report

    with np.errstate(all="ignore"):
        compared = compare(result)
        json.dumps(to_json(compared), allow_nan=False)
        summary.write_markdown(result, compared)
        summary.summarise(result, compared)
        list(groups.list_groups(result))
        if rng.random() < 0.02:
            with tempfile.TemporaryDirectory() as folder, contextlib.suppress(IcmjError):
                build_report([result], Path(folder) / "report.html")


class Bench:
    """A process that mutants are put to, one after the other; started anew when it dies or hangs."""

    def __init__(self, use: Callable[[Job], tuple[str, str]] = put) -> None:
        self._use, self._process, self._said = use, None, Path(tempfile.mkstemp(prefix="icmj-bench-")[1])
        self._ours: Any = None

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()
        self._said.unlink(missing_ok=True)

    def put(self, job: Job, tally: Tally) -> None:
        """Put one mutant to icmj and count what came of it."""
        if self._process is None:
            context = multiprocessing.get_context("spawn")
            self._ours, theirs = context.Pipe()
            self._process = context.Process(target=_serve, args=(theirs, str(self._said), self._use), daemon=True)
            self._process.start()
            theirs.close()
            self._ours.recv()  # it is ready
        tally.done += 1
        heard, last, worked = self._said.stat().st_size, time.monotonic(), self._worked()
        begin, first = last, worked
        self._ours.send(job)
        while not self._ours.poll(0.5):
            now = time.monotonic()
            if self._said.stat().st_size > heard:
                heard, last, worked = self._said.stat().st_size, now, self._worked()
            if not self._process.is_alive():
                tally.failures.append(f"{job}: the process ended with {self._process.exitcode}: {self._tail()}")
                return self._end()
            if (taken := self._memory()) > LEAN.get(job.kind, MEMORY):
                tally.failures.append(f"{job}: takes {taken / 1e9:.1f} GB: {self._tail()}")
                return self._end()
            silent = min(now - last, self._worked() - worked)
            if silent > SILENCE + 1 or now - last > STANDSTILL:
                tally.failures.append(f"{job}: silent for {now - last:.0f} s: {self._tail()}")
                return self._end()
            if now - begin > PATIENCE:
                idle = self._worked() - first < PATIENCE / 100  # it waits for something, and says that it works
                (tally.failures if idle else tally.long).append(f"{job}: {'waits: ' * idle}{self._tail()}")
                return self._end()
        try:
            kind, words = self._ours.recv()
        except EOFError:
            tally.failures.append(f"{job}: the process died: {self._tail()}")
            return self._end()
        if kind == "failure":
            tally.failures.append(f"{job}: {words}")
        elif kind == "accepted":
            tally.accepted += 1
        else:
            tally.refused += 1
        return None

    def _worked(self) -> float:
        """Seconds that the process has computed, with those that it started."""
        return self._sum(lambda process: sum(process.cpu_times()[:2]))

    def _memory(self) -> float:
        """Bytes that the process holds, with those that it started."""
        return self._sum(lambda process: process.memory_info().rss)

    def _sum(self, of: Callable[[psutil.Process], float]) -> float:
        try:
            process = psutil.Process(self._process.pid)
            return sum(map(of, (process, *process.children(recursive=True))))
        except psutil.NoSuchProcess:
            return 0.0

    def _tail(self) -> str:
        return self._said.read_text(errors="replace")[-300:]

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.join(PATIENCE)
            self._ours.close()
        self._process = None


def _serve(theirs: Any, said: str, use: Callable[[Job], tuple[str, str]]) -> None:
    import traceback

    sys.path.insert(0, str(ROOT / "tests"))
    file = os.open(said, os.O_RDWR | os.O_TRUNC | os.O_APPEND)
    os.dup2(file, 2)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    _warm_up()
    theirs.send("ready")
    while True:
        try:
            job = theirs.recv()
        except EOFError:
            return
        try:
            answer = use(job)
        except BaseException:
            answer = "failure", traceback.format_exc()[-1500:]
        os.lseek(2, 0, os.SEEK_END)
        theirs.send(answer)


def _warm_up() -> None:
    """Compile what is compiled once for all, which is no mutant's fault."""
    from icmj.cli.main import main

    with tempfile.TemporaryDirectory() as folder:
        for name in ("rivals/one-link-switching", "simple-0.8"):
            text = (ROOT / "runs" / f"{name}.toml").read_text(encoding="utf-8").replace("../../", "../")
            text = re.sub(r"duration = [\d.]+", "duration = 0.5", text.replace("../models", str(ROOT / "models")))
            (Path(folder) / "case.toml").write_text(text, encoding="utf-8")
            for plant in ("mujoco", "linear"):
                main(["run", f"{folder}/case.toml", "--plant", plant, "--out", f"{folder}/out"])
        for plant in ("mujoco", "linear"):
            main(["cycle", f"{folder}/case.toml", "--plant", plant, "--json"])


def _folder(rng: random.Random, folder: Path) -> list[str]:
    return damaged_folder(rng, folder, mutate_bytes)


def _recording(rng: random.Random, folder: Path) -> list[str]:
    return damaged_recording(rng, folder, mutate_bytes)


_FILES: dict[str, Callable[[random.Random, Path], list[str]]] = {
    "run file": mutant_run_file,
    "model": mutant_model,
    "series": mutant_series,
    "grammar-run": grammar_run,
    "grammar-sweep": grammar_sweep,
    "grammar-experiment": grammar_experiment,
    "grammar-model": grammar_model,
    "folder": _folder,
    "recording": _recording,
}
KINDS = (*_FILES, "log")


def hunt(kind: str, seeds: Sequence[int], seconds: float) -> Tally:
    """Put mutants of one kind to icmj until the seeds or the time are used up."""
    tally, begin = Tally(), time.monotonic()
    with Bench() as bench:
        for seed in seeds:
            if time.monotonic() - begin > seconds:
                break
            bench.put(Job(kind, seed), tally)
    return tally
