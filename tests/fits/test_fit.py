"""The fit as a whole, of toy families that sway as filtered noise: what is found, resumed, and left in the folder."""

import json
from dataclasses import dataclass, replace
from functools import cache, partial
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.stats import binomtest

from icmj.errors import FitError
from icmj.fits import choice, network, posterior
from icmj.fits import fit as families_module
from icmj.fits import fit as fits
from icmj.fits import page as fit_page
from icmj.fits import posterior as calibration
from icmj.fits.bank import Bank
from icmj.fits.family import Prior, load_family
from icmj.fits.family_file import ParameterTable, PriorTable
from icmj.fits.fit import Subject, fit, train_family
from icmj.fits.misfit import SeenSummaries
from icmj.fits.page import write_fit
from icmj.fits.summaries import SUMMARIES, summarise

PRIOR = Prior(
    tuple(
        ParameterTable(
            name=name,
            unit=unit,
            keys={name: 1.0},
            source="ours",
            prior=PriorTable(kind="log-uniform", low=low, high=high),
        )
        for name, unit, low, high in (("size", "m", 1e-3, 1e-2), ("corner", "Hz", 0.1, 1.0), ("idle", "", 0.1, 1.0))
    )
)


@dataclass(frozen=True)
class Toy:
    """A family, and each of its members: noise through a filter of first or of second order."""

    name: str
    order: int
    theta: tuple = ()
    prior = PRIOR
    fingerprint = "0123456789abcdef"
    has_delay = False

    @property
    def title(self) -> str:
        return self.name.capitalize()

    def member(self, theta) -> "Toy":
        return Toy(self.name, self.order, tuple(theta))

    def trial(self, seed: int) -> np.ndarray:
        size, corner, _ = self.theta
        f = np.fft.rfftfreq(6000, 0.01)
        white = np.fft.rfft(np.random.default_rng((seed, self.order)).normal(size=6000))
        x = np.fft.irfft(white / np.sqrt(1 + (f / corner) ** 2) ** self.order, 6000)
        return size * (x - x.mean()) / 3 / np.sqrt(corner)


def toy_bank(family: Toy, n: int, seed: int, *, folder, **_) -> Bank:
    folder.mkdir(parents=True, exist_ok=True)
    return simulated_toy(family, min(n, 80) if seed % 2 else n, seed)


@cache
def simulated_toy(family: Toy, n: int, seed: int) -> Bank:
    theta = family.prior.draw(n, seed + 10)
    S = np.array([[summarise(family.member(t).trial(31 * i + k)) for k in range(2)] for i, t in enumerate(theta)])
    return Bank(family.name, family.prior, "", theta, S, np.zeros(n, dtype=bool), seed)


def person(name: str, theta: tuple, **more) -> Subject:
    return Subject(name, tuple(Toy("one", 1, theta).trial(1000 + i) for i in range(2)), **more)


class Killed(Exception):
    """As a signal would."""


@dataclass(frozen=True)
class Regression:
    """Stands for a network, trained in no time: a linear regression, and what is left of it as noise."""

    kind: str
    weights: np.ndarray
    spread: np.ndarray

    @classmethod
    def train(cls, kind, rows, held_out, seed, *, epochs, progress=None, **_) -> "Regression":
        targets, conditions = rows(np.random.default_rng(seed))
        for epoch in range(epochs):
            if progress is not None:
                progress("training", (epoch + 1) / epochs)
        weights = np.linalg.lstsq(conditions, targets, rcond=None)[0]
        return cls(kind, weights, (targets - conditions @ weights).std(axis=0))

    def invert(self, normal, conditions):
        return conditions @ self.weights + self.spread * normal

    def log_density(self, targets, conditions):
        return -0.5 * np.sum(((targets - conditions @ self.weights) / self.spread) ** 2, axis=1)

    def temper(self, *_):
        return self

    def scaled(self, factor):
        return replace(self, spread=factor * self.spread)

    def logits(self, conditions):
        return conditions @ self.weights

    def head(self):
        return {"kind": self.kind}

    def arrays(self):
        return {"weights": self.weights, "spread": self.spread}

    @classmethod
    def of(cls, head, arrays, *_) -> "Regression":
        return cls(head["kind"], arrays["weights"], arrays["spread"])


@pytest.fixture
def toys(monkeypatch):
    """Toy families, 25 predicted trials, pictures of the first person under the first family alone."""
    monkeypatch.setattr(families_module, "simulate_bank", toy_bank)
    monkeypatch.setattr(fits, "PREDICTED", 25)
    monkeypatch.setattr(fit_page, "_SHOWN", 0.5)
    people = [person("anna", (4e-3, 0.3, 0.5), held=1), person("ben", (0.5, 0.3, 0.5))]

    def attempt(folder, out="out", **more):
        families = [Toy("one", 1), Toy("two", 2)]
        trained = folder / "trained"
        return fit(people, families, folder / out, trained=trained, simulations=120, draws=400, jobs=1, **more)

    return attempt


@pytest.mark.slow
def test_killed_at_any_stage_it_goes_on_and_finds_the_same(tmp_path, monkeypatch, toys) -> None:
    trainings = []

    def counted(kind, *given, **more):
        made = Regression.train(kind, *given, **more)
        trainings.append(kind)
        return made

    for module in (posterior, choice):
        monkeypatch.setattr(module, "train", counted)
    monkeypatch.setattr(posterior, "Network", Regression)
    monkeypatch.setattr(families_module, "MEMBERS", 2)
    told: list[tuple[str, float]] = []
    for stage in ("two, training", "which family, training", "fitting ben"):

        def kill(label: str, done: float, stage: str = stage) -> None:
            told.append((label, done))
            if label == stage:
                raise Killed

        with pytest.raises(Killed):
            toys(tmp_path, progress=kill)
    done = [done for label, done in told if label == "which family, training"]
    assert len(done) == 1 + choice.EPOCHS
    assert len(set(done)) == choice.EPOCHS
    assert done == sorted(done)
    found = toys(tmp_path)
    assert trainings == ["flow"] * 4 + ["classifier"]
    again = toys(tmp_path, "other")
    assert len(trainings) == 5
    for one, other in zip(found.fitted, again.fitted, strict=True):
        assert np.array_equal(one.theta, other.theta)
        assert np.array_equal(one.predictive.simulated, other.predictive.simulated)
    assert np.array_equal(found.probabilities, again.probabilities)


@pytest.fixture
def compiled_in_a_hurry():
    """Networks are compiled without optimisation, which takes longer than to train them."""
    network.library()
    import jax

    before = jax.config.values["jax_disable_most_optimizations"]
    jax.config.update("jax_disable_most_optimizations", True)
    yield
    jax.config.update("jax_disable_most_optimizations", before)


@pytest.mark.slow
@pytest.mark.usefixtures("compiled_in_a_hurry")
def test_what_is_found_and_left_in_the_folder(tmp_path, monkeypatch, toys) -> None:
    monkeypatch.setattr(network, "_WIDTHS", (32,))
    monkeypatch.setattr(families_module, "MEMBERS", 1)
    monkeypatch.setattr(families_module, "train_posterior", partial(families_module.train_posterior, epochs=8, depth=1))
    monkeypatch.setattr(families_module, "train_choice", partial(families_module.train_choice, epochs=30))
    found = toys(tmp_path)
    anna, ben = found.fitted[0], found.fitted[2]
    low, high = np.quantile(anna.theta[:, 0], (0.005, 0.995))
    assert low < 4e-3 < high
    assert found.trained["one"].calibration.verdicts[2] != "identified"
    assert anna.predictive.observed.shape == (1, 6)
    assert "log rms" in ben.misfit.outside  # a hundred times as large as anyone simulated
    assert found.probabilities is not None
    assert found.probabilities[0, 0] > 0.5

    write_fit(found, tmp_path / "out")
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"report.html", "results.parquet", "summary.json", "anna.one.nc", "sway.anna.one.svg"} <= names
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Do not trust this fit, because" in page
    # the first line says what a probability hangs on, and none is certain
    first = page.replace("\u00a0", " ").partition("whose probability is ")[2][:400]
    assert choice.AT_ONCE in first
    assert not first.startswith(("1.00", "0.00"))
    foot = page.partition("<footer>")[2]
    assert "from recordings and simulated people" in foot
    assert not any(word in foot for word in ("Gawthrop", "logs", "PDF"))
    caveats = (choice.CAVEAT, posterior.PREDICTION_CAVEAT, calibration.CALIBRATION_CAVEAT)
    for said in (*caveats, "76 %", "48 of 60", "42 %"):
        assert said in page.replace("\u00a0", " ")
    results = pq.read_table(tmp_path / "out" / "results.parquet")
    assert results.num_rows == 2 * 2 * 3
    assert b"24 shares" in results.schema.metadata[b"family_probability"]
    told = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert told["people"][0]["fits"]["one"]["numbers"]["size"]["low"] < 4e-3
    assert told["choice"]["counts"][0][0] > 20
    assert "24 shares" in told["choice"]["caveat"]


def test_as_many_calibrate_as_were_asked_for_although_some_fall(tmp_path, monkeypatch) -> None:
    def half_fall(family: Toy, n: int, seed: int, **_) -> Bank:
        theta, fell = family.prior.draw(n, seed), np.arange(n) % 2 == 0
        S = np.where(fell[:, None, None], np.nan, theta[:, None])
        return Bank(family.name, family.prior, "", theta, S, fell, seed)

    class Known:
        """A posterior that is the prior."""

        names, seen = PRIOR.names, SimpleNamespace(trials=3, names=SUMMARIES)

        def __init__(self, *_, **__) -> None: ...
        def save(self, *_) -> None: ...
        def load(self, *_) -> "Known":
            return Known()

        def mixture(self) -> "Known":
            return Known()

        def rescale(self, *_) -> "Known":
            return self

        def sample_all(self, S, draws, seed):
            return np.random.default_rng(seed).normal(size=(len(S), draws, 3))

    monkeypatch.setattr(families_module, "simulate_bank", half_fall)
    monkeypatch.setattr(families_module, "train_posterior", Known)
    monkeypatch.setattr(families_module, "Posterior", Known)
    found = families_module.train_family(Toy("one", 1), tmp_path, 400, check=60, trials=1)
    assert len(found.check) == len(found.calibration.ranks) == 60
    assert np.isfinite(found.check).all()


def test_beside_every_probability_stands_what_it_does_not_carry() -> None:
    several = fit_page.caveats(SimpleNamespace(probabilities=np.ones((1, 2))))
    for figure in ("76 %", "1 %", "48 of 60", "42 %", "24 shares", "13 of 33", "19", "82 %", "78 %", "84 %", "69 %"):
        assert any(figure in said for said in several), figure
    assert any("identified in one run, and not identified in another" in said for said in several)
    one = fit_page.caveats(SimpleNamespace(probabilities=None))
    assert len(one) == 3
    assert any("48 trials, four families, 4,000 draws" in said for said in one)
    assert not any("76 %" in said for said in one)


class Idle:
    """Stands for a flow that has learnt nothing: the posterior is the prior."""

    def invert(self, normal, _):
        return normal

    def log_density(self, z, _):
        return -0.5 * np.sum(z**2, axis=1)


def test_a_posterior_rests_on_no_more_people_than_were_simulated(tmp_path, monkeypatch) -> None:
    """Of a posterior that is the prior all weights are alike: it rests on all who were simulated, and on no others."""
    monkeypatch.setattr(fits, "PREDICTED", 25)
    bank = simulated_toy(Toy("one", 1), 40, 0)
    idle = posterior.Posterior(PRIOR.names, SeenSummaries.of(bank.summaries, SUMMARIES), (Idle(),), len(bank))
    check = families_module.TrainedFamily(Toy("one", 1), "", idle, None, bank.summaries, bank.z)
    found = fits._fit_person(person("anna", (4e-3, 0.3, 0.5)), check, tmp_path, 200, 0)
    assert found.support == pytest.approx(40)


def test_people_and_families_that_cannot_be_told_apart_are_refused(tmp_path) -> None:
    one = person("anna", (4e-3, 0.3, 0.5))
    with pytest.raises(FitError, match="two people are called anna"):
        fit([one, one], [Toy("one", 1)], tmp_path)
    with pytest.raises(FitError, match="two families are called one"):
        fit([one], [Toy("one", 1), Toy("one", 2)], tmp_path)
    with pytest.raises(FitError, match="2 trials, of which 2 are held out"):
        fit([person("anna", (4e-3, 0.3, 0.5), held=2)], [Toy("one", 1)], tmp_path)
    with pytest.raises(FitError, match="nothing to fit"):
        fit([], [Toy("one", 1)], tmp_path)


@pytest.mark.parametrize(("names", "families", "line"), [
    (("a/b", "a b"), ("one",), r"'a/b, one' and 'a b, one' would share the files a-b\.one\.\*"),
    (("Anna", "anna"), ("one",), "would share the files anna"),  # on macOS and Windows
    (("anna",), ("a.b", "a b"), r"would share the files anna\.a-b"),
    (("x" * 400,), ("one",), "too long for the name of a file; expected at most 150 bytes"),
    (("ж" * 80,), ("one",), "too long for the name of a file"),
])  # fmt: skip
def test_people_whose_files_would_have_one_name_or_none_are_refused_before_any_work(names, families, line, tmp_path):
    people = [person(name, (4e-3, 0.3, 0.5)) for name in names]
    with pytest.raises(FitError, match=line) as caught:
        fit(people, [Toy(name, 1) for name in families], tmp_path / "out", trained=tmp_path / "trained")
    assert len(str(caught.value)) < 300
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_model_error_under_noise_is_inferred_as_the_documentation_says(tmp_path, root, monkeypatch):
    """The family of docs/sweeps.md: b and the noise of people whom it was not trained on, with intervals that hold."""
    monkeypatch.setattr(families_module, "MEMBERS", 1)  # in a quarter of the time
    family = load_family(root / "examples" / "pendulum-family.toml")
    trained = train_family(family, tmp_path / "trained", 250, check=60, trials=1)
    found = trained.calibration
    assert found.contraction[0] > 0.9
    assert found.contraction[1] > 0.8
    for coverage in found.coverage:
        assert binomtest(round(60 * coverage), 60, 0.9).pvalue > 1e-3
