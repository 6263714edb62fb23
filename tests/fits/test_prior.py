"""Priors against scipy.stats, and their way to z and back."""

import numpy as np
import pytest
from scipy import stats

from icmj.errors import FitError
from icmj.fits.family import Prior
from icmj.fits.family_file import ParameterTable, PriorTable

CUT = stats.truncnorm(-0.5, 2.0, loc=0.3, scale=0.1)
LOG_CUT = stats.truncnorm(-1.0, 2.0, loc=np.log(2e-3), scale=0.7)
CASES = {
    "uniform": ({"kind": "uniform", "low": -2.0, "high": 3.0}, stats.uniform(-2, 5).ppf),
    "log-uniform": ({"kind": "log-uniform", "low": 1e-4, "high": 1e-1}, stats.loguniform(1e-4, 1e-1).ppf),
    "normal": ({"kind": "normal", "median": 0.3, "deviation": 0.1}, stats.norm(0.3, 0.1).ppf),
    "cut": ({"kind": "normal", "median": 0.3, "deviation": 0.1, "low": 0.25, "high": 0.5}, CUT.ppf),
    "log-normal": ({"kind": "log-normal", "median": 2e-3, "deviation": 0.7}, stats.lognorm(0.7, scale=2e-3).ppf),
    "log-cut": (
        {
            "kind": "log-normal",
            "median": 2e-3,
            "deviation": 0.7,
            "low": 2e-3 * np.exp(-0.7),
            "high": 2e-3 * np.exp(1.4),
        },
        lambda p: np.exp(LOG_CUT.ppf(p)),
    ),
}


def prior_of(**tables: dict) -> Prior:
    """The prior of parameters of these names."""
    each = ({"name": name, "keys": {"actual.gain": 1.0}, "source": "ours", "prior": of} for name, of in tables.items())
    return Prior(tuple(ParameterTable(**table) for table in each))


@pytest.mark.parametrize(("table", "quantile"), CASES.values(), ids=CASES)
def test_a_number_is_the_quantile_of_its_z(table, quantile):
    of = PriorTable(**table)
    p = np.array([1e-4, 0.01, 0.2, 0.5, 0.9, 0.999])
    z = stats.norm.ppf(p)
    np.testing.assert_allclose(of.from_normal(z), quantile(p), rtol=1e-9)
    np.testing.assert_allclose(of.to_normal(quantile(p)), z, atol=1e-6)


def test_draws_are_of_the_prior_and_of_their_number_alone():
    prior = prior_of(a=CASES["log-uniform"][0], b=CASES["cut"][0])
    theta = prior.draw(2000, seed=3)
    assert stats.kstest(theta[:, 0], stats.loguniform(1e-4, 1e-1).cdf).pvalue > 1e-3
    assert stats.kstest(theta[:, 1], CUT.cdf).pvalue > 1e-3
    np.testing.assert_array_equal(prior.draw(3, seed=3, first=10), theta[10:13])
    np.testing.assert_allclose(prior.from_normal(prior.to_normal(theta)), theta, rtol=1e-9)


def test_beyond_its_bounds_there_is_no_number_whatever_z_says():
    for table, _ in CASES.values():
        of = PriorTable(**table)
        far = of.from_normal(np.array([-1e9, 1e9]))
        assert np.isfinite(far).all()
        assert table.get("low", -np.inf) <= far[0] + 1e-12
        assert far[1] <= table.get("high", np.inf) + 1e-12
    prior = prior_of(a=CASES["uniform"][0])
    with pytest.raises(FitError, match=r"a = 3\.1 lies outside its prior"):
        prior.to_normal([[3.1]])
    with pytest.raises(FitError, match=r"shape \(2,\); expected \(n, 1\): a"):
        prior.from_normal([0.0, 1.0])
