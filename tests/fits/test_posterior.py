"""The posterior against a model whose posterior is known: three numbers, five summaries, linear and Gaussian.

The third number does not enter the summaries.
"""

import random
import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest
from patience import PATIENCE
from scipy.optimize import brentq
from scipy.stats import norm

from icmj.errors import FitError
from icmj.fits.calibration import calibrate
from icmj.fits.misfit import SeenSummaries
from icmj.fits.posterior import Posterior, effective, train_posterior
from icmj.work.folder import Folder

NAMES, SUMMARIES = ("gain", "noise", "idle"), tuple("abcde")
G = np.array([[1.2, 0.3, 0], [-0.4, 0.9, 0], [0.5, 0.5, 0], [0.1, -0.8, 0], [0.0, 0.2, 0]])


def people(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of n people, and summaries of three trials each, on other scales than the numbers'."""
    generator = np.random.default_rng(seed)
    z = generator.normal(size=(n, 3))
    S = (z @ G.T)[:, None] + generator.normal(size=(n, 3, 5))
    return z, 7 + 0.2 * S


def exact(S: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance by the textbook, of summaries (k, 5)."""
    covariance = np.linalg.inv(np.eye(3) + len(S) * G.T @ G)
    return covariance @ G.T @ ((S - 7) / 0.2).sum(axis=0), covariance


@pytest.fixture(scope="module")
def posterior() -> Posterior:
    return train_posterior(*people(3000, 1), NAMES, SUMMARIES, seed=2, epochs=35, depth=2)


@pytest.mark.slow
@pytest.mark.parametrize("k", [1, 3])
def test_mean_and_covariance_are_the_textbooks(posterior: Posterior, k: int) -> None:
    _, S = people(20, 5)
    drawn = posterior.sample_all(S[:, :k], draws=1000, seed=3)
    for one, given in zip(drawn, S[:, :k], strict=True):
        mean, covariance = exact(given)
        inverse = np.linalg.inv(np.linalg.cholesky(covariance))
        away = inverse @ (one.mean(axis=0) - mean)
        assert np.abs(away).max() < 0.5  # of a deviation of the posterior, of the network
        ratio = np.linalg.eigvalsh(inverse @ np.cov(one.T) @ inverse.T)
        assert 0.6 < ratio.min() < ratio.max() < 1.7


@pytest.mark.slow
@pytest.mark.parametrize("k", [1, 2, 3])
def test_calibrated_and_an_idle_number_is_not_identified(posterior: Posterior, k: int) -> None:
    z, S = people(300, 6)
    found = calibrate(z, posterior.sample_all(S[:, :k], draws=199), NAMES)
    assert "not calibrated" not in found.verdicts
    assert found.verdicts[2] == "not identified"
    assert found.verdicts[0] == "identified"
    assert abs(found.contraction[2]) < 0.1
    expected = 1 - np.diag(exact(S[0, :k])[1])
    assert np.abs(found.contraction - expected).max() < 0.1


@pytest.mark.slow
def test_density_and_support(posterior: Posterior) -> None:
    _, S = people(1, 8)
    mean, covariance = exact(S[0])
    z = np.random.default_rng(1).multivariate_normal(mean, covariance, 500)
    away = z - mean
    log = -0.5 * np.einsum("ij,jk,ik->i", away, np.linalg.inv(covariance), away)
    log -= 0.5 * np.log(np.linalg.det(2 * np.pi * covariance))
    assert np.mean(log - posterior.log_density(z, S[0])) < 0.15  # Kullback and Leibler's divergence
    prior = np.random.default_rng(2).normal(size=(4000, 3))
    exactly = np.exp(-0.5 * np.einsum("ij,jk,ik->i", prior - mean, np.linalg.inv(covariance), prior - mean))
    exactly /= np.exp(-0.5 * np.sum(prior**2, axis=1))
    assert posterior.support(prior, S[0]) == pytest.approx(exactly.sum() ** 2 / (exactly**2).sum(), rel=0.35)


@pytest.mark.slow
def test_a_temperature_widens_a_flow_that_is_too_certain(posterior: Posterior) -> None:
    network = posterior.networks[0]
    assert network.temperature == pytest.approx(1, abs=0.05)
    z, S = people(400, 11)
    conditions = posterior.seen.pool(S)
    means = np.array([exact(given)[0] for given in S])
    assert network.temper(z, conditions).temperature == pytest.approx(1, abs=0.1)
    wider = network.temper(means + 1.5 * (z - means), conditions)
    assert wider.temperature == pytest.approx(1.5, abs=0.15)
    drawn = wider.invert(np.random.default_rng(3).normal(size=(400, 3)), conditions)
    ratio = np.exp(network.log_density(drawn, conditions) - wider.log_density(drawn, conditions))
    assert ratio.mean() == pytest.approx(1, abs=0.15)  # both are densities


@pytest.mark.slow
def test_kept_and_read_again(posterior: Posterior, tmp_path) -> None:
    _, S = people(1, 9)
    posterior.save(tmp_path / "posterior.npz")
    again = Posterior.load(tmp_path / "posterior.npz")
    assert np.array_equal(posterior.sample(S[0], 50, 4), again.sample(S[0], 50, 4))
    assert not np.array_equal(posterior.sample(S[0], 50, 4), again.sample(S[0], 50, 5))
    assert again.misfit(S[0] + 100).outside == posterior.misfit(S[0] + 100).outside
    with pytest.raises(FitError, match="4 trials of a person; expected 1 to 3"):
        posterior.sample(np.zeros((4, 5)))


@pytest.mark.slow
def test_same_seed_same_network_and_the_callers_random_numbers_stay() -> None:
    z, S = people(200, 1)
    here = np.random.get_state()[1].copy()  # noqa: NPY002
    one, other = (train_posterior(z, S, NAMES, SUMMARIES, seed=7, epochs=2, depth=1) for _ in range(2))
    (first,), (second,) = one.networks, other.networks
    assert all(np.array_equal(a, b) for a, b in zip(first.weights, second.weights, strict=True))
    assert np.array_equal(np.random.get_state()[1], here)  # noqa: NPY002


@pytest.mark.slow
def test_the_library_is_imported_without_drawing_the_callers_random_numbers() -> None:
    script = (
        "import random, numpy as np; random.seed(1); np.random.seed(1)\n"
        "from icmj.fits.network import library; library()\n"
        "print(random.random(), np.random.random())"
    )
    told = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True, timeout=PATIENCE)
    drawn = random.Random(1).random(), np.random.RandomState(1).random()
    assert tuple(map(float, told.stdout.split())) == drawn


class Normal:
    """Stands for a flow: a normal distribution about a mean, whatever is seen."""

    def __init__(self, mean: float) -> None:
        self.mean = mean

    def invert(self, normal, _):
        return self.mean + normal

    def log_density(self, z, _):
        return norm.logpdf(z - self.mean).sum(axis=1)


@dataclass(frozen=True)
class Wide:
    """Stands for a flow that knows nothing but how wide it is."""

    temperature: float

    def invert(self, normal, _):
        return self.temperature * normal

    def scaled(self, factor):
        return Wide(factor * self.temperature)


@pytest.mark.parametrize("wide", [(0.6, 0.6), (1.4, 1.4), (0.7, 1.5)])
def test_a_posterior_rescaled_holds_nine_of_ten(wide: tuple[float, float]) -> None:
    z, S = np.random.default_rng(3).normal(size=(3000, 3)), np.zeros((3000, 2, 5))
    found = Posterior(NAMES, SeenSummaries.of(people(40, 1)[1], SUMMARIES), tuple(map(Wide, wide)), 40).rescale(z, S, 1)
    share = mixed(found.networks[0].temperature, found.networks[1].temperature)
    assert share == pytest.approx(0.9, abs=3 * np.sqrt(0.09 / 9000) + 0.004)  # and of 299 draws
    assert found.networks[1].temperature / found.networks[0].temperature == pytest.approx(wide[1] / wide[0])


def mixed(a: float, b: float) -> float:
    """The share of a standard normal variable between the quantiles 5 and 95 % of two normal distributions' mixture."""
    edge = brentq(lambda x: norm.cdf(x / a) + norm.cdf(x / b) - 1.9, 0, 20)
    return float(2 * norm.cdf(edge) - 1)


def test_the_posterior_is_the_mixture_of_its_flows() -> None:
    _, S = people(40, 1)
    seen = SeenSummaries.of(S, SUMMARIES)
    mixture = Posterior.mixture([Posterior(NAMES, seen, (Normal(mean),), 40) for mean in (-3.0, 3.0)])
    z = mixture.sample(S[0], 1001, 0)
    assert (z[:, 0] > 0).sum() == pytest.approx(500, abs=5)
    assert (z[:10, 0] > 0).sum() == 5  # the first draws are of both
    both = 0.5 * (np.exp(Normal(-3.0).log_density(z, None)) + np.exp(Normal(3.0).log_density(z, None)))
    np.testing.assert_allclose(mixture.log_density(z, S[0]), np.log(both), rtol=1e-9)


def test_what_is_no_network_is_told(tmp_path) -> None:
    path = tmp_path / "posterior.npz"
    path.write_bytes(b"PK")
    with pytest.raises(FitError, match="not as it was written"):
        Posterior.load(path)
    with Folder(tmp_path, FitError).seal(path) as part:
        part.write_bytes(b"PK")
    with pytest.raises(FitError, match=r"cannot be read \(not an npz file"):
        Posterior.load(path)
    with pytest.raises(FitError, match="cannot be read"):
        Posterior.load(tmp_path / "none.npz")
    with Folder(tmp_path, FitError).seal(path) as part, part.open("wb") as file:
        np.savez(file, head=np.array('{"version": 3, "mark": "", "networks": [{"kind": "classifier"}]}'))
    with pytest.raises(FitError, match="no flow of this version"):
        Posterior.load(path)


def test_too_few_people_or_numbers_are_refused() -> None:
    z, S = people(50, 1)
    with pytest.raises(FitError, match="50 people"):
        train_posterior(z, S, NAMES, SUMMARIES)
    with pytest.raises(FitError, match="two numbers at least"):
        train_posterior(z[:, :1], S, NAMES[:1], SUMMARIES)


def test_effective_sample_size() -> None:
    assert effective(np.full(12, -700.0)) == pytest.approx(12)
    assert effective([0.0, -800.0, -900.0]) == pytest.approx(1)


def test_a_missing_library_is_one_line_that_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "bayesflow", None)
    z, S = people(200, 1)
    with pytest.raises(FitError, match=r"needs bayesflow .*pip install -e '\.\[fit\]'"):
        train_posterior(z, S, NAMES, SUMMARIES)


def test_what_is_identified_of_most_is_not_of_one_whose_posterior_is_as_wide_as_the_prior() -> None:
    """Of z with the variance 1, read with noise of the variance v, the posterior has the variance v/(1 + v)."""
    random, v = np.random.default_rng(5), 0.25
    z = random.normal(size=(400, 1))
    mean = (z + np.sqrt(v) * random.normal(size=z.shape)) / (1 + v)
    drawn = mean[:, None] + np.sqrt(v / (1 + v)) * random.normal(size=(400, 199, 1))
    found = calibrate(z, drawn, ("P",))
    assert found.verdicts == ("identified",)
    assert found.judge(np.array([0.35])) == ("not identified",)
    assert found.judge(1 - drawn[0].var(axis=0)) == ("identified",)
