"""Stabilogram diffusion: the mean square displacement of sway against the time lag (Collins & De Luca 1993).

Over short times sway is persistent and moves away from its position; over long times it returns. Both appear as
straight lines in the mean square displacement against time on logarithmic axes, with slope 2H: H = 1/2 is a random
walk, larger values are persistent, smaller ones anti-persistent.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from icmj.base.array import Array, count_steps, is_between
from icmj.measurement.measure import Definition, Number, Signal, define_measure

SHORT = (0.05, 0.5)
LONG = (2.5, 10.0)
"""Windows of the fits [s]. Collins & De Luca chose them by eye, the short one up to about 1 s, the long one to 10 s."""
FEWEST_LAGS = 2.0  # lengths of a lag that a record must have: from fewer, its mean square is no average


@dataclass(frozen=True)
class Regime:
    """A range of lags of the diffusion plot.

    Attributes:
        start, end: first and last lag [s].
        H: scaling exponent, half the slope on logarithmic axes.
        D: diffusion coefficient, half the slope on linear axes [unit²/s].
        offset: value of this line at lag zero [unit²].
    """

    start: float
    end: float
    H: float
    D: float
    offset: float


@dataclass(frozen=True, eq=False)
class Diffusion:
    """The stabilogram-diffusion plot of one coordinate, or of a point in a plane.

    Attributes:
        lag: time differences [s], increasing from one step, shape (M,).
        displacement: mean square displacement [unit²], for a point in a plane the sum over both coordinates, shape
            (M,).
        short, long: the fitted lines; ``None`` if the record is too short or too coarse for a line.
    """

    lag: Array
    displacement: Array
    short: Regime | None
    long: Regime | None

    @property
    def critical(self) -> tuple[float, float] | None:
        """Lag [s] and mean square displacement [unit²] at which the straight lines on linear axes meet, or ``None``."""
        if self.short is None or self.long is None or not self.short.D > self.long.D:
            return None
        lag = (self.long.offset - self.short.offset) / (2 * (self.short.D - self.long.D))
        return (float(lag), float(self.short.offset + 2 * self.short.D * lag)) if lag > 0 else None

    def facts(self) -> Mapping[str, Any]:
        """What records hold of it: the lines, without the curve."""
        return {"short": self.short, "long": self.long, "critical": self.critical}


def diffusion(
    values: Array,
    rate: float,
    *,
    short: tuple[float, float] = SHORT,
    long: tuple[float, float] = LONG,
) -> Diffusion:
    """The stabilogram diffusion of evenly sampled sway.

    ⟨Δx²⟩ at a lag is the mean over all pairs of samples with this time difference; for a plane ⟨Δr²⟩ = ⟨Δx²⟩ + ⟨Δy²⟩.
    The lines are ⟨Δx²⟩ = 2 D Δt + c, and log ⟨Δx²⟩ = 2 H log Δt + c, fitted by least squares to all lags within each
    window.

    Args:
        values: the coordinate, shape (N,), or both coordinates of a plane, shape (N, 2).
        rate: samples per second [Hz].
        short, long: windows of the fits [s].
    """
    N = len(values)
    most = min(count_steps(long[1] * rate), count_steps((N - 1) / FEWEST_LAGS))
    lags = np.arange(1, most + 1)
    displacement = np.zeros(most)
    for column in np.atleast_2d(values.T):
        displacement += _mean_squares(column, most)
    lag = lags / rate
    return Diffusion(lag, displacement, _regime(lag, displacement, short), _regime(lag, displacement, long))


def _mean_squares(values: Array, most: int) -> Array:
    """⟨(x_{i+m} − x_i)²⟩ for m = 1 … ``most``, from the autocorrelation by fast Fourier transforms; shape (most,)."""
    from scipy.fft import irfft, next_fast_len, rfft

    x, N = values - values.mean(), len(values)
    size = next_fast_len(N + most + 1, real=True)
    spectrum = rfft(x, size)
    products = irfft(spectrum * np.conj(spectrum), size)[1 : most + 1]
    lags = np.arange(1, most + 1)
    total = np.concatenate([[0.0], np.cumsum(x**2)])
    squares = (total[-1] - total[lags]) + total[N - lags]
    return np.maximum(squares - 2 * products, 0) / (N - lags)


def _regime(lag: Array, displacement: Array, window: tuple[float, float]) -> Regime | None:
    inside, reaches = is_between(lag, *window), is_between(lag[-1:], window[1]).any()
    if inside.sum() < 3 or not (displacement[inside] > 0).all() or not reaches:
        return None
    t, square = lag[inside], displacement[inside]
    slope, offset = _line(t, square)
    exponent, _ = _line(np.log(t), np.log(square))
    return Regime(window[0], window[1], exponent / 2, slope / 2, offset)


def _line(x: Array, y: Array) -> tuple[float, float]:
    """Slope and offset of the line that fits best."""
    about = x - x.mean()
    slope = float(about @ y / (about @ about))
    return slope, float(y.mean() - slope * x.mean())


@define_measure(
    "diffusion", standard=True,
    numbers=[
        Number("short.H", "H, short times", "", "short.H"),
        Number("short.D", "D, short times", "U²/s", "short.D"),
        Number("long.H", "H, long times", "", "long.H"),
        Number("long.D", "D, long times", "U²/s", "long.D"),
        Number("critical.lag", "critical lag", "s", "critical.0"),
        Number("critical.displacement", "critical displacement", "U²", "critical.1"),
    ],
    definitions=[
        Definition(
            r"$\langle (x_{i+j}-x_i)^2\rangle$",
            r"mean over all pairs, as a function of the lag $j/f_s$; in a plane, the sum over both coordinates",
            "Collins & De Luca 1993",
        ),
        Definition(
            "$H$, short and long times",
            r"half the slope of the logarithm of this mean against $\log(j/f_s)$, from 0.05 to 0.5 s and from 2.5 "
            "to 10 s",
            "Collins & De Luca 1993",
        ),
        Definition(
            "$D$, short and long times",
            r"half the slope of this mean against the lag, in the same windows",
            "Collins & De Luca 1993",
        ),
        Definition(
            "critical lag, critical displacement",
            "the coordinates of the point where the two straight lines that give $D$ intersect",
            "Collins & De Luca 1993",
        ),
    ],
)  # fmt: skip
def of_signal(signal: Signal) -> Diffusion:
    """Stabilogram diffusion, of a plane that of the distance."""
    return diffusion(signal.about, 1 / signal.step)


MEASURE = of_signal
