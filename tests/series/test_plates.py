"""A centre of pressure of a table is there only where somebody stands on the plate."""

import numpy as np
import pytest

import icmj
from icmj.errors import DataError, FitError
from icmj.fits import read_trials
from icmj.series.plates import find_loads


def standing(names, units, load, seed=1):
    """Half a minute of sway of 4 mm, and vertical forces."""
    t, draw = np.arange(3500) / 100, np.random.default_rng(seed)
    sway = np.cumsum(draw.standard_normal((len(t), len(names))), axis=0)
    values = 4 * (sway - sway.mean(axis=0)) / sway.std(axis=0)
    for i, name in enumerate(names):
        if name in load:
            values[:, i] = load[name](t)
    return icmj.Series(t, values, tuple(names), tuple(units))


def step_on(t):
    """Somebody who steps on the plate at 2 s, and weighs 70 kg."""
    return np.where(t < 2 - 1e-9, 3.0, 686.0)


@pytest.mark.parametrize(("cop", "force"), [
    ("COPx", "Fz"), ("ap", "Fz"), ("cop.x", "force.z"), ("plate1.cop.x", "plate1.force.z"), ("COPx1", "Fz1"),
    ("cop_ap", "F_z"), ("Center of pressure x", "vertical force"), ("ground_force_px", "ground_force_vy"),
    ("Ax", "Fz"), ("Cx", "Fz"), ("P1 - CoP.Cx", "P1 - Force.Fz"),
])  # fmt: skip
def test_before_somebody_steps_on_there_is_none_whatever_it_is_called(cop, force, tmp_path, shell):
    """The rows before were measured: 862 mm for 3.8, or 54.6 mm where an exporter writes zeros."""
    series = standing([cop, force], ["mm", "N"], {force: step_on})
    series.values[:200, 0] = 1000.0
    icmj.write_series(series, tmp_path / "plate.csv")
    said = shell.refuses(["measure", str(tmp_path / "plate.csv"), "--columns", cop]).strip()
    assert f"{cop}: 200 of 3500 values are missing" in said
    assert f"{force} is below 20 N in 200 of 3500 rows, the last of them at 1.99 s" in said
    told = shell.answers(["measure", str(tmp_path / "plate.csv"), "--columns", cop, "--since", "2", "--json"])
    assert told["coordinates"][0]["rms"] == pytest.approx(series.values[200:, 0].std(), rel=1e-6)
    with pytest.raises(FitError, match="200 of 3500 values are missing"):
        read_trials(tmp_path / "plate.csv", [cop])
    assert len(read_trials(tmp_path / "plate.csv", [cop], since=2)) == 1


@pytest.mark.parametrize(("unit", "factor", "kept"), [("N", -1.0, False), ("kN", 1e-3, False), ("V", 1.0, True)])
def test_the_force_is_taken_in_its_unit_and_in_either_direction(unit, factor, kept, tmp_path):
    series = standing(["cop.x", "Fz"], ["mm", unit], {"Fz": lambda t: factor * step_on(t)})
    icmj.write_series(series, tmp_path / "plate.parquet")
    found = icmj.read_series(tmp_path / "plate.parquet", columns=["cop.x"])
    assert np.isfinite(found.values[:200]).all() == kept
    assert np.isfinite(found.values[200:]).all()
    assert found.names == ("cop.x",)


def test_a_plate_that_is_empty_throughout_is_told_and_measured(tmp_path, shell):
    """Of some data the vertical force is a share of the weight, or 1 in every row."""
    series = standing(["ap", "Fz"], ["mm", "N"], {"Fz": lambda t: 1.0 + 0 * t})
    icmj.write_series(series, tmp_path / "plate.csv")
    told = shell.answers(["measure", str(tmp_path / "plate.csv"), "--columns", "ap", "--json"])
    assert told["coordinates"][0]["rms"] == pytest.approx(4.0, rel=1e-6)
    (note,) = told["notices"]
    assert note.startswith("Fz is below 20 N in every row, as on an empty plate")
    (trial,) = read_trials(tmp_path / "plate.csv")
    assert any("as on an empty plate" in note for note in trial.notes)


def test_each_plate_has_its_own_force_and_one_centre_of_all_the_sum(tmp_path):
    names, units = ["plate1.cop.x", "plate2.cop.x", "cop.x", "plate1.force.z", "plate2.force.z"], ["mm"] * 3 + ["N"] * 2
    load = {
        "plate1.force.z": lambda t: np.where(t < 1, 0.0, 350.0),
        "plate2.force.z": lambda t: np.where(t < 2, 15, 350),
    }
    icmj.write_series(standing(names, units, load), tmp_path / "two.csv")
    found = icmj.read_series(tmp_path / "two.csv", columns=names[:3])
    assert [int(np.isnan(column).sum()) for column in found.values.T] == [100, 200, 100]
    assert find_loads(["Fz", "Fx", "coffee", "cop"], ["N", "N", "", "m"]) == {3: (0,)}
    with pytest.raises(DataError, match=r"plate1\.force\.z is below 20 N in 100 of 3500 rows"):
        icmj.measure_sway(found.chosen(["plate1.cop.x"]))
