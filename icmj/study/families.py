"""Families that were simulated and trained, once for all people; what is finished is found again.

FOLDER/NAME-FINGERPRINT/bank-SEED, check-SEED   simulated people to train on; others to set the width, to calibrate
FOLDER/NAME-FINGERPRINT/flow-*.npz, posterior-*.npz, FOLDER/choice-*.npz   networks
"""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from icmj.base.array import Array
from icmj.errors import FitError
from icmj.fitting.bank import Bank, simulate_bank
from icmj.fitting.calibration import Calibration, calibrate
from icmj.fitting.choice import Choice, train_choice
from icmj.fitting.family import Family
from icmj.fitting.posterior import MEMBERS, Posterior, train_posterior
from icmj.fitting.summaries import SUMMARIES

Tell = Callable[[str, float], None]
SIMULATIONS, CHECK = 6000, 200


@dataclass(frozen=True, eq=False)
class Trained:
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
) -> Trained:
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
        Posterior.mixture(members).rescaled(apart.z[:half], apart.summaries[:half], seed).save(joined, mark)
    posterior = Posterior.load(joined, mark)
    if posterior.names != family.prior.names or posterior.seen.names != SUMMARIES:
        raise FitError(
            f"{joined}: is of other numbers or summaries than the family; remove it, and it is trained again"
        )
    if not 1 <= trials <= posterior.seen.trials:
        raise FitError(f"{trials} trials of a person; a family is trained on 1 to {posterior.seen.trials}")
    drawn = posterior.sample_all(shown[:, :trials], 499, seed)
    calibration = calibrate(truth, drawn, family.prior.names)
    return Trained(family, bank.words, posterior, calibration, shown, stood.z)


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
