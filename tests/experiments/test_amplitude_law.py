"""The amplitude law: errors quadratic in the threshold, as odd symmetry demands."""

import numpy as np
import pytest

from icmj import load_run, prepare
from icmj.experiments.amplitude_law import measure_law


@pytest.mark.parametrize("name", ["three-link-0.9", "three-link-1.1", "simple-0.8"])
def test_interval_and_amplitude_errors_fall_with_the_square_of_the_threshold(root, name):
    case = prepare(load_run(root / "runs" / f"{name}.toml"))
    law = measure_law(case, [1e-2, 3.162e-3, 1e-3])
    assert law.interval_slope == pytest.approx(2, abs=0.05)
    assert law.amplitude_slope == pytest.approx(2, abs=0.05)
    assert np.all(law.interval_error < 3e-4)


def test_no_law_without_an_attracting_cycle(root):
    for name in ("simple-1.7", "simple-exact"):
        assert measure_law(prepare(load_run(root / "runs" / f"{name}.toml")), [1e-2, 1e-3]) is None
    assert measure_law(prepare(load_run(root / "runs" / "simple-0.8.toml")), [1e-2]) is None
