"""Growth per interval under the clock: measured on both plants against the eigenvalues of φ(Δ)."""

from dataclasses import replace

import numpy as np
import pytest

from icmj import load_run, parse_run, prepare
from icmj.experiments.growth import measure_growth


@pytest.mark.parametrize("name", ["simple-0.8", "simple-1.7", "neglected-0.1", "three-link-1.1"])
@pytest.mark.parametrize(("plant", "tolerance"), [("linear", 1e-9), ("mujoco", 1e-5)])
def test_measured_growth_is_the_largest_eigenvalue(root, name, plant, tolerance):
    """b = 1.7 has a complex pair outside the circle over most of the range, so both ways of measuring are used."""
    case = prepare(load_run(root / "runs" / f"{name}.toml"))
    growth = measure_growth(case, plant, 4)
    eigenvalues = [np.abs(np.linalg.eigvals(case.system.phi(delta))).max() for delta in growth.delta]
    np.testing.assert_allclose(growth.measured, eigenvalues, rtol=tolerance)
    np.testing.assert_allclose(growth.predicted, eigenvalues, rtol=1e-12)
    assert growth.measured[-1] > 1  # the points reach beyond Δ_crit


def test_no_points_no_growth(root):
    assert measure_growth(prepare(load_run(root / "runs" / "simple-0.8.toml")), "linear", 0) is None


def test_intervals_shorter_than_a_timestep_have_no_measured_growth(root):
    text = (root / "runs" / "simple-exact.toml").read_text(encoding="utf-8")
    text = "\n".join("delta_max = 1e-4" if line.startswith("delta_max") else line for line in text.splitlines())
    growth = measure_growth(prepare(parse_run(text, root / "runs" / "simple-exact.toml")), "mujoco", 2)
    assert np.isnan(growth.measured).all()
    assert np.isfinite(growth.predicted).all()


def test_what_grows_beyond_all_numbers_is_not_a_number(root):
    case = prepare(load_run(root / "runs" / "simple-0.8.toml"))
    system = replace(case.system, A_C=1e6 * case.system.A_C)
    lost = replace(case, theory=replace(case.theory, system=system))
    growth = measure_growth(lost, "linear", 3)
    assert np.isnan(growth.measured).all()
    assert np.isnan(growth.predicted).all()
