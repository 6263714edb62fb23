"""A branch of cycles along a parameter, with its special points, as data that can be stored and read again."""

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
    """A bifurcation or an end on a branch.

    Attributes:
        kind: ``fold``: the branch turns back; ``flip``: a cycle with twice as many intervals branches off; ``symmetry
            breaking``: the same for a mirrored cycle, whose halves become different; ``Neimark–Sacker``: a complex
            pair of multipliers crosses the unit circle; ``branch point``: two branches meet; ``grazing``: the event
            function touches zero before the event, or only touches it at the event; ``least interval``: an interval
            decreases to Δ_min or the delay; ``homoclinic``: an interval grows without bound; ``fall``: a position
            reaches its limit; ``end``: the branch ends for another reason.
        value: value of the parameter, to 1e-6 or better.
        index: index of the preceding point of the branch.
        state: z at an event of this cycle, shape (N,); for ``homoclinic`` and ``grazing``, that of the last cycle
            before it.
        intervals: its open-loop intervals [s], shape (p,).
        y_peak: largest magnitude of every output over the period, shape (n_y,).
        multiplier: the multiplier that crosses the unit circle; NaN if none does.
        words: a description in one sentence.
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
        parameter: name of the parameter.
        plant: ``linear`` or ``mujoco``.
        mirrored: whether the second half of each cycle is the first with opposite sign.
        value: value of the parameter at each of M cycles, shape (M,).
        intervals: open-loop intervals over the period, or over its first half if it is mirrored [s]; shape (M, p).
        states: z at the events, deviations from the operating point, shape (M, p, N).
        scale: size of z on the first cycle, shape (N,).
        y_peak, y_range: largest magnitude and peak-to-peak range of the outputs over the period, shape (M, n_y).
        multipliers: multipliers of P^p, by decreasing magnitude, shape (M, N).
        closure: relative closure errors, shape (M,).
        graze: highest inner maximum of the event function over the threshold squared, shape (M,).
        neutral: number of multipliers that are ±1 by construction.
        t: times along each cycle from its first event on [s], K times in each interval; shape (M, p K).
        x, y, u: states, outputs and commands at these times, shapes (M, p K, ...).
        qpos: MuJoCo's positions, shape (M, p K, nq); (M, p K, 0) on the linear plant.
        outputs, inputs, names, units: names of outputs, inputs and plant states; units of the outputs.
        specials: special points, in the order of the branch.
        end: the reason why the branch ends, in one sentence.
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
        """Number of events per period."""
        return self.intervals.shape[1] * (2 if self.mirrored else 1)

    @property
    def period(self) -> Array:
        """Period [s], shape (M,)."""
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
        """Whether each cycle attracts, shape (M,)."""
        return np.asarray(self.largest < 1)

    @property
    def name(self) -> str:
        """A description, such as ``mirrored period-2 cycles``."""
        return f"{'mirrored ' if self.mirrored else ''}period-{self.events} cycles"
