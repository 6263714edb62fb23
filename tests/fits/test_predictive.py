"""Posterior predictive intervals, and the file that ArviZ reads."""

import warnings

import numpy as np
import pytest

from icmj.errors import FitError
from icmj.fits.arviz_file import write_archive
from icmj.fits.prediction_check import check_prediction


def test_intervals_hold_nine_of_ten() -> None:
    generator = np.random.default_rng(0)
    theta = generator.normal(size=300)
    stood = np.column_stack([theta + generator.normal(size=300), np.ones(300)])
    observed = np.column_stack([np.sqrt(2) * generator.normal(size=500), np.ones(500)])
    found = check_prediction(stood, 400, observed)
    assert found.fell == 0.25
    assert found.inside[:, 0].mean() == pytest.approx(0.9, abs=3 * np.sqrt(0.09 / 300 + 0.09 / 500))
    assert found.inside[:, 1].all()
    with pytest.raises(FitError, match="15 of 20 draws of the posterior stood"):
        check_prediction(stood[:15], 20, observed)


@pytest.mark.slow
def test_arviz_reads_what_is_written(tmp_path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        arviz = pytest.importorskip("arviz")
    generator = np.random.default_rng(1)
    theta, prior = generator.normal(size=(300, 2)), generator.normal(size=(100, 2))
    path = tmp_path / "person.nc"
    measures, simulated, observed = ("rms", "speed"), generator.normal(size=(40, 2)), np.ones((3, 2))
    write_archive(path, ("gain", "delay"), ("", "s"), theta, prior, measures, simulated, observed, {"family": "event"})
    found = arviz.from_netcdf(path)
    assert np.array_equal(found.posterior["delay"].to_numpy(), theta[None, :, 1])
    assert found.posterior["delay"].attrs["units"] == "s"
    assert float(arviz.ess(found)["gain"]) > 200
    assert list(found.posterior_predictive["measure"].to_numpy()) == list(measures)
    assert found.observed_data["sway"].shape == (3, 2)
