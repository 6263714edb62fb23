"""Multi-sine: the response at the excited spectral lines of a periodic stimulus, and the remnant at the others.

A linear loop answers a line with that line. What is left, the *remnant*, is noise, or what a controller that is not
linear, such as an intermittent one, makes of the stimulus. Over P periods of T s the record has lines 1 / (P T) apart;
the stimulus has some of the whole multiples of 1 / T.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array, count_steps
from icmj.base.card import Card, WithCard
from icmj.errors import DataError
from icmj.series.even_rows import resample_series
from icmj.series.series import Series

FEWEST = 2  # periods: with one nothing tells noise from response
_NONE = 1e-6  # share of a stimulus's power that is none, at one line or off the lines
_OFF = 0.05  # that may lie off the lines of a recorded stimulus, of noise and rounding; the bound is ours
_WHOLE = 1e-3  # of a sample: how far a period may be from a whole number of them without resampling
_SHORT = 0.25  # of a sample that a record may be short of a whole number of periods


@dataclass(frozen=True, eq=False, repr=False)
class Multisine(WithCard):
    """Response and remnant, over all periods of all trials.

    Attributes:
        line: excited lines [Hz], increasing, shape (L,).
        response: response of the signal to the stimulus at these lines, mean over periods, complex [unit of signal per
            unit of stimulus], shape (L,).
        radius: radius of the circle that contains the true response with 95 % confidence, shape (L,).
        coherence: coherence of stimulus and signal over periods, 0–1, shape (L,); for noise alone it is 1/P on average.
        periods: number P of periods.
        frequency: all lines of a record except 0 [Hz], shape (K,).
        power: mean square of the signal at each of these lines, mean over trials [unit²], shape (K,).
        excited: whether the stimulus contains each of these lines, shape (K,), bool.
        stimulus_power: mean square of the stimulus at the excited lines [unit²], shape (L,).
        unit: unit of the response.
        off_lines: share of the stimulus's power that is not at the excited lines. What the signal makes of it counts
            as remnant.
    """

    line: Array
    response: np.ndarray
    radius: Array
    coherence: Array
    periods: int
    frequency: Array
    power: Array
    excited: np.ndarray
    stimulus_power: Array
    unit: str
    off_lines: float = 0.0

    @property
    def remnant(self) -> float:
        """Share of the signal's power at lines that are not excited; NaN for a constant signal."""
        whole = float(self.power.sum())
        return float(self.power[~self.excited].sum()) / whole if whole > 0 else float("nan")

    def explained(self, response: ArrayLike | None = None) -> float:
        """Share of the signal's power that a linear model explains: 1 minus the share of the residual.

        It is negative if the power of the residual exceeds that of the signal.

        Args:
            response: response of the model at the excited lines, shape (L,); if ``None``, the measured response, which
                is that of the best linear model.

        Raises:
            DataError: if the shape does not fit.
        """
        model = self.response if response is None else np.asarray(response)
        if model.shape != self.line.shape:
            raise DataError(
                f"a response of shape {model.shape} at {len(self.line)} lines; expected one number for each"
            )
        # what a model leaves at the lines: what varies about the mean, and the mean's distance from the model
        at_lines = self.power[self.excited]
        told = np.abs(self.response) ** 2 * self.stimulus_power
        left = np.maximum(at_lines - told, 0.0) + np.abs(self.response - model) ** 2 * self.stimulus_power
        whole = float(self.power.sum())
        return 1 - float(left.sum() + self.power[~self.excited].sum()) / whole if whole > 0 else float("nan")

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        rows = tuple(
            (f"{f:.4g} Hz", f"{abs(value):.4g} {self.unit}, {np.degrees(np.angle(value)):.1f}°, coherence {c:.3f}")
            for f, value, c in zip(self.line, self.response, self.coherence, strict=True)
        )
        share = f"remnant {100 * self.remnant:.3g} % of the power"
        return Card(f"multi-sine of {len(self.line)} lines, {self.periods} periods: {share}", rows[:12])


def multisine(
    trials: Series | Sequence[Series], stimulus: str, signal: str, *, period: float, lines: ArrayLike
) -> Multisine:
    """The response of a signal to a periodic stimulus, and its remnant, in one trial or several.

    The last whole periods of each trial are used. For the confidence, periods are assumed to be independent. A record
    whose clock gives a period no whole number of samples is resampled to one.

    Args:
        trials: series that contain both signals, with their units.
        stimulus: name of the stimulus.
        signal: name of the signal that is analysed.
        period: period of the stimulus [s].
        lines: frequencies of the stimulus [Hz], integer multiples of 1 / period.

    Raises:
        DataError: if lines or stimulus are not periodic in the record, periods are too few, units are missing, or
            trials differ in length or rate.
    """
    trials = [trials] if isinstance(trials, Series) else list(trials)
    f = np.atleast_1d(np.asarray(lines, dtype=float))
    cycles = f * period
    if not (len(f) and np.isfinite(cycles).all() and (np.abs(cycles - np.rint(cycles)) < 1e-6).all()):
        raise DataError(f"lines must be whole multiples of 1 / period, {1 / period:g} Hz, to be periodic in the record")
    whole = np.unique(np.rint(cycles).astype(int))
    if whole[0] < 1:
        raise DataError("lines must be greater than 0 Hz")
    both = [_whole_periods(trial.chosen([stimulus, signal]), period) for trial in trials]
    if not both:
        raise DataError("no trial to analyse")
    length, P = both[0][1], len(both[0][0].values) // both[0][1]
    if any((n, len(one.values)) != (length, P * length) for one, n in both):
        raise DataError("trials differ in rate or number of periods; analyse those that agree together")
    if whole[-1] >= length / 2:
        raise DataError(f"a line of {whole[-1] / period:g} Hz is not below half the rate, {length / period / 2:g} Hz")
    ratios, products, powers, of_stimulus, off = [], [], [], [], []
    excited = np.zeros(P * length // 2, dtype=bool)
    excited[P * whole - 1] = True
    for one, _ in both:
        folded = np.fft.rfft(one.values.reshape(P, length, 2), axis=1)[:, whole] / length
        spectrum = _power(one.values)
        off.append(_see_lines(spectrum[:, 0], excited, stimulus, period))
        powers.append(spectrum[:, 1])
        of_stimulus.append(spectrum[excited, 0])
        ratios.append(folded[:, :, 1] / folded[:, :, 0])
        products.append(folded)
    g, c = np.concatenate(ratios), np.concatenate(products)
    units = both[0][0].units
    return Multisine(
        line=whole / period,
        response=g.mean(axis=0),
        radius=_radius(g),
        coherence=_coherence(c),
        periods=len(g),
        frequency=np.arange(1, P * length // 2 + 1) / (P * period),
        power=np.mean(powers, axis=0),
        excited=excited,
        stimulus_power=np.mean(of_stimulus, axis=0),
        unit=f"{units[1]}/({units[0]})" if " " in units[0] else f"{units[1]}/{units[0]}",
        off_lines=float(np.mean(off)),
    )


def _whole_periods(pair: Series, period: float) -> tuple[Series, int]:
    """The last whole periods of a trial, about the mean, and the samples of one."""
    for name, unit in zip(pair.names, pair.units, strict=True):
        if not unit:
            raise DataError(f"{name}: has no unit; give one, as in '{name} [rad]'")
    pair = resample_series(pair)
    step = float(pair.t[-1] - pair.t[0]) / (len(pair) - 1)
    length = round(period / step)
    if length < 4:
        raise DataError(
            f"a period of {period:g} s has {period / step:.3g} samples of {step:.6g} s; expected at least 4"
        )
    if abs(length - period / step) > _WHOLE:
        pair = _fit_samples(pair, period, step, length)
    P = len(pair) // length
    if P < FEWEST:
        raise DataError(f"{P} whole periods of {period:g} s in {len(pair) * step:.4g} s; expected at least {FEWEST}")
    values = pair.values[len(pair) - P * length :]
    return Series(pair.t[: len(values)], values - values.mean(axis=0), pair.names, pair.units), length


def _fit_samples(pair: Series, period: float, step: float, length: int) -> Series:
    """The whole periods up to the end of a record, at even times of which each has so many."""
    from scipy.interpolate import CubicSpline

    # a record that ends a part of a sample too early, as one of another clock does, is continued by this much
    count = count_steps((len(pair) + _SHORT) * step / period) * length
    t = pair.t[-1] + step - period / length * np.arange(count, 0, -1)
    return replace(pair, t=t, values=CubicSpline(pair.t, pair.values)(t))


def _power(values: Array) -> Array:
    """Mean square at every line but 0, shape (N // 2, w)."""
    N = len(values)
    power = 2 * np.abs(np.fft.rfft(values, axis=0)[1:] / N) ** 2
    if N % 2 == 0:
        power[-1] /= 2
    return np.asarray(power[: N // 2], float)


def _see_lines(power: Array, excited: np.ndarray, stimulus: str, period: float) -> float:
    """The share of a stimulus's power off its lines.

    Raises:
        DataError: if there is none at one of them, or more than noise and rounding leave off them.
    """
    whole = float(power.sum())
    if not power[excited].min() > _NONE * whole / max(int(excited.sum()), 1):
        raise DataError(f"{stimulus}: has no power at one of the lines; are period and lines those of the stimulus?")
    if (off := float(power[~excited].sum()) / whole) > _OFF:
        raise DataError(
            f"{stimulus}: {100 * off:.2g} % of its power is off the lines, so that it is not periodic in {period:g} s; "
            "give its period and all its lines"
        )
    return off


def _radius(g: np.ndarray) -> Array:
    """Radius of the 95 % circle about the mean of P independent circular values, by F with 2 and 2P − 2 degrees."""
    from scipy.stats import f

    P = len(g)
    scatter = (np.abs(g - g.mean(axis=0)) ** 2).sum(axis=0) / (P - 1)
    return np.asarray(np.sqrt(f.ppf(0.95, 2, 2 * P - 2) * scatter / P), float)


def _coherence(c: np.ndarray) -> Array:
    """Between stimulus and signal over periods, from their lines, shape (P, L, 2)."""
    u, y = c[:, :, 0], c[:, :, 1]
    whole = (np.abs(u) ** 2).sum(axis=0) * (np.abs(y) ** 2).sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.abs((u.conj() * y).sum(axis=0)) ** 2 / whole, float)
