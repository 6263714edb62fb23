"""What is linked computes what Python computes, in this process and from disk in the next, with one machine code."""

import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core.compiler_lock import global_compiler_lock

from icmj.base.compilation import WITHIN, compiled, inlined

SCRIPT = """
import numba
from icmj.base.compilation import WITHIN, entry

@numba.njit(**WITHIN)
def power(x, n):
    if n < 0:
        raise ValueError("negative")
    return 1.0 if n == 0 else x * power(x, n - 1)

@numba.njit(inline="always", **WITHIN)
def twice(x, n):
    return 2.0 * power(x, n)

@numba.njit(**WITHIN)
def both(x, n):
    return twice(x, n) + power(x, n + 1)

@numba.njit(cache=True)
def door(x, n):
    return both(x, n)

print(door(1.1, 5))
try:
    door(1.1, -2)
except ValueError as error:
    print(error, sum(door.stats.cache_hits.values()))
"""


@numba.njit(**WITHIN)
def dot(a: np.ndarray, b: np.ndarray) -> float:
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@numba.njit(**WITHIN)
def times(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    y = np.empty(len(A))
    for i in range(len(A)):
        y[i] = dot(A[i], x)
    return y


@numba.njit
def cubed(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    return times(A, times(A, times(A, x)))


def test_the_order_of_sums_is_the_one_written() -> None:
    rng = np.random.default_rng(1)
    A, x = rng.normal(size=(5, 5)), rng.normal(size=5)
    found, by_hand = cubed(A, x), x
    for _ in range(3):
        by_hand = np.array([sum((a * b for a, b in zip(row, by_hand, strict=True)), 0.0) for row in A])
    assert found.tolist() == by_hand.tolist()


def test_what_is_linked_has_no_machine_code_of_its_own() -> None:
    def double(x: float) -> float:
        return 2.0 * x

    found = []
    for make in (numba.njit(**WITHIN), numba.njit):
        function = make(double)
        function.compile("float64(float64)")
        (compiled,) = function.overloads.values()
        with global_compiler_lock:
            found.append(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))
    assert found[0] == 0
    assert found[1] != 0


def test_only_what_says_so_is_put_into_its_callers() -> None:
    """numba hands an option that is not said on to whatever is called: copies of all that an inlined function calls."""

    @compiled
    def half(x):  # type: ignore[no-untyped-def]
        return 0.5 * x

    @inlined
    def quarter(x):  # type: ignore[no-untyped-def]
        return half(half(x))

    @numba.njit
    def door(x):  # type: ignore[no-untyped-def]
        return quarter(x)

    assert door(1.0) == 0.25
    forced = [next(iter(each.overloads.values())).fndesc.inline for each in (half, quarter)]
    assert forced == [False, True]


@pytest.mark.slow
def test_from_disk_it_is_the_same(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    expected = 2 * 1.1**5 + 1.1**6
    for hits in ("0", "1"):
        done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True, cwd=tmp_path)
        value, words = done.stdout.splitlines()
        assert float(value) == pytest.approx(expected, rel=1e-15)
        assert words == f"negative {hits}"


RENAMED = """
from typing import NamedTuple

from icmj.base.compilation import entry


class {name}(NamedTuple):
    x: float


@entry
def double(of):
    return 2.0 * of.x


print(double({name}(1.5)), sum(double.stats.cache_hits.values()))
"""


@pytest.mark.slow
def test_code_on_disk_that_names_a_class_that_is_gone_is_compiled_anew(tmp_path: Path) -> None:
    """As after an upgrade in which a class has another name."""
    told = []
    for name in ("Before", "After", None):
        if name:
            (tmp_path / "kept.py").write_text(RENAMED.format(name=name), encoding="utf-8")
        command = [sys.executable, "-c", "import kept"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        told.append(done.stdout.strip())
    assert told == ["3.0 0", "3.0 0", "3.0 1"]
