"""A sweep's folder that somebody else made, or damaged: one line, nothing followed, nothing waited for."""

import json
import os
import re
import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from sweep_cases import GRID, sweep_file
from tampering import reseal
from terminal_cases import told

from icmj.cli.main import main
from icmj.errors import ReportError, SweepError
from icmj.report.builder import build_report
from icmj.study.plan import Plan
from icmj.study.sweep import carry_out, make_plan
from icmj.study.sweep_folder import read_sweep, resume_sweep, statuses

CRIT = "predicted_delta_crit"
VICTIM = "somebody's file\n"


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> tuple[Plan, Path]:
    """A sweep of ten points in chunks of three, of which the last is missing."""
    folder = tmp_path_factory.mktemp("sweep")
    plan = make_plan(sweep_file(folder, GRID.format(count=10), ask='motion = ["linear"]', chunk=3))
    carry_out(plan, folder / "out", jobs=1)
    (folder / "out" / "points" / "00000003.parquet").unlink()
    return plan, folder / "out"


@pytest.fixture(autouse=True)
def nothing_waits() -> Iterator[None]:
    def late(*_: object) -> None:
        raise AssertionError("it waits")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def one(folder: Path) -> Path:
    return folder / "points" / "00000001.parquet"


def facts(**changes: Any) -> Callable[[Path], object]:
    def change(folder: Path) -> None:
        found = json.loads((folder / "sweep.json").read_text())
        found |= changes
        (folder / "sweep.json").write_text(json.dumps({k: v for k, v in found.items() if v is not ...}))

    return change


def text(content: str | bytes) -> Callable[[Path], object]:
    raw = content if isinstance(content, bytes) else content.encode()
    return lambda folder: (folder / "sweep.json").write_bytes(raw)


def table(change: Callable[[pa.Table], pa.Table]) -> Callable[[Path], object]:
    return lambda folder: pq.write_table(change(pq.read_table(one(folder))), one(folder))


def column(name: str, values: list[Any], kind: pa.DataType | None = None) -> Callable[[Path], object]:
    def change(found: pa.Table) -> pa.Table:
        i = found.column_names.index(name)
        return found.set_column(i, pa.field(name, kind or found.schema.field(i).type), pa.array(values, kind))

    return table(change)


def replaced(name: str, make: Callable[[Path], object]) -> Callable[[Path], object]:
    def change(folder: Path) -> None:
        path = folder / name
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
        make(path)

    return change


def copied(chunk: str, to: str) -> Callable[[Path], object]:
    return lambda folder: shutil.copy(folder / f"points/{chunk}.parquet", folder / f"points/{to}.parquet")


def cut(path: Path, keep: float) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: int(keep * len(content))])


def spoilt(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[4:400] = bytes(396)
    path.write_bytes(bytes(content))


# what is wrong, and what is said of it
DAMAGES: dict[str, tuple[Callable[[Path], object], str]] = {
    "facts: nothing": (text(""), "no sound sweep.json"),
    "facts: no JSON": (text("{"), "no sound sweep.json"),
    "facts: a list": (text("[1]"), "no sound sweep.json"),
    "facts: bytes": (text(b"\xff\xfe\x00"), "no sound sweep.json"),
    "facts: deep": (text("[" * 100_000), "no sound sweep.json"),
    "facts: empty": (text("{}"), "no sound sweep.json"),
    "facts: a long number": (text('{"points": ' + "9" * 5000 + "}"), "no sound sweep.json"),
    "facts: no name": (facts(name=...), "name: "),
    "facts: a path for a name": (facts(name="../../x"), "name: "),
    "facts: a number for a name": (facts(name=3), "name: "),
    "facts: no versions": (facts(versions=[1]), "versions: "),
    "facts: no points": (facts(points="many"), "points: "),
    "facts: no point": (facts(points=0), "points: "),
    "facts: 10¹⁸ points": (facts(points=10**18), "points: "),
    "facts: fewer points": (facts(points=7), r"no sound|holds another sweep|cannot be read|00000002\.parquet"),
    "facts: no chunk": (facts(chunk=0), "chunk: "),
    "facts: another chunk": (facts(chunk=2), "holds another sweep|cannot be read"),
    "facts: varies": (facts(varies=[["b"]]), "varies.0: "),
    "facts: of two lengths": (facts(fields=[]), "varies and fields"),
    "facts: escape codes": (facts(title="\x1b[31mred\u202e"), "title: "),
    "facts: another fingerprint": (facts(fingerprint="0" * 16), "holds another sweep|of another sweep"),
    "facts: no fingerprint": (facts(fingerprint=None), "fingerprint: "),
    "facts: a pipe": (replaced("sweep.json", os.mkfifo), "is a pipe"),
    "facts: a folder": (replaced("sweep.json", Path.mkdir), "no sound sweep.json"),
    "chunk: empty": (lambda folder: one(folder).write_bytes(b""), r"00000001\.parquet: cannot be read"),
    "chunk: text": (lambda folder: one(folder).write_text("b,c\n1,2\n"), r"00000001\.parquet: cannot be read"),
    "chunk: cut": (lambda folder: cut(one(folder), 0.7), r"00000001\.parquet: cannot be read"),
    "chunk: spoilt": (lambda folder: spoilt(one(folder)), r"00000001\.parquet: cannot be read"),
    "chunk: of other points": (copied("00000000", "00000001"), "with other points"),
    "chunk: of another sweep": (table(lambda t: t.replace_schema_metadata({})), "of another sweep"),
    "chunk: fewer rows": (table(lambda t: t.slice(0, 2)), "2 rows, expected 3"),
    "chunk: fewer columns": (table(lambda t: t.drop_columns(["status"])), "columns"),
    "chunk: more columns": (table(lambda t: t.append_column("x", pa.array([1, 2, 3]))), "columns"),
    "chunk: a column twice": (table(lambda t: t.append_column("b", pa.array([1.0, 2, 3]))), "columns"),
    "chunk: text for numbers": (column(CRIT, list("abc"), pa.string()), f"with other columns|column {CRIT} of string"),
    "chunk: a status missing": (column("status", ["ok", None, "ok"]), "without status"),
    "chunk: a pipe": (replaced("points/00000001.parquet", os.mkfifo), "is a pipe"),
    "chunk: a folder": (replaced("points/00000001.parquet", Path.mkdir), "cannot be read"),
    "chunk: by its name": (copied("00000001", "99999999"), "by its name; remove it"),
    "chunk: by another name": (copied("00000001", "٣"), "by its name; remove it"),
}


@pytest.mark.parametrize("forged", [True, False])
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_folder_is_one_line(damage: str, forged: bool, begun: tuple[Plan, Path], tmp_path: Path) -> None:
    """Whoever changes a file may change its digest, too; if not, the digest alone refuses it."""
    plan, folder = begun[0], tmp_path / "out"
    shutil.copytree(begun[1], folder)
    change, words = DAMAGES[damage]
    change(folder)
    if forged:
        reseal(folder)
    elif not re.search("pipe|folder|by (its|another) name", damage):
        words = "not as it was written"
    with pytest.raises(SweepError, match=words), resume_sweep(folder, plan):  # to go on
        pass
    with pytest.raises(SweepError, match=words):  # to report
        read_sweep(folder)
    if not damage.startswith("facts: another"):
        with pytest.raises(SweepError):
            statuses(folder)


@pytest.mark.parametrize("values", [[0.1, float("nan"), 0.2], [0.1, float("inf"), 0.2], [0.1, None, 0.2]])
def test_what_varies_has_no_gaps(values: list[float], begun: tuple[Plan, Path], tmp_path: Path) -> None:
    folder = tmp_path / "out"
    shutil.copytree(begun[1], folder)
    column("b", values)(folder)
    reseal(folder)
    with pytest.raises(SweepError, match="column b has gaps"):
        read_sweep(folder)


def test_numbers_that_cannot_be_drawn_are_one_line(begun: tuple[Plan, Path], tmp_path: Path) -> None:
    folder = tmp_path / "out"
    shutil.copytree(begun[1], folder)
    column("b", [-1e308, 0.0, 1e308])(folder)
    reseal(folder)
    with pytest.raises(ReportError, match="sweep 'test' cannot be drawn"):
        build_report([], tmp_path / "a.html", sweeps=[read_sweep(folder)])
    assert not (tmp_path / "a.html").exists()


@pytest.mark.parametrize("name", [".lock", "timing.csv"])
@pytest.mark.parametrize("how", ["link", "dangling link", "hard link", "pipe", "folder"])
def test_nothing_outside_is_written_to(name: str, how: str, begun: tuple[Plan, Path], tmp_path: Path) -> None:
    plan, folder, victim = begun[0], tmp_path / "out", tmp_path / "victim"
    shutil.copytree(begun[1], folder)
    if how != "dangling link":
        victim.write_text(VICTIM)
    makers: dict[str, Callable[[Path], object]] = {
        "link": lambda path: path.symlink_to(victim),
        "dangling link": lambda path: path.symlink_to(victim),
        "hard link": lambda path: path.hardlink_to(victim),
        "pipe": os.mkfifo,
        "folder": Path.mkdir,
    }
    replaced(name, makers[how])(folder)
    if name == "timing.csv" and how == "hard link":  # of no weight: not written to, and not needed
        carry_out(plan, folder, jobs=1)
        assert read_sweep(folder).table.num_rows == 10
    else:
        with pytest.raises(SweepError, match=rf"{how.split()[-1]}"):
            carry_out(plan, folder, jobs=1)
    assert victim.read_text() == VICTIM if how != "dangling link" else not victim.exists()


def test_a_whole_folder_may_be_a_link_and_goes_on(begun: tuple[Plan, Path], tmp_path: Path) -> None:
    shutil.copytree(begun[1], tmp_path / "elsewhere")
    (tmp_path / "out").symlink_to("elsewhere")
    assert carry_out(begun[0], tmp_path / "out", jobs=1).done == 10
    assert read_sweep(tmp_path / "out").table.num_rows == 10


@pytest.mark.slow
def test_the_commands_say_it_in_one_line(begun, tmp_path, capfd):
    folder, sweep = tmp_path / "out", begun[1].parent / "sweep.toml"
    shutil.copytree(begun[1], folder)
    cut(one(folder), 0.5)
    for command in (["sweep", sweep, "--out", folder, "--jobs", "1"], ["report", folder, "--out", tmp_path / "a.html"]):
        assert main([str(word) for word in command]) == 2
        err = told(capfd.readouterr().err)
        assert "00000001.parquet: cannot be read" in err[-1]
        assert err[-1].endswith("remove it, and it is computed again")
    one(folder).unlink()
    assert main(["sweep", str(sweep), "--out", str(folder), "--jobs", "1"]) == 0
    assert main(["report", str(folder), "--out", str(tmp_path / "a.html")]) == 0
    assert pc.all(pc.equal(read_sweep(folder).table["status"], "ok")).as_py()
