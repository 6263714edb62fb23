"""A program that is held to limits: they are those asked for, where the system has them, and none are ours."""

import subprocess
import sys
from pathlib import Path

import pytest

from icmj.base.bounded_program import run_bounded

resource = pytest.importorskip("resource")
KINDS = ("AS", "CPU", "DATA", "STACK", "CORE")
TELL = f"""
import resource, sys
sys.exit(" ".join(str(resource.getrlimit(getattr(resource, "RLIMIT_" + kind))[0]) for kind in {KINDS}))
"""


def limits(**given: int) -> list[int]:
    done = run_bounded([sys.executable, "-c", TELL], 60.0, **given)
    return [int(word) for word in done.stderr.split()]


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not have all of them")
def test_the_program_has_the_limits_and_this_process_has_not() -> None:
    before = [resource.getrlimit(getattr(resource, f"RLIMIT_{kind}")) for kind in KINDS]
    assert limits(addresses=3 << 30, processor=7, data=2 << 30, stack=4 << 20) == [3 << 30, 7, 2 << 30, 4 << 20, 0]
    assert limits() == [*(soft for soft, _ in before[:4]), 0]
    assert [resource.getrlimit(getattr(resource, f"RLIMIT_{kind}")) for kind in KINDS] == before


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not have all of them")
def test_a_limit_that_the_system_refuses_is_left_out() -> None:
    """As every limit on memory is on macOS; here one above what this process may set itself."""
    program = f"""
import resource, sys
from icmj.base.bounded_program import run_bounded
resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))
done = run_bounded([sys.executable, "-c", {TELL!r}], 60.0, addresses=3 << 30, processor=7)
sys.exit(done.stderr)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert [int(word) for word in done.stderr.split()][:2] == [2 << 30, 7]


def test_it_is_ended_where_it_takes_too_long_or_too_much_and_says_how() -> None:
    with pytest.raises(subprocess.TimeoutExpired):
        run_bounded([sys.executable, "-c", "import time; time.sleep(60)"], 0.2)
    assert run_bounded([sys.executable, "-c", "import os; os.abort()"], 60.0).returncode == -6
    done = run_bounded([sys.executable, "-c", "print('x'); import sys; sys.exit('\\udcff words')"], 60.0)
    assert (done.returncode, done.stdout) == (1, None)
    assert "words" in done.stderr


def test_whatever_may_crash_runs_in_this_one_sandbox(root: Path) -> None:
    """Models, C3D files, logs and tables; what else starts a program is the viewer, and worker processes."""
    starts = {
        path.relative_to(root / "icmj").as_posix()
        for path in (root / "icmj").rglob("*.py")
        if "subprocess.run(" in (text := path.read_text(encoding="utf-8")) or "Popen(" in text
    }
    assert starts == {"base/bounded_program.py", "work/workers.py", "log/replay.py"}
    used = {"engine/rehearsal.py", "series/formats/c3d.py", "log/program.py", "base/parquet.py"}
    assert all("run_bounded(" in (root / "icmj" / name).read_text(encoding="utf-8") for name in used)
