"""The fit: families are trained once, then each person has a posterior, what it predicts, and a choice of family.

What is finished is kept, and found again by what it was made of, so that a fit goes on where it was interrupted::

    OUT/people/*.npz   what draws of each posterior measure; digests in SHA256SUMS there
    TRAINED/NAME-FINGERPRINT/bank-SEED, check-SEED   simulated people to train on; others to calibrate with
    TRAINED/NAME-FINGERPRINT/flow-*.npz, posterior-*.npz, TRAINED/choice-*.npz   networks
"""

from __future__ import annotations

import hashlib
import math
import os
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

import numpy as np

from icmj.base.array import Array
from icmj.base.files import make_ready
from icmj.base.npz import read_npz
from icmj.base.text import one_line
from icmj.errors import FitError, IcmjError
from icmj.fits.bank import Bank, simulate_bank
from icmj.fits.calibration import Calibration, calibrate
from icmj.fits.choice import Choice, Confusion, confusion, train_choice
from icmj.fits.family import RATE, Family, load_family
from icmj.fits.groups import Difference, compare
from icmj.fits.misfit import Misfit
from icmj.fits.posterior import MEMBERS, Posterior, train_posterior
from icmj.fits.prediction_check import Predictive, check_prediction
from icmj.fits.summaries import MEASURES, SUMMARIES, measures, summarise
from icmj.work.folder import SUMS, Folder

Tell = Callable[[str, float], None]
SIMULATIONS, CHECK = 6000, 200


@dataclass(frozen=True, eq=False)
class TrainedFamily:
    """A family that was simulated and trained.

    Attributes:
        family: it.
        words: how many were simulated, how many fell.
        posterior: for all people.
        calibration: on synthetic people that it was not trained on.
        check: their summaries, shape (n, K, s).
        people: numbers of the simulated people that it was trained on, as standard normal variables, shape (n, p).
    """

    family: Family
    words: str
    posterior: Posterior
    calibration: Calibration
    check: Array
    people: Array


def train_family(
    family: Family,
    folder: Path,
    simulations: int = SIMULATIONS,
    seed: int = 0,
    *,
    check: int = CHECK,
    trials: int = 3,
    jobs: int | None = None,
    dask: str | None = None,
    progress: Tell | None = None,
) -> TrainedFamily:
    """A family simulated, trained and calibrated; what is finished in ``folder`` is taken from there.

    Args:
        family: the family.
        folder: of banks and networks.
        simulations: draws to train on.
        seed: of everything random.
        check: people who stand to set the posterior's width with, and as many others to calibrate with.
        trials: of each synthetic person that calibration is shown, 1 to 3.
        jobs, dask: processes, or the address of a Dask scheduler.
        progress: called with what is under way and the fraction done.

    Raises:
        FitError: if bayesflow is missing, too few stand, or a folder cannot be used.
    """
    tell = progress or (lambda label, done: None)
    home = folder / f"{family.name}-{family.fingerprint}"

    def simulated(name: str, n: int, begin: float, share: float, seed: int) -> Bank:
        def told(done: float) -> None:
            tell(f"{family.name}, simulating", begin + share * done)

        return simulate_bank(family, n, seed, folder=home / f"{name}-{seed}", jobs=jobs, dask=dask, progress=told)

    bank = simulated("bank", simulations, 0.0, 0.65, 2 * seed)
    stood = bank.stood
    share = max(len(stood) / len(bank), 0.1)
    apart = simulated("check", math.ceil(1.1 * 2 * check / share) + 10, 0.65, 0.05, 2 * seed + 1).stood
    half = min(check, len(apart) // 2)  # as many stood, but for bad luck
    truth, shown = apart.z[half : half + check], apart.summaries[half : half + check]
    mark, joined = f"{family.fingerprint}-{simulations}-{seed}", home / f"posterior-{simulations}-{seed}.npz"
    if not os.path.lexists(joined):
        members = []
        for member in range(MEMBERS):
            path = home / f"flow-{simulations}-{seed}-{member}.npz"
            if not os.path.lexists(path):

                def training(_: str, done: float, member: int = member) -> None:
                    tell(f"{family.name}, training", 0.7 + 0.3 * (member + done) / MEMBERS)

                made = train_posterior(
                    stood.z, stood.summaries, family.prior.names, SUMMARIES, seed=seed, member=member, progress=training
                )
                made.save(path, f"{mark}-{member}")
            members.append(Posterior.load(path, f"{mark}-{member}"))
        Posterior.mixture(members).rescale(apart.z[:half], apart.summaries[:half], seed).save(joined, mark)
    posterior = Posterior.load(joined, mark)
    if posterior.names != family.prior.names or posterior.seen.names != SUMMARIES:
        raise FitError(
            f"{joined}: is of other numbers or summaries than the family; remove it, and it is trained again"
        )
    if not 1 <= trials <= posterior.seen.trials:
        raise FitError(f"{trials} trials of a person; a family is trained on 1 to {posterior.seen.trials}")
    drawn = posterior.sample_all(shown[:, :trials], 499, seed)
    calibration = calibrate(truth, drawn, family.prior.names)
    return TrainedFamily(family, bank.words, posterior, calibration, shown, stood.z)


def choice_among(
    families: Sequence[Family],
    folder: Path,
    simulations: int,
    seed: int,
    progress: Tell | None = None,
) -> Choice:
    """The choice among families, trained or found again."""
    said = "-".join([*(family.fingerprint for family in families), str(simulations), str(seed)])
    path = folder / f"choice-{hashlib.sha256(said.encode()).hexdigest()[:16]}.npz"
    if os.path.lexists(path):
        choice = Choice.load(path, said)
        if choice.families != tuple(family.name for family in families) or choice.seen.names != SUMMARIES:
            raise FitError(f"{path}: is of other families or summaries; remove it, and it is trained again")
        return choice
    banks = {
        family.name: simulate_bank(
            family,
            simulations,
            2 * seed,
            folder=folder / f"{family.name}-{family.fingerprint}" / f"bank-{2 * seed}",
            jobs=1,
        ).stood.summaries
        for family in families
    }
    choice = train_choice(banks, SUMMARIES, seed=seed, progress=progress)
    choice.save(path, said)
    return choice


DRAWS, PREDICTED = 2000, 100
_MOST_BYTES = 1e7
_LONGEST = 150  # bytes of a stem: figures' names and what is under way add to it, and 255 is all a name may have


@dataclass(frozen=True, eq=False)
class Subject:
    """One person in one condition.

    Attributes:
        name: name of the person.
        trials: front-to-back centre of pressure of each trial [m] at 100 Hz.
        held: number of the last trials that are not fitted but compared with the prediction of the fit.
        group, condition: group and condition from a table; otherwise empty.
        notes: changes that were made to the recordings.
    """

    name: str
    trials: tuple[Array, ...]
    held: int = 0
    group: str = ""
    condition: str = ""
    notes: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """Name and condition."""
        return f"{self.name}, {self.condition}" if self.condition else self.name

    def stem(self, family: str) -> str:
        """Begins the names of the files of this person under one family."""
        parts = [self.name, self.condition, family]
        return ".".join("".join(c if c.isalnum() or c in "-_" else "-" for c in part) for part in parts if part)


@dataclass(frozen=True, eq=False)
class FamilyFit:
    """The fit of one family to one person, valid if the family is right.

    Attributes:
        person: the person and the trials.
        family: name of the family.
        z, theta: draws of the parameters, as standard normal variables and in their units, shape (n, p).
        misfit: how far the person is from the simulated people.
        support: effective number of the simulated people of the training on whom the posterior is based.
        predictive: measures of simulated trials, with those of the recorded ones.
    """

    person: Subject
    family: str
    z: Array
    theta: Array
    misfit: Misfit
    support: float
    predictive: Predictive

    @property
    def contraction(self) -> Array:
        """1 − variance of the posterior / variance of the prior, of this person; shape (p,). 1 is all, 0 nothing."""
        return np.asarray(1 - self.z.var(axis=0))


@dataclass(frozen=True, eq=False)
class Fit:
    """Fits of families to people.

    Attributes:
        people: the people and their trials.
        trained: the trained families, by name.
        fitted: the fit of each family to each person, in the order of the people.
        confusion: confusion matrix of the choice among families; ``None`` if there is one family.
        probabilities: probability of each family for each person, shape (people, families); ``None`` if there is one
            family.
        differences: differences between groups and between conditions, by family.
    """

    people: tuple[Subject, ...]
    trained: Mapping[str, TrainedFamily]
    fitted: tuple[FamilyFit, ...]
    confusion: Confusion | None
    probabilities: Array | None
    differences: Mapping[str, tuple[Difference, ...]]


def fit(
    people: Sequence[Subject],
    families: Sequence[Family | Path | str],
    out: Path | str,
    *,
    trained: Path | str = Path("runs/out/families"),
    simulations: int = SIMULATIONS,
    draws: int = DRAWS,
    seed: int = 0,
    jobs: int | None = None,
    dask: str | None = None,
    progress: Tell | None = None,
) -> Fit:
    """Fit families of controllers to people; an interrupted fit is resumed.

    Args:
        people: the people with their trials.
        families: family files, or names of shipped families.
        out: folder for the results.
        trained: folder for banks and networks, which are used for all people.
        simulations: number of draws from the prior of each family for training.
        draws: number of draws from each posterior.
        seed: seed of everything random.
        jobs: number of local processes; by default the number of cores.
        dask: address of a Dask scheduler, whose workers are used instead.
        progress: called repeatedly with a description of the current work and the completed fraction, 0–1.

    Raises:
        FitError: if people or families do not fit together, bayesflow is missing, or a folder cannot be used.
        RunFileError: if a family file does not validate.
    """
    made = [load_family(each) if isinstance(each, (str, Path)) else each for each in families]
    _check(people, made)
    out, trained = Path(out), Path(trained)
    try:
        for folder in (out / "people", trained):
            make_ready(folder, SUMS)
    except OSError as error:
        raise FitError(f"{out}: cannot be written to ({error.strerror}); choose another --out") from error
    tell = progress or (lambda label, done: None)
    K = max(len(one.trials) - one.held for one in people)
    known: dict[str, TrainedFamily] = {}
    for i, family in enumerate(made):

        def told(label: str, done: float, i: int = i) -> None:
            tell(label, 0.85 * (i + done) / len(made))

        known[family.name] = train_family(
            family, trained, simulations, seed, trials=K, jobs=jobs, dask=dask, progress=told
        )

    def choosing(_: str, done: float) -> None:
        tell("which family, training", 0.85 + 0.07 * done)

    choice = choice_among(made, trained, simulations, seed, choosing) if len(made) > 1 else None
    fitted = []
    for i, one in enumerate(people):
        tell(f"fitting {one.label}", 0.92 + 0.08 * i / len(people))
        fitted += [_fit_person(one, known[family.name], out / "people", draws, seed) for family in made]
    told_apart = probabilities = None
    if choice is not None:
        told_apart = confusion(choice, {name: each.check[:, :K] for name, each in known.items()})
        probabilities = np.array([choice.probabilities(_summaries(one)) for one in people])
    differences = {name: _differences(each, fitted) for name, each in known.items()}
    return Fit(tuple(people), known, tuple(fitted), told_apart, probabilities, differences)


def _check(people: Sequence[Subject], families: Sequence[Family]) -> None:
    """See that people and families can be told from each other."""
    if not people or not families:
        raise FitError("nothing to fit: give a recording and --model at least")
    for what, names in (("families", [each.name for each in families]), ("people", [each.label for each in people])):
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise FitError(f"two {what} are called {twice[0]}")
    stems: dict[str, str] = {}
    for one, family in ((one, family) for one in people for family in families):
        # names that differ in capitals, or in how a letter is composed, are one on some systems
        mark, who = (
            unicodedata.normalize("NFC", stem := one.stem(family.name)).casefold(),
            f"{one.label}, {family.name}",
        )
        if (other := stems.setdefault(mark, who)) != who:
            raise FitError(f"{other!r} and {who!r} would share the files {one_line(stem, 60)}.*; rename one of them")
        if len(os.fsencode(stem)) > _LONGEST:
            raise FitError(
                f"{one_line(one.label, 60)}: too long for the name of a file; expected at most {_LONGEST} bytes, with "
                "condition and family"
            )
    for one in people:
        if not 0 <= one.held < len(one.trials):
            raise FitError(f"{one.label}: {len(one.trials)} trials, of which {one.held} are held out; one is needed")


def _summaries(person: Subject, held: bool = False) -> Array:
    """Summaries of the trials that are fitted, shape (k, s), or of those that are held out."""
    kept = len(person.trials) - person.held
    return np.stack([summarise(trial, RATE) for trial in (person.trials[kept:] if held else person.trials[:kept])])


def _fit_person(person: Subject, trained: TrainedFamily, folder: Path, draws: int, seed: int) -> FamilyFit:
    """One person under one family; the trials that the posterior predicts are kept."""
    family, posterior = trained.family, trained.posterior
    S = _summaries(person)
    z = posterior.sample(S, draws, seed)
    theta = family.prior.from_normal(z)
    chosen = theta[:PREDICTED]
    mark = hashlib.sha256(chosen.tobytes() + f"{family.fingerprint} {seed}".encode())
    path, home = folder / f"{mark.hexdigest()[:24]}.npz", Folder(folder, FitError, "simulated")
    if not os.path.lexists(path):
        found = [simulate_member(family, one, seed + i) for i, one in enumerate(chosen)]
        stood = measures(
            np.array([summarise(cop, RATE) for cop in found if cop is not None]).reshape(-1, len(SUMMARIES))
        )
        with home.seal(path) as part, part.open("wb") as stream:
            np.savez(stream, stood=stood)
    stood = home.read(path, _MOST_BYTES, lambda content: _parse_stood(content, len(chosen)))
    observed = measures(_summaries(person, held=person.held > 0))
    predictive = check_prediction(stood, len(chosen), observed)
    support = posterior.support(trained.people, S)
    return FamilyFit(person, family.name, z, theta, posterior.misfit(S), support, predictive)


def _parse_stood(content: bytes, draws: int) -> Array:
    """Measures of the trials that some draws of a posterior stood, shape (n, m)."""
    stood = read_npz(BytesIO(content), _MOST_BYTES)["stood"]
    shape = (min(len(stood), draws), len(MEASURES))
    if stood.shape != shape or stood.dtype != float or not (np.isfinite(stood).all() and (stood[:, 0] > 0).all()):
        raise ValueError("not the measures of trials")
    return np.asarray(stood)


def simulate_member(family: Family, theta: Array, seed: int) -> Array | None:
    """One trial of one member [m] at 100 Hz; ``None`` if it fell, is unstable, or is no controller."""
    try:
        return family.member(theta).trial(seed)
    except IcmjError:
        return None


def _differences(trained: TrainedFamily, fitted: Sequence[FamilyFit]) -> tuple[Difference, ...]:
    """Between groups, within each condition; and between conditions, within each group."""
    names, told = trained.family.prior.names, trained.calibration.identified
    here = [one for one in fitted if one.family == trained.family.name and not one.misfit.outside]
    found: list[Difference] = []
    for by, within in (("group", "condition"), ("condition", "group")):
        for other in sorted({getattr(one.person, within) for one in here}):
            some = [one for one in here if getattr(one.person, within) == other]
            levels = [getattr(one.person, by) for one in some]
            if len(set(levels)) < 2 or "" in levels:
                continue
            means = np.array([one.z.mean(axis=0) for one in some])
            variances = np.array([one.z.var(axis=0) for one in some])
            people = [one.person.name for one in some]
            suffix = f", {other}" if other else ""
            compared = compare(names, means, variances, levels, people, told)
            found += [replace(one, name=one.name + suffix) for one in compared]
    return tuple(found)
