"""Quiet standing: measures of sway over trials, intervals between events, and whether distributions have one mode."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from icmj.base.array import Array
from icmj.base.numbers import readable
from icmj.errors import DataError
from icmj.experiments.recording import Recording, keep_complete
from icmj.measurement.measure import Measure, Number
from icmj.measurement.measures import numbers_of
from icmj.measurement.statistics import FEWEST, Modality, modality
from icmj.measurement.sway import sway_numbers

SURE = 0.01  # a p that says so: of flat distributions more than that are as small
YOUNG_PEOPLE: Mapping[str, tuple[float, float]] = {
    "rms": (4.738e-3, 1.61e-3),
    "speed": (7.985e-3, 4.56e-3),
    "frequency.slope": (-1.366, 0.761),
    "frequency.mean": (0.2524, 0.128),
    "short.H": (0.7732, 0.043),
    "long.H": (0.2433, 0.16),
}
"""Mean and standard deviation of measures of the centre of pressure of young people, front to back [m, s].

They are those of 24 trials of 60 s of eight people on firm ground with open eyes, without a filter (Santos and Duarte
2016, doi 10.7717/peerj.2648; see docs/people.md).
"""


@dataclass(frozen=True, eq=False)
class Standing:
    """Quiet standing over K trials; a :class:`icmj.experiments.recording.Finding`.

    Attributes:
        names, units: names and units of the signals.
        measures: measures of each trial by ``<signal>.<measure>``, named as in :func:`icmj.simulate_many`, each of
            shape (K,); NaN of a trial that is too short for it.
        positions: every signal in units of its standard deviation, shape (N, w) for all trials together.
        unimodal: test for one mode of each signal in each trial, K tuples of w tests.
        intervals: open-loop intervals of all trials [s]; empty without events.
        interval_modes: test for one mode of the intervals; ``None`` if there are too few.
        measured: what numbers there are of each signal; by default the standard ones.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    measures: Mapping[str, Array]
    positions: Array
    unimodal: tuple[tuple[Modality, ...], ...]
    intervals: Array
    interval_modes: Modality | None
    measured: tuple[Number, ...] = field(default_factory=numbers_of)

    @property
    def several(self) -> Array:
        """Share of the trials in which each signal has more than one mode, tested at 1 %, shape (w,)."""
        return np.mean([[test.p <= SURE for test in trial] for trial in self.unimodal], axis=0)

    @property
    def numbers(self) -> Mapping[str, float]:
        found = {name: float(_known(values).mean()) for name, values in self._named().items()}
        shares = zip(self.names, self.several, strict=True)
        found |= {f"{name}, share of trials of several modes": float(share) for name, share in shares}
        if len(self.intervals) > 1:
            found["interval, mean (s)"] = float(self.intervals.mean())
            found["interval, deviation (s)"] = float(self.intervals.std(ddof=1))
        if self.interval_modes is not None:
            found["interval, p of one mode"] = self.interval_modes.p
        return found

    @property
    def deviations(self) -> Mapping[str, float]:
        if len(self.unimodal) < 2:
            return {}
        known = {name: _known(values) for name, values in self._named().items()}
        return {name: float(values.std(ddof=1)) if len(values) > 1 else np.nan for name, values in known.items()}

    @property
    def curves(self) -> Mapping[str, Array]:
        tests = np.array([[test.p for test in trial] for trial in self.unimodal])
        found = {"trial": np.arange(len(self.unimodal), dtype=float), **self._named()}
        return found | {f"{name}, p of one mode": p for name, p in zip(self.names, tests.T, strict=True)}

    @property
    def words(self) -> str:
        count = len(self.unimodal)
        said = []
        for name, unit, share in zip(self.names, self.units, self.several, strict=True):
            size = self._size(name, unit)
            modes = "several modes" if count > 1 or share > 0 else "one mode"
            trials = f" in {round(share * count)} of {count} trials" if count > 1 else ""
            said.append(f"{name} has {size}{modes}{trials}")
        if len(self.intervals) > 1:
            modes = ""
            if self.interval_modes is not None:
                modes = f", and have {'several modes' if self.interval_modes.p <= SURE else 'one mode'}"
            said.append(f"intervals last {self.intervals.mean():.3g} s on average{modes}")
        missing = np.array([~np.isfinite(values) for values in self.measures.values()])
        some = missing.any(axis=1) & ~missing.all(axis=1)
        if some.any():
            short = int(missing[some].any(axis=0).sum())
            said.append(f"some measures are of fewer trials, as {short} of {count} are too short for them")
        return f"{'; '.join(said)}."

    def _size(self, name: str, unit: str) -> str:
        """The RMS of a signal, in words; nothing where it was not measured."""
        if (rms := self.measures.get(f"{name}.rms")) is None:
            return ""
        factor, shown = readable(unit)
        spread = f" ± {factor * rms.std(ddof=1):.2g}" if len(rms) > 1 else ""
        return f"an RMS of {factor * rms.mean():.3g}{spread} {shown}, and "

    def _named(self) -> dict[str, Array]:
        """The measures with readable names and units."""
        found = {}
        for name, unit in zip(self.names, self.units, strict=True):
            for number in self.measured:
                mark = f" ({number.unit_of(unit)})" if number.unit else ""
                found[f"{name}, {number.words}{mark}"] = self.measures[f"{name}.{number.key}"]
        return found


def _known(values: Array) -> Array:
    """The values of the trials that have one; one that is NaN where none has."""
    known = values[np.isfinite(values)]
    return known if len(known) else values[:1]


def quiet_standing(
    recordings: Sequence[Recording],
    *,
    low_pass: float | None = None,
    resamples: int = 99,
    measures: Sequence[Measure] = (),
) -> Standing:
    """Measures of sway in every trial, intervals between events, and tests for one mode.

    Args:
        recordings: trials with the same signals and with units; trials in which the person fell are left out.
        low_pass: cut-off frequency of the filter that is applied before all measures [Hz].
        resamples: number of samples for each test for one mode.
        measures: further measures of sway, beside the standard ones.

    Raises:
        DataError: if no trial is left, trials have different signals, units are missing, or a trial cannot be measured.
    """
    kept = keep_complete(recordings)
    first = kept[0].series
    for one in kept:
        if (one.series.names, one.series.units) != (first.names, first.units):
            raise DataError("trials of other signals or units; analyse those of the same signals together")
    for name, unit in zip(first.names, first.units, strict=True):
        if not unit:
            raise DataError(f"{name}: has no unit; give one, as in '{name} [m]'")
    measured = [sway_numbers(one.series, low_pass, measures) for one in kept]
    by_name = {name: np.array([float(each[name]) for each in measured]) for name in measured[0]}
    tests = tuple(
        tuple(modality(column, signal=True, resamples=resamples, seed=i) for column in one.series.values.T)
        for i, one in enumerate(kept)
    )
    whole = [one.series.values - one.series.values.mean(axis=0) for one in kept]
    intervals = np.concatenate([np.diff(one.events) for one in kept])
    varied = len(intervals) >= FEWEST and np.ptp(intervals) > 1e-6 * intervals.mean()
    return Standing(
        first.names,
        first.units,
        by_name,
        np.concatenate([values / values.std(axis=0) for values in whole]),
        tests,
        intervals,
        modality(intervals, resamples=resamples) if varied else None,
        numbers_of("coordinate", measures),
    )
