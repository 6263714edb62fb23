"""The fit as a whole, of toy families that sway as filtered noise: what is found, resumed, and left in the folder."""

import json
from dataclasses import dataclass
from functools import cache

import numpy as np
import pyarrow.parquet as pq
import pytest

from icmj.errors import FitError
from icmj.fitting.bank import Bank
from icmj.fitting.prior import Distribution, Prior
from icmj.fitting.summaries import summarise
from icmj.study import families as families_module
from icmj.study import fit as fits
from icmj.study import fit_page
from icmj.study.fit import Subject, fit
from icmj.study.fit_page import write_fit

PRIOR = Prior(
    ("size", "corner", "idle"),
    ("m", "Hz", ""),
    ("size", "corner", "idle"),
    ("ours",) * 3,
    tuple(Distribution(True, np.log(low), np.log(high)) for low, high in ((1e-3, 1e-2), (0.1, 1.0), (0.1, 1.0))),
)


@dataclass(frozen=True)
class Toy:
    """A family, and each of its members: noise through a filter of first or of second order."""

    name: str
    order: int
    theta: tuple = ()
    prior = PRIOR
    fingerprint = "0123456789abcdef"

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
    return simulated_toy(family, min(n, 40) if seed % 2 else n, seed)


@cache
def simulated_toy(family: Toy, n: int, seed: int) -> Bank:
    theta = family.prior.draw(n, seed + 10)
    S = np.array([[summarise(family.member(t).trial(31 * i + k)) for k in range(2)] for i, t in enumerate(theta)])
    return Bank(family.name, family.prior, "", theta, S, np.zeros(n, dtype=bool), seed)


def person(name: str, theta: tuple, **more) -> Subject:
    return Subject(name, tuple(Toy("one", 1, theta).trial(1000 + i) for i in range(2)), **more)


class Killed(Exception):
    """As a signal would."""


@pytest.mark.slow
def test_killed_at_any_stage_it_goes_on_and_finds_the_same(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(families_module, "simulate_bank", toy_bank)
    monkeypatch.setattr(fits, "PREDICTED", 25)
    monkeypatch.setattr(fit_page, "_SHOWN", 0.5)  # the first person under the first family
    trainings = []
    train_posterior, train_choice = families_module.train_posterior, families_module.train_choice

    def counted_posterior(*given, **more):
        made = train_posterior(*given, epochs=8, depth=1, **more)
        trainings.append("posterior")
        return made

    def counted_choice(*given, **more):
        made = train_choice(*given, epochs=8, **more)
        trainings.append("choice")
        return made

    monkeypatch.setattr(families_module, "train_posterior", counted_posterior)
    monkeypatch.setattr(families_module, "train_choice", counted_choice)
    families = [Toy("one", 1), Toy("two", 2)]
    people = [person("anna", (4e-3, 0.3, 0.5), held=1), person("ben", (0.5, 0.3, 0.5))]

    def attempt(out, **more):
        return fit(people, families, out, trained=tmp_path / "trained", simulations=240, draws=400, jobs=1, **more)

    for stage in ("two, training", "fitting anna", "fitting ben"):

        def kill(label: str, done: float, stage: str = stage) -> None:
            if label == stage:
                raise Killed

        with pytest.raises(Killed):
            attempt(tmp_path / "out", progress=kill)
    found = attempt(tmp_path / "out")
    assert trainings == ["posterior", "posterior", "choice"]
    again = attempt(tmp_path / "other")
    assert len(trainings) == 3
    for one, other in zip(found.fitted, again.fitted, strict=True):
        assert np.array_equal(one.theta, other.theta)
        assert np.array_equal(one.predictive.simulated, other.predictive.simulated)

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
    assert "Misfit: outside of everything simulated" in page
    assert pq.read_table(tmp_path / "out" / "results.parquet").num_rows == 2 * 2 * 3
    told = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert told["people"][0]["fits"]["one"]["numbers"]["size"]["low"] < 4e-3
    assert told["choice"]["counts"][0][0] > 20


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
