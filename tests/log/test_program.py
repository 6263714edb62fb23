"""rerun's program on files that are not whole: it may die, spin or eat memory; we do not, and soon."""

import sys
import time
from pathlib import Path

import pytest
from log_cases import made_up
from patience import PATIENCE

from icmj import read_log, write_log
from icmj.errors import LogError
from icmj.log import program

resource = pytest.importorskip("resource")
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="other systems take no such limits")
OUT_OF_MEMORY = "\n\x1b[31mmemory allocation of 9 bytes failed\nstack"
NOT_WHOLE = "reading it takes more time or memory than a whole one"


@pytest.fixture
def instead(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What is run in place of rerun's program; a Python script."""
    path = tmp_path / "instead"
    monkeypatch.setattr(program, "find_program", lambda: path)
    return path


def write(path: Path, script: str) -> None:
    path.write_text(f"#!{sys.executable}\n{script}\n", encoding="utf-8")
    path.chmod(0o755)


@pytest.mark.parametrize(("script", "reason"), [
    pytest.param("while True: pass", NOT_WHOLE, id="spins"),
    pytest.param("import os; os.abort()", NOT_WHOLE, id="dies"),
    # its first words are repeated
    pytest.param(f"held = bytearray({6 << 30})", "Traceback (most recent call last):", id="eats"),
    pytest.param(f"import sys; sys.exit({OUT_OF_MEMORY!r})", "memory allocation of 9 bytes", id="says"),
    pytest.param("import sys; print('0 files verified.', file=sys.stderr)", NOT_WHOLE[:36], id="reads none"),
])  # fmt: skip
def test_a_program_that_does_not_end_well_says_why(script, reason, instead, tmp_path, monkeypatch):
    monkeypatch.setattr(program, "SECONDS", 1)
    (tmp_path / "log.rrd").write_bytes(b"x")
    write(instead, script)
    begin = time.monotonic()
    assert program.verify(tmp_path / "log.rrd").startswith(reason)
    with pytest.raises(LogError, match="nothing can be saved"):
        program.salvage(tmp_path / "log.rrd", tmp_path / "copy.rrd")
    assert time.monotonic() - begin < PATIENCE  # a limit on a hang, not a measure of speed


def test_one_that_waits_is_ended(instead: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program, "LONGEST", 0.5)
    (tmp_path / "log.rrd").write_bytes(b"x")
    write(instead, "import time; time.sleep(60)")
    assert program.verify(tmp_path / "log.rrd") == "reading it took more than 0.5 s"
    with pytest.raises(LogError, match="nothing can be saved"):
        program.salvage(tmp_path / "log.rrd", tmp_path / "copy.rrd")


def test_limits_grow_with_the_file_and_are_not_ours(instead: Path, tmp_path: Path) -> None:
    before, log = resource.getrlimit(resource.RLIMIT_DATA), tmp_path / "log.rrd"
    write(instead, "import resource, sys; sys.exit(str(resource.getrlimit(resource.RLIMIT_DATA)[0]))")
    for size in (0, 1 << 30):
        with log.open("wb") as file:
            file.truncate(size)
        assert program.verify(log) == str((2 << 30) + 8 * size)
    assert resource.getrlimit(resource.RLIMIT_DATA) == before


def test_whole_logs_stay_far_from_the_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A thirtieth of the memory that is allowed does as well."""
    write_log(made_up(duration=60.0)[0], tmp_path / "log.rrd")
    monkeypatch.setattr(program, "MEMORY", program.MEMORY // 32)
    assert program.verify(tmp_path / "log.rrd") == ""
    assert "salvaged" in program.salvage(tmp_path / "log.rrd", tmp_path / "copy.rrd")
    assert len(read_log(tmp_path / "copy.rrd").simulation.t) > 1000


def test_too_little_memory_is_a_refusal_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_log(made_up(duration=3.0)[0], tmp_path / "log.rrd")
    monkeypatch.setattr(program, "MEMORY", 1 << 20)
    with pytest.raises(LogError, match=r"log\.rrd: not a complete rerun recording"):
        read_log(tmp_path / "log.rrd")
