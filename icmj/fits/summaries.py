"""Summaries of one trial: what inference sees of a front-to-back centre of pressure, recorded or simulated.

The first six are measures of sway as :func:`icmj.measure_sway` defines them (docs/measures.md). The others are the
field's (Tietäväinen et al. 2017, Suzuki et al. 2020), of the centre of mass that belongs to the centre of pressure,
which is what ω₀²/(ω₀² + ω²) leaves of it, below 10 Hz, without its linear trend. They are the sizes of its position,
velocity and acceleration, the shares of |x|, |x'| and |x''| in bins up to three deviations, and the power at log-spaced
frequencies. Positive ones are taken as logarithms.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array, count_steps, is_between
from icmj.errors import FitError
from icmj.measurement import sway
from icmj.series.series import Series

_SIX = {
    "rms": "rms", "speed": "speed", "slope": "frequency.slope", "H short": "short.H", "H long": "long.H",
    "mean frequency": "frequency.mean",
}  # fmt: skip
MEASURES = tuple(_SIX)
"""The six measures of sway; units ``MEASURE_UNITS``."""
MEASURE_UNITS = ("m", "m/s", "", "", "", "Hz")
LEAST = 30.0  # s
_LOGS = np.array([True, True, False, False, False, True])
_OMEGA = 2.9  # rad/s, of a standing adult as an inverted pendulum: √(mgh/J)
_LOW_PASS = 10.0  # Hz
_BINS, _REACH = 8, 3.0  # bins of a histogram, and where they end, in deviations
_LINES = np.geomspace(0.1, 1.5, 10)  # Hz
_FLOOR = 1e-12
_SLOPES, _H = 12.0, 2.0  # what a slope and an H are cut at

SUMMARIES = (
    *(f"log {name}" if log else name for name, log in zip(MEASURES, _LOGS, strict=True)),
    *(f"log size of {what}" for what in ("x", "x'", "x''")),
    *(f"share of |{what}| in bin {i + 1}" for what in ("x", "x'", "x''") for i in range(_BINS)),
    *(f"log power at {f:.3g} Hz" for f in _LINES),
)
"""Names of the summaries, in their order."""


def summarise(cop: ArrayLike, rate: float = 100.0) -> Array:
    """The summaries of one trial.

    Args:
        cop: front-to-back centre of pressure [m], shape (N,), for at least 30 s.
        rate: samples per second [Hz].

    Returns:
        shape (s,), finite; named by ``SUMMARIES``.

    Raises:
        FitError: if it is too short, has values that are not finite, or does not move.
    """
    x = np.asarray(cop, dtype=float)
    if x.ndim != 1 or len(x) < count_steps(LEAST * rate):
        raise FitError(f"a trial of shape {x.shape} at {rate:g} Hz; expected at least {LEAST:g} s of one coordinate")
    if not np.isfinite(x).all():
        raise FitError("a trial contains values that are not finite")
    if not np.ptp(x) > 1e-9:
        raise FitError("a trial without any sway")
    return np.concatenate([_scale(_measures(x, rate)), _field(x, rate)])


def measures(summaries: ArrayLike) -> Array:
    """The six measures of sway in summaries, shape (..., 6): m, m/s, –, –, –, Hz."""
    six = np.asarray(summaries, dtype=float)[..., : len(MEASURES)]
    return np.where(_LOGS, np.exp(np.where(_LOGS, six, 0.0)), six)


def _measures(x: Array, rate: float) -> Array:
    series = Series(np.arange(len(x)) / rate, x[:, None], ("cop",), ("m",))
    found = {number.key: value for number, value in sway.measure_sway(series).coordinates[0].numbers.items()}
    if missing := [key for key in _SIX.values() if key not in found]:
        raise FitError(f"a fit is of {', '.join(_SIX.values())}, and there is no measure {', '.join(missing)}")
    return np.array([found[key] for key in _SIX.values()])


def _scale(six: Array) -> Array:
    six = np.nan_to_num(six)
    cut = np.clip(six, [-np.inf, -np.inf, -_SLOPES, -_H, -_H, -np.inf], [np.inf, np.inf, _SLOPES, _H, _H, np.inf])
    return np.where(_LOGS, np.log(np.maximum(cut, _FLOOR)), cut)


def _field(x: Array, rate: float) -> Array:
    """The field's, of the centre of mass."""
    from scipy.fft import irfft, rfft, rfftfreq
    from scipy.signal import detrend

    N = len(x)
    edge = count_steps(rate)  # mirrored at both ends, where a jump would ring through velocity and acceleration
    straight = detrend(x)
    longer = np.concatenate(
        [2 * straight[0] - straight[edge:0:-1], straight, 2 * straight[-1] - straight[-2 : -edge - 2 : -1]]
    )
    omega = 2 * np.pi * rfftfreq(len(longer), 1 / rate)
    com = rfft(longer) * (_OMEGA**2 / (_OMEGA**2 + omega**2)) / np.sqrt(1 + (omega / (2 * np.pi * _LOW_PASS)) ** 8)
    motions = [irfft(com * (1j * omega) ** order, len(longer))[edge : edge + N] for order in range(3)]
    sizes = [float(motion.std()) for motion in motions]
    shares = []
    for motion, size in zip(motions, sizes, strict=True):
        reach = _REACH * max(size, _FLOOR)
        bins = np.minimum((np.abs(motion - motion.mean()) * (_BINS / reach)).astype(int), _BINS - 1)
        shares.append(np.bincount(bins, minlength=_BINS) / N)
    window = np.hanning(N)
    power = np.abs(rfft(motions[0] * window)) ** 2 / (rate * (window @ window))
    f = rfftfreq(N, 1 / rate)
    ratio = np.sqrt(_LINES[1] / _LINES[0])
    lines = [power[is_between(f, line / ratio, line * ratio)].mean() for line in _LINES]
    return np.concatenate([np.log(np.maximum(sizes, _FLOOR)), *shares, np.log(np.maximum(lines, _FLOOR**2))])
