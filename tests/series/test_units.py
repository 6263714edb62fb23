"""Units of recorded quantities: each spelling means one number in SI, and what is not known is asked for."""

import numpy as np
import pytest

from icmj.errors import DataError
from icmj.measurement.sway import from_torque
from icmj.series.series import Series
from icmj.series.units import QUANTITIES, find_factor
from icmj.series.writing import write_series

T = np.arange(2000) / 100
SWAY = 5e-3 * np.sin(0.8 * T)  # m


@pytest.mark.parametrize(("unit", "size"), [
    ("N m", 1.0), ("Nm", 1.0), ("N·m", 1.0), ("N*m", 1.0), ("N.m", 1.0), ("N cm", 100.0), ("Nmm", 1000.0),
    ("N·mm", 1000.0), ("kN m", 1e-3), ("mNm", 1000.0), ("N-m", 1.0),
])  # fmt: skip
def test_a_torque_in_any_unit_is_the_same_sway(tmp_path, shell, unit, size):
    """What a torque of 700 N times the sway is in this unit, is measured as that sway, from Python and from a file."""
    series = Series(T, -size * 700.0 * SWAY[:, None], ("torque",), (unit,))
    np.testing.assert_allclose(from_torque(series, "torque", 700.0)["cop"], SWAY, rtol=1e-12)
    path = tmp_path / "torque.csv"
    write_series(series, path)
    found = shell.answers(["measure", str(path), "--torque", "torque", "--weight", "700", "--json"])
    assert found["coordinates"][0]["rms"] == pytest.approx(SWAY.std(), rel=1e-9)


@pytest.mark.parametrize("unit", ["N", "Nm/kg", "mm", "V", "rad"])
def test_what_is_no_torque_is_not_taken_for_one(unit):
    with pytest.raises(DataError, match=f"torque: is in '{unit}'; expected one of N m, N cm, N mm"):
        from_torque(Series(T, SWAY[:, None], ("torque",), (unit,)), "torque", 700.0)


def test_a_torque_without_a_unit_is_asked_for_it_and_takes_the_one_that_is_given(tmp_path, shell):
    path = tmp_path / "torque.csv"
    write_series(Series(T, -700e3 * SWAY[:, None], ("torque",)), path)
    arguments = ["measure", str(path), "--torque", "torque", "--weight", "700", "--json"]
    assert "torque has no unit; say it with --unit" in shell.refuses(arguments)
    found = shell.answers([*arguments, "--unit", "N mm"])
    assert found["coordinates"][0]["rms"] == pytest.approx(SWAY.std(), rel=1e-9)
    assert found["coordinates"][0]["unit"] == "m"


@pytest.mark.parametrize(("unit", "quantity", "size"), [
    ("deg", "angle", np.pi / 180), ("°", "angle", np.pi / 180), ("cm", "length", 0.01), ("µm", "length", 1e-6),
    ("kN", "force", 1e3), ("N cm", "torque", 0.01),
])  # fmt: skip
def test_units_are_what_the_si_says(unit, quantity, size):
    assert find_factor(unit, quantity, "x") == pytest.approx(size, rel=1e-15)
    assert all(unit.replace(" ", "") not in known for name, known in QUANTITIES.items() if name != quantity)
