"""A branch of cycles along a parameter, with what happens on it: data, complete and reloadable."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.cycle.return_map import PlantKind
from icmj.runfile.schema import RunFile

Kind = Literal[
    "fold", "flip", "symmetry breaking", "Neimark–Sacker", "branch point", "grazing", "least interval", "homoclinic",
    "fall", "end",
]  # fmt: skip
KINDS: tuple[Kind, ...] = get_args(Kind)


@dataclass(frozen=True, eq=False)
class SpecialPoint:
    """Where something happens on a branch.

    Attributes:
        kind: ``fold``: the branch turns; ``flip``: a cycle of twice the intervals is born; ``symmetry breaking``: the
            same of a mirrored cycle, whose halves become unlike; ``Neimark–Sacker``: a pair of multipliers crosses the
            circle; ``branch point``: two branches meet; ``grazing``: the event function touches zero before the event,
            or the event itself is a touch; ``least interval``: one falls to Δ_min or the delay; ``homoclinic``: one
            grows without bound; ``fall``: a position reaches its limit; ``end``: it ends for another reason.
        value: of the parameter, to 1e-6 or better.
        index: of the branch's point before it.
        state: z at an event there, shape (N,); of ``homoclinic`` and ``grazing`` at the last cycle before it.
        intervals: there [s], shape (p,).
        y_peak: largest magnitude of every output over the period, shape (n_y,).
        multiplier: the one that crosses the circle; NaN where none does.
        words: one sentence for people.
    """

    kind: Kind
    value: float
    index: int
    state: Array
    intervals: Array
    y_peak: Array
    multiplier: complex
    words: str


@dataclass(frozen=True, eq=False)
class Branch:
    """Cycles of one run file along one parameter.

    Attributes:
        run: the run file.
        parameter: its name.
        plant: ``linear`` or ``mujoco``.
        mirrored: whether the second half of each is the first with opposite sign.
        value: of the parameter at each of M cycles, shape (M,).
        intervals: over the period, or its first half [s]; shape (M, p).
        states: z at the events, departures from the operating point, shape (M, p, N).
        scale: of z, at the first, shape (N,).
        y_peak, y_range: of the outputs over the period, shape (M, n_y).
        multipliers: of P^p, by falling magnitude, shape (M, N).
        closure: shape (M,).
        graze: highest inner maximum of the event function over the threshold squared, shape (M,).
        neutral: how many multipliers are ±1 by construction.
        t: times of each cycle's course from its first event on [s], K of them in each interval; shape (M, p K).
        x, y, u: its states, outputs and commands, shapes (M, p K, ...).
        qpos: MuJoCo's positions, shape (M, p K, nq); (M, p K, 0) on the linear plant.
        outputs, inputs, names, units: of outputs, inputs, plant states; units of the outputs.
        specials: in the order of the branch.
        end: why it ends, one sentence.
    """

    run: RunFile
    parameter: str
    plant: PlantKind
    mirrored: bool
    value: Array
    intervals: Array
    states: Array
    scale: Array
    y_peak: Array
    y_range: Array
    multipliers: NDArray[np.complex128]
    closure: Array
    graze: Array
    neutral: int
    t: Array
    x: Array
    y: Array
    u: Array
    qpos: Array
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    specials: tuple[SpecialPoint, ...]
    end: str

    def __len__(self) -> int:
        return len(self.value)

    @property
    def sign(self) -> int:
        """−1 for mirrored cycles, else +1."""
        return -1 if self.mirrored else 1

    @property
    def events(self) -> int:
        """Per period."""
        return self.intervals.shape[1] * (2 if self.mirrored else 1)

    @property
    def period(self) -> Array:
        """[s], shape (M,)."""
        return np.asarray(self.intervals.sum(axis=1) * (2 if self.mirrored else 1))

    @property
    def interval(self) -> Array:
        """Mean open-loop interval [s], shape (M,)."""
        return np.asarray(self.intervals.mean(axis=1))

    @property
    def largest(self) -> Array:
        """Largest magnitude among the multipliers that are not neutral, shape (M,)."""
        gap = np.abs(self.multipliers - self.sign)
        kept = np.argsort(gap, axis=1)[:, self.neutral :]
        return np.asarray(np.abs(np.take_along_axis(self.multipliers, kept, axis=1)).max(axis=1, initial=0.0))

    @property
    def attracting(self) -> NDArray[np.bool_]:
        """Shape (M,)."""
        return np.asarray(self.largest < 1)

    @property
    def name(self) -> str:
        """Such as ``mirrored period-2 cycles``."""
        return f"{'mirrored ' if self.mirrored else ''}period-{self.events} cycles"
