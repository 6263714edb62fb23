"""Statistics of a run under noise, which has no exact period and is described by distributions.

Successive values of a motion are not independent, so their scatter says little about the error of their mean. Averages
over blocks much longer than the motion's memory are nearly independent, and theirs does (batch means).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array, between, extent
from icmj.measurement.spectrum import Spectrum, spectrum
from icmj.series.even import evenly
from icmj.simulation.simulation import Simulation

BLOCKS = 10
TRANSIENT = 0.1  # part of the run that is left to the start
FEWEST = 20  # rows below which there is nothing to tell


@dataclass(frozen=True)
class Estimate:
    """A number from a finite run.

    Attributes:
        value: the number.
        error: half the width of its 95 % confidence interval; NaN where the run is too short to tell.
    """

    value: float
    error: float


def mean(values: Array, blocks: int = BLOCKS) -> Estimate:
    """The mean of a sequence, shape (N,)."""
    return Estimate(float(values.mean()), half_width(_averages(values, blocks)))


def deviation(values: Array, blocks: int = BLOCKS) -> Estimate:
    """The standard deviation of a sequence, shape (N,); for a signal its RMS about the mean."""
    squares = (values - values.mean()) ** 2
    size = float(np.sqrt(squares.mean()))
    return Estimate(size, half_width(_averages(squares, blocks)) / (2 * size) if size > 0 else 0.0)


def half_width(averages: Array) -> float:
    """Half the width of the 95 % interval of the mean of independent averages, by Student's t; NaN for fewer than two.

    Args:
        averages: shape (B,).
    """
    from scipy.special import stdtrit

    count = len(averages)
    if count < 2:
        return float("nan")
    return float(stdtrit(count - 1, 0.975) * averages.std(ddof=1) / np.sqrt(count))


def _averages(values: Array, blocks: int) -> Array:
    """Averages over as many blocks of the same length, at least two values each; the first values are left over."""
    count = min(blocks, len(values) // 2)
    length = len(values) // count if count else 0
    return values[len(values) - count * length :].reshape(count, -1).mean(axis=1) if count else np.zeros(0)


@dataclass(frozen=True, eq=False)
class Statistics:
    """Distributions over a run without its first tenth, each number with its 95 % confidence from block averages.

    The confidence is valid for runs much longer than the correlation time of the motion; a block is a tenth of the
    remaining run.

    Attributes:
        start, end: the part of the run that is evaluated [s].
        events: number of events in it.
        interval: mean open-loop interval [s]; ``None`` with fewer than two events.
        interval_deviation: standard deviation of the intervals [s]; ``None`` with fewer than two events.
        least: the minimum interval [s], the larger of Δ_min (the refractory period) and the delay.
        binding: share of the intervals that equal this minimum, for which the minimum and not the threshold determined
            the event.
        edges, counts: histogram of the intervals: edges of its bins [s] and counts, shapes (B + 1,) and (B,); empty
            without intervals.
        mean, rms: mean of every output, and root mean square about that mean; length n_y.
        spectrum: spectrum of every output.
    """

    start: float
    end: float
    events: int
    interval: Estimate | None
    interval_deviation: Estimate | None
    least: float
    binding: Estimate | None
    edges: Array
    counts: Array
    mean: tuple[Estimate, ...]
    rms: tuple[Estimate, ...]
    spectrum: Spectrum

    @property
    def words(self) -> str:
        """The statistics in one sentence."""
        sizes = ", ".join(shown(rms) for rms in self.rms)
        sway = f"RMS of the outputs {sizes}"
        if self.interval is None or self.interval_deviation is None or self.binding is None:
            return f"Driven by noise: {sway}."
        least = f", at the least of {self.least:g} s in {shown(self.binding, 100)} % of them" if self.least > 0 else ""
        return (
            f"Driven by noise: open-loop interval {shown(self.interval)} s on average, "
            f"deviation {shown(self.interval_deviation)} s, over {self.events} events{least}; {sway}."
        )


def statistics(simulation: Simulation) -> Statistics | None:
    """The statistics of a run on either plant; ``None`` if it fell or diverged, or is too short."""
    end = float(simulation.t[-1])
    start = TRANSIENT * end
    rows = between(simulation.t, start)
    if simulation.outcome.kind in ("fell", "diverged") or rows.sum() < FEWEST:
        return None
    t, y = simulation.t[rows], simulation.y[rows]
    _, even = evenly(t, y)
    intervals = simulation.events.interval[between(simulation.events.t, start)]
    several = len(intervals) >= 2
    none = np.zeros(0), np.zeros(0)
    counts, edges = np.histogram(intervals, _bins(intervals), extent(intervals)) if several else none
    at_least = between(intervals, simulation.least, simulation.least)
    return Statistics(
        start=start,
        end=end,
        events=len(intervals),
        interval=mean(intervals) if several else None,
        interval_deviation=deviation(intervals) if several else None,
        least=simulation.least,
        binding=mean(at_least.astype(float)) if several else None,
        edges=np.asarray(edges, float),
        counts=np.asarray(counts, float),
        mean=tuple(mean(column) for column in even.T),
        rms=tuple(deviation(column) for column in even.T),
        spectrum=spectrum(t, y),
    )


def shown(estimate: Estimate, unit: float = 1.0) -> str:
    """``0.52 ± 0.03``; in another unit, times ``unit``."""
    value, error = estimate.value * unit, estimate.error * unit
    return f"{value:.3g}" + (f" ± {error:.2g}" if np.isfinite(error) and error > 0 else "")


def _bins(intervals: Array) -> int:
    """Edges of the bins, whose number follows Rice's rule, at least ten."""
    return max(10, int(np.ceil(2 * len(intervals) ** (1 / 3))))
