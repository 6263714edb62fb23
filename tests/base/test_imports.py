"""The package leaves imports alone, and computes the same whatever else is loaded, and in whatever order."""

import json
import random
import subprocess
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import pytest
from patience import PATIENCE

PACKAGE = Path(__file__).resolve().parents[2] / "icmj"
RUN = """
import sys
finders = list(sys.meta_path)
{before}
from icmj.cli.main import main
words = ["run", "simple-0.8", "--plant", "linear", "--set", "simulation.duration=4", "--json", "--out", sys.argv[1]]
assert main(words) == 0
{after}
"""
DEBUGGER = """
import threading
def trace(frame, event, argument):
    return trace if "icmj" in frame.f_code.co_filename else None
sys.settrace(trace)
threading.settrace(trace)"""


def told(code: str, *more: str) -> str:
    """What a process of its own prints."""
    command = [sys.executable, "-c", code, *more]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    return done.stdout


@cache
def result(before: str = "", after: str = "") -> object:
    """The facts of a run in a process of its own; where its log is, and how long it took, is left out."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        (run,) = json.loads(told(RUN.format(before=before, after=after), folder))["runs"]
    return {name: value for name, value in run.items() if name not in ("log", "seconds")}


def test_what_is_imported_meanwhile_is_there_for_whoever_waits_for_it() -> None:
    load = "from icmj.base.process import import_in_background; "
    assert (
        told(f"{load}import_in_background('json.tool'); import json.tool; print(json.tool.__name__)") == "json.tool\n"
    )
    assert told(f"{load}import_in_background('no.such.module'); print('on')") == "on\n"


OTHERS = [name for name in ("pandas", "typeguard", "debugpy") if find_spec(name)]


@pytest.mark.skipif(find_spec("pandas") is None, reason="no pandas here")
def test_libraries_are_whole_after_a_run() -> None:
    """pyarrow no longer knew tables of pandas, and packages of rerun were loaded without what they import."""
    after = """
assert sys.meta_path == finders
import pyarrow, rerun, pandas
assert "AnyValues" in vars(rerun)
assert pyarrow.Table.from_pandas(pandas.DataFrame({"a": [1, 2]})).num_rows == 2"""
    assert result(after=after) == result()


def test_with_a_debugger_and_other_libraries_a_run_is_the_same() -> None:
    assert result("\n".join([*(f"import {name}" for name in OTHERS), DEBUGGER])) == result()


def test_in_whatever_order_modules_are_imported_a_run_is_the_same() -> None:
    paths = (path.relative_to(PACKAGE.parent).with_suffix("") for path in PACKAGE.rglob("*.py"))
    names = sorted({".".join(path.parts).removesuffix(".__init__") for path in paths} - {"icmj.cli.__main__"})
    random.Random(58).shuffle(names)
    assert result(f"from importlib import import_module\nfor name in {names!r}: import_module(name)") == result()
