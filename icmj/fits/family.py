"""The family: a controller and a body some of whose numbers are unknown, their prior, and the trials of its members.

Inference knows a member by z alone; each number is a rising function of one of its values
(:class:`icmj.fits.family_file.PriorTable`).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.base.blas_threads import limit_to_one_thread
from icmj.case.case import check_names
from icmj.case.control import controller_of
from icmj.case.plants import actual_plant, assumed_plant, linear_plant
from icmj.case.references import digests
from icmj.controller.controller import expect_intermittent
from icmj.controller.law import Law
from icmj.errors import AnalysisError, FitError, IcmjError
from icmj.fits.family_file import FamilyFile, ParameterTable, load_family_file
from icmj.linear.run import simulate
from icmj.linear.simulator import Simulator
from icmj.plant.linear_plant import LinearPlant, match_ports
from icmj.runfile.schema import RunFile
from icmj.simulation.settings import Settings, reseed
from icmj.simulation.start import start_states
from icmj.theory.delay_roots import count_unstable
from icmj.theory.mode_loops import list_loops
from icmj.work.folder import fingerprint_of

PRESSURE = "pressure.torque."
"""Begins a key that is a weight of the centre of pressure and none of the run file."""


@dataclass(frozen=True, eq=False)
class Prior:
    """The prior of p numbers, independent of each other.

    Attributes:
        parameters: what a family file says of each.
    """

    parameters: tuple[ParameterTable, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(table.name for table in self.parameters)

    @property
    def units(self) -> tuple[str, ...]:
        """Their units."""
        return tuple(table.unit for table in self.parameters)

    @property
    def titles(self) -> tuple[str, ...]:
        """What they are, in words."""
        return tuple(table.title or table.name for table in self.parameters)

    def __len__(self) -> int:
        return len(self.parameters)

    def draw(self, n: int, seed: int = 0, first: int = 0) -> Array:
        """Numbers of ``n`` people, the ``first`` one and those that follow, shape (n, p); each by its number alone."""
        rows = [np.random.default_rng((seed, first + i)).standard_normal(len(self)) for i in range(n)]
        return self.from_normal(np.array(rows).reshape(n, len(self)))

    def to_normal(self, theta: ArrayLike) -> Array:
        """z of numbers, shape (n, p).

        Raises:
            FitError: if one lies where the prior has nothing.
        """
        given = self._given(theta)
        each = zip(self.parameters, given.T, strict=True)
        z = np.column_stack([table.prior.to_normal(column) for table, column in each])
        wrong = np.argwhere(~np.isfinite(z))
        if len(wrong):
            row, column = wrong[0]
            raise FitError(f"{self.names[column]} = {given[row, column]:g} lies outside its prior")
        return z

    def from_normal(self, z: ArrayLike) -> Array:
        """Numbers of z, shape (n, p)."""
        each = zip(self.parameters, self._given(z).T, strict=True)
        return np.column_stack([table.prior.from_normal(column) for table, column in each])

    def _given(self, values: ArrayLike) -> Array:
        given = np.asarray(values, dtype=float)
        if given.ndim != 2 or given.shape[1] != len(self):
            raise FitError(f"numbers of shape {given.shape}; expected (n, {len(self)}): {', '.join(self.names)}")
        return given


RATE = 100.0  # Hz
DURATION = 60.0  # s, of a trial
WARM_UP = 6.0  # s before it, in which what the start has left behind goes
TRIALS = 3
DELAY = "the delay cannot be identified from quiet standing; take an experiment with a stimulus, such as double steps"
_STOOD = ("completed", "sliding")  # one that slides had events as often as it may


@dataclass(frozen=True, eq=False)
class Member:
    """One member of a family, prepared for simulation without a prediction.

    Attributes:
        run: its run file.
        plant: the actual plant.
        law: the controller.
        settings: settings of its trials, including the time before they begin.
        weights: weights of the plant's states in the centre of pressure [m per unit of the state], shape (n,).
    """

    run: RunFile
    plant: LinearPlant
    law: Law
    settings: Settings
    weights: Array

    @property
    def has_one_loop(self) -> bool:
        """Whether it stays in one mode without events, so that a root of its loop decides whether it is stable."""
        real = self.law.realisation
        return not real.eventful and len(real.modes) == 1

    @cached_property
    def unstable(self) -> bool:
        """Whether it has one loop, and this grows: noise lets it fall sooner or later, though a trial may end before.

        An intermittent or a switched member is never called so, as its instability is what makes its cycle; nor is a
        controller of one's own whose loop has no such equations.
        """
        if not self.has_one_loop:
            return False
        try:
            loops = list_loops(self.law, self.plant)
        except AnalysisError:
            return False
        return any(map(count_unstable, loops.values()))

    @limit_to_one_thread()
    def trial(self, seed: int) -> Array | None:
        """The front-to-back centre of pressure of one trial on the linear plant [m] at 100 Hz, forwards positive.

        It equals that of :func:`icmj.simulate` bit for bit; results that are not needed here are not computed.

        Args:
            seed: seed of all noise, together with the seed of each noise.

        Returns:
            The centre of pressure, shape (N,), or ``None`` if the member fell, the run ended early for another
            reason, or the member stood although it is ``unstable``.
        """
        settings = reseed(self.settings, seed)
        if self.law.observed:
            simulator = Simulator(self.plant, expect_intermittent(self.law), settings, settings.record_interval)
            loop = simulator.loop
            found, outcome = simulator.run(loop.state(*start_states(self.plant, self.law, settings)))
            t, x = found.t, loop.x(found.Z)
        else:
            run = simulate(self.plant, self.law, settings)
            t, x, outcome = run.t, run.x, run.outcome
        if outcome.kind not in _STOOD or self.unstable:
            return None
        grid = WARM_UP + np.arange(round((settings.duration - WARM_UP) * RATE)) / RATE
        return np.asarray(x[np.searchsorted(t, grid - 1e-9)] @ self.weights)


@dataclass(frozen=True, eq=False)
class Family:
    """A family of controllers: a run file with some unknown parameters.

    Attributes:
        file: the family file.
        prior: prior of its parameters.
    """

    file: FamilyFile
    prior: Prior

    @property
    def name(self) -> str:
        """Its name."""
        return self.file.family.name

    @property
    def title(self) -> str:
        """Its title in tables and figures."""
        return self.file.family.title or self.name

    @property
    def has_delay(self) -> bool:
        """Whether one of its unknown parameters is a delay."""
        return any(key.rpartition(".")[2] == "delay" for each in self.file.parameter for key in each.keys)

    def run_file(self, theta: ArrayLike) -> RunFile:
        """The run file of one member.

        Args:
            theta: its parameters, shape (p,).

        Raises:
            RunFileError: if a value is not allowed for its key.
        """
        return self.file.base.with_(**self._changes(theta, pressure=False))

    def member(self, theta: ArrayLike, duration: float = DURATION) -> Member:
        """One member, prepared for trials of this duration [s].

        Raises:
            RunFileError, ModelError, DesignError, AnalysisError: if there is no such controller.
            FitError: if the family file lets the centre of pressure depend on something that is not a state.
        """
        run = self.run_file(theta).with_(
            **{"simulation.duration": WARM_UP + duration, "simulation.record_interval": 1 / RATE}
        )
        run = run.resolve()
        assumed = assumed_plant(run)
        actual = actual_plant(run, assumed)
        check_names(run, assumed.linearisation.plant, actual)
        law = controller_of(run, assumed.linearisation.plant)
        settings = run.simulation.settings()
        plant = match_ports(linear_plant(actual, settings), law.plant, "position")
        torque = dict(self.file.pressure.torque)
        for name, value in self._changes(theta, pressure=True).items():
            torque[name] = torque.get(name, 0.0) + value
        unknown = [name for name in torque if name not in plant.states]
        if unknown:
            raise FitError(
                f"{self.file.path}: pressure.torque names {unknown[0]!r}, which is no state; "
                f"there are {', '.join(plant.states)}"
            )
        weights = np.array([-torque.get(name, 0.0) / self.file.pressure.weight for name in plant.states])
        return Member(run, plant, law, settings, weights)

    @cached_property
    def fingerprint(self) -> str:
        """Sixteen hexadecimal digits that depend on all that determines its trials, except versions of software."""
        base = self.file.base
        said: dict[str, Any] = {
            "family": self.file.model_dump(
                exclude={"family": {"title"}, "parameter": {"__all__": {"title", "source"}}}
            ),
            "run": base.model_dump(exclude={"case"}),
            "files": digests(base),
        }
        with suppress(IcmjError):  # of a plant that cannot be, there is no loop
            if self._middle.has_one_loop:
                said["left out"] = "unstable"
        return fingerprint_of(said)

    @cached_property
    def _middle(self) -> Member:
        """The member in the middle of the prior."""
        return self.member(self.prior.from_normal(np.zeros((1, len(self.prior))))[0])

    def _changes(self, theta: ArrayLike, pressure: bool) -> dict[str, Any]:
        """The values that the parameters set, in the run file or in the centre of pressure."""
        given = np.asarray(theta, dtype=float)
        if given.shape != (len(self.prior),) or not np.isfinite(given).all():
            raise FitError(f"{self.name} has {len(self.prior)} numbers ({', '.join(self.prior.names)}), got {given}")
        each = {
            key: factor * value
            for value, table in zip(given.tolist(), self.file.parameter, strict=True)
            for key, factor in table.keys.items()
        }
        if pressure:
            return {key.removeprefix(PRESSURE): value for key, value in each.items() if key.startswith(PRESSURE)}
        return {key: value for key, value in each.items() if not key.startswith(PRESSURE)}


def load_family(path: Path | str, *, allow_code: bool = False) -> Family:
    """Read and validate a family file; the name of a shipped family may be given instead: ``event``, ``clock``, ….

    Args:
        path: the file, or the name.
        allow_code: whether Python code that its run file names may be executed.

    Raises:
        RunFileError: one line that names the file, the line or key, and what was expected.
    """
    file = load_family_file(path, allow_code=allow_code)
    family = Family(file, Prior(tuple(file.parameter)))
    family._middle  # noqa: B018  # what cannot be is told at once
    return family
