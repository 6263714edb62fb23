"""What was observed of a motion: times of events, with or without the outputs there, or an output at many instants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array
from icmj.errors import IdentificationError
from icmj.simulation.simulation import Simulation

FEWEST = 4  # events, or rows, below which nothing can be said


@dataclass(frozen=True, eq=False)
class Observed:
    """A motion as far as it was observed; nothing of what made it.

    Attributes:
        times: of the events [s], rising, shape (K,); empty where only outputs were observed.
        outputs: at the events, shape (K, n_y); (K, 0) where they were not observed.
        t, y: instants [s] and outputs there, shapes (N,) and (N, n_y); empty where only events were observed.
        begin: where the record begins [s]; the first interval is counted from here.
        whole: whether the record begins with the start that the run file describes.
        resolution: to which the times are known [s].
    """

    times: Array
    outputs: Array
    t: Array
    y: Array
    begin: float = 0.0
    whole: bool = False
    resolution: float = 0.0

    @property
    def intervals(self) -> Array:
        """Open-loop intervals [s]: of a whole record all K, from its begin on, else the K − 1 between the events."""
        return np.diff(self.times, prepend=self.begin) if self.whole else np.diff(self.times)

    @property
    def duration(self) -> float:
        """How long was observed [s]."""
        last = max(self.times[-1] if len(self.times) else 0.0, self.t[-1] if len(self.t) else 0.0)
        return float(last - self.begin)

    @classmethod
    def of_simulation(cls, simulation: Simulation) -> Observed:
        """Events of a run and the outputs there, and that it began where its run file says."""
        times = simulation.events.t
        # every event is a row
        rows = np.clip(np.searchsorted(simulation.t, times), 0, len(simulation.t) - 1)
        return cls(times, simulation.y[rows], np.zeros(0), np.zeros((0, 0)), 0.0, True)

    @classmethod
    def of_times(cls, times: Array) -> Observed:
        """Times of events alone [s], from anywhere in a motion.

        Raises:
            IdentificationError: if they do not rise or are not finite.
        """
        times = _rising(times, "event times")
        nothing = np.zeros((len(times), 0))
        return cls(times, nothing, np.zeros(0), np.zeros((0, 0)), float(times[0]), False, _resolution(times))

    @classmethod
    def of_samples(cls, t: Array, y: Array) -> Observed:
        """Outputs at many instants, from anywhere in a motion; shapes (N,) and (N, n_y).

        Raises:
            IdentificationError: if instants do not rise, or something is not finite.
        """
        t, y = _rising(t, "instants"), np.asarray(y, float).reshape(len(t), -1)
        if not np.isfinite(y).all():
            raise IdentificationError("an output is not finite; leave out what was not measured")
        if not np.any(np.ptp(y, axis=0) > 0):
            raise IdentificationError("the outputs do not move")
        return cls(np.zeros(0), np.zeros((0, 0)), t, y, float(t[0]))


def _rising(times: Array, what: str) -> Array:
    times = np.asarray(times, float).ravel()
    if len(times) < FEWEST:
        raise IdentificationError(f"{len(times)} {what}; expected at least {FEWEST}")
    if not np.isfinite(times).all() or np.any(np.diff(times) <= 0):
        raise IdentificationError(f"{what} must rise and be finite")
    return times


def _resolution(times: Array) -> float:
    """The decimal that all times are rounded to [s]; 0 where there are more than nine."""
    for digits in range(9):
        if np.allclose(times, np.round(times, digits), rtol=0, atol=1e-12 * max(1.0, np.abs(times).max())):
            return float(10.0**-digits)
    return 0.0
