"""Points are a pure function of their index: any block of them is a piece of the whole, and samples fill."""

from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
from sweep_cases import sweep_file

from icmj.runfile.sweep_tables import load_sweep
from icmj.study.plan import Points

DRAWN = """
[[vary]]
field = "actual.gain"
low = 0.5
high = 2.0
[[vary]]
field = "controller.q_t"
low = 1e-4
high = 1e-1
spacing = "log"
"""
LISTED = """
[[vary]]
field = "controller.hold"
values = ["system-matched", "zero-order"]
[[vary]]
field = "actual.rho"
values = [0, 0.5, 1]
"""


def points(tmp_path: Path, vary: str, **more: object) -> Points:
    lines = "\n".join(f"{key} = {value!r}".replace("'", '"') for key, value in more.items())
    return Points(load_sweep(sweep_file(tmp_path, vary, more=lines)))


def test_a_grid_is_the_product_of_its_lists_the_last_fastest(tmp_path: Path) -> None:
    found = points(tmp_path, LISTED)
    assert list(found.block(0, len(found))) == list(product(["system-matched", "zero-order"], [0, 0.5, 1]))


def test_counted_values_run_from_low_to_high_evenly_in_their_spacing(tmp_path: Path) -> None:
    vary = '[[vary]]\nfield = "controller.q_t"\nlow = 1e-4\nhigh = 0.1\ncount = 7\nspacing = "log"'
    (listed,) = points(tmp_path, vary).lists
    assert (listed[0], listed[-1]) == (1e-4, 0.1)
    assert np.diff(np.log10(listed)) == pytest.approx(0.5)


@pytest.mark.parametrize("method", ["sobol", "random"])
def test_any_block_is_a_piece_of_the_whole_bit_for_bit(tmp_path: Path, method: str) -> None:
    found = points(tmp_path, LISTED + DRAWN, samples=50, method=method, seed=3)
    assert len(found) == 300
    whole = list(found.block(0, 300))
    cuts = [0, 1, 7, 100, 101, 299, 300]
    assert [value for a, b in pairwise(cuts) for value in found.block(a, b)] == whole
    assert found.at(123) == whole[123]
    assert points(tmp_path, LISTED + DRAWN, samples=50, method=method, seed=4).at(123) != whole[123]


@pytest.mark.parametrize("method", ["sobol", "random"])
def test_samples_lie_between_their_bounds_evenly(tmp_path: Path, method: str) -> None:
    from scipy.stats import kstest
    from scipy.stats.qmc import discrepancy

    found = points(tmp_path, DRAWN, samples=1024, method=method)
    drawn = np.array(list(found.block(0, 1024)))
    share = np.column_stack([(drawn[:, 0] - 0.5) / 1.5, np.log10(drawn[:, 1] / 1e-4) / 3])
    assert share.min() >= 0
    assert share.max() <= 1
    assert min(kstest(column, "uniform").pvalue for column in share.T) > 1e-3
    assert abs(np.corrcoef(share.T)[0, 1]) < 0.1
    assert (discrepancy(share) < 1e-4) == (method == "sobol")  # independent samples have about 1e-3
