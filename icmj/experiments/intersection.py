"""The intersection point of ground reaction forces: how high their lines of action meet, frequency by frequency.

The force on a standing person leans by θ_F = −F_x / F_z and starts at the centre of pressure p. Where p moves by dp
while θ_F turns by dθ, the lines cross at the height z = dp / dθ. In a band of frequencies it is read from the real part
of the 2 × 2 cross-spectrum of (θ_F, p): with its dominant eigenvector v, z = v_p / v_θ; the share of the larger
eigenvalue in their sum says how much of the variance that one line tells (Boehm et al. 2019 in bands of 0.2 Hz;
Shiozawa et al. 2021 and Sugimoto-Dimitrova et al. 2024 with windows as here).

A rigid body that turns about the ankles has z = g/ω² + I/(m h), whatever controls it: θ_F and p are both made of its
one angle. With several joints z tells of the controller.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array, is_between
from icmj.base.card import Card, WithCard
from icmj.errors import AnalysisError, DataError
from icmj.measurement.statistics import cut_windows
from icmj.series.even_rows import resample_series
from icmj.series.series import Series
from icmj.series.units import convert_to_si

WINDOW = 5.12  # s: 512 samples at 100 Hz
PADDED = 2  # lengths of a window that its transform has, filled with zeros


@dataclass(frozen=True, eq=False, repr=False)
class IntersectionPoint(WithCard):
    """The intersection point over frequency.

    Attributes:
        frequency: frequencies [Hz], increasing, greater than 0, shape (F,).
        z: height above the ground [m], shape (F,); infinite where the force keeps its direction.
        share: share of the variance along the dominant eigenvector, 0.5–1, shape (F,).
        windows: number of windows that were averaged; 0 for a theoretical curve.
        height: height of the centre of mass [m], or ``None``.
    """

    frequency: Array
    z: Array
    share: Array
    windows: int = 0
    height: float | None = None

    @property
    def ratio(self) -> Array:
        """z divided by the height of the centre of mass, shape (F,).

        Raises:
            DataError: if the height is unknown.
        """
        if self.height is None:
            raise DataError("the height of the centre of mass is not known; give it: 0.56 of the body's height")
        return self.z / self.height

    def crossing(self) -> float:
        """The lowest frequency at which z falls to the height of the centre of mass [Hz]; NaN if it does not.

        Raises:
            DataError: if this height is unknown.
        """
        ratio = self.ratio
        below = np.flatnonzero((ratio[1:] <= 1) & (ratio[:-1] > 1))
        if not len(below):
            return float("nan")
        i = int(below[0])
        return float(np.interp(1.0, ratio[[i + 1, i]], self.frequency[[i + 1, i]]))

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        f, of = self.frequency, "" if self.height is None else " of the centre of mass's height"
        shown = self.z if self.height is None else self.ratio
        rows = tuple(
            (f"{at:g} Hz", f"{np.interp(at, f, shown):.3f}{of or ' m'}")
            for at in (0.5, 1, 2, 4, 7)
            if is_between(at, f[0], f[-1])
        )
        source = f"{self.windows} windows" if self.windows else "theory"
        return Card(f"intersection point from {f[0]:.3g} to {f[-1]:.3g} Hz, {source}", rows)


def intersection_point(
    series: Series,
    angle: str = "force_angle",
    cop: str = "cop",
    *,
    height: float | None = None,
    window: float = WINDOW,
    band: tuple[float, float] = (0.4, 8.0),
) -> IntersectionPoint:
    """The intersection point, from a recorded or simulated force and centre of pressure.

    Windows overlap by half, or by so much more that the last ends with the record. Each is detrended by a straight
    line, weighted by Hann's window and padded with zeros to twice its length. At 100 Hz they are the 512 samples of
    Sugimoto-Dimitrova et al.

    Args:
        series: a series that contains both signals, with their units.
        angle: name of the signal θ_F = −F_x / F_z [rad, deg]; see :func:`force_angle`.
        cop: name of the centre of pressure along the same axis [m, cm, mm].
        height: height of the centre of mass [m].
        window: length of a window [s].
        band: lowest and highest frequency of the result [Hz]. Below about 2 / window, leakage from neighbouring
            frequencies dominates the result.

    Raises:
        DataError: if there is no such signal, its unit is unknown, values are missing, the record is shorter than a
            window, or the signals are constant.
    """
    pair = resample_series(series.chosen([angle, cop]))
    theta, p = convert_to_si(pair, "angle", "length").values.T
    step = float(pair.t[-1] - pair.t[0]) / (len(pair) - 1)
    length = round(window / step)
    if not (np.isfinite(window) and length >= 16):
        raise DataError(f"a window of {window:g} s has {length} rows of {step:g} s; expected at least 16")
    if len(pair) < length:
        raise DataError(f"{len(pair) * step:.4g} s of record for windows of {window:g} s; expected at least one window")
    frequency, S, windows = _cross_spectrum(np.stack([theta, p], axis=1), step, length)
    kept = is_between(frequency, *band) & (frequency > 0)
    if not kept.any():
        raise DataError(f"no line of the spectrum from {band[0]:g} to {band[1]:g} Hz; widen the band")
    if not (np.ptp(theta) > 0 and np.ptp(p) > 0):
        raise DataError(f"{angle} or {cop} does not move; expected a swaying body")
    return _locate(frequency[kept], S[kept], windows, height)


def intersection_curve(
    frequency: ArrayLike, response: ArrayLike, noise: ArrayLike, height: float | None = None
) -> IntersectionPoint:
    """The intersection point of a linear loop that is driven by white noise, from its frequency response.

    Args:
        frequency: frequencies [Hz], positive, shape (F,).
        response: response of θ_F [rad] and p [m] to each noise, shape (F, 2, S), computed for example with
            :func:`icmj.experiments.frequency_response`.
        noise: covariance matrix of the noises, or only their intensities, shape (S, S) or (S,).
        height: height of the centre of mass [m].

    Raises:
        AnalysisError: if shapes do not fit.
    """
    f, H, W = np.asarray(frequency, float), np.asarray(response), np.asarray(noise, float)
    W = np.diag(W) if W.ndim == 1 else W
    if f.ndim != 1 or H.shape[:2] != (len(f), 2) or H.ndim != 3 or W.shape != (H.shape[2],) * 2 or not (f > 0).all():
        raise AnalysisError(
            f"frequencies {f.shape}, response {H.shape}, noise {W.shape} do not fit; expected (F,), (F, 2, S), (S, S)"
        )
    return _locate(f, (H @ W @ H.conj().transpose(0, 2, 1)).real, 0, height)


def force_angle(series: Series, horizontal: str, vertical: str) -> Series:
    """The series with θ_F = −F_x / F_z as an additional signal ``force_angle`` [rad].

    Args:
        series: a series that contains the force of the ground on the body.
        horizontal, vertical: names of its components, in the same unit; the vertical one is positive upwards.

    Raises:
        DataError: if there is no such signal, units are not those of forces, or the vertical force is not positive.
    """
    pair = series.chosen([horizontal, vertical])
    x, z = convert_to_si(pair, "force", "force").values.T
    if not (z[np.isfinite(z)] > 0).all():
        raise DataError(f"{vertical}: is not positive throughout; expected the ground's upward force on the body")
    return Series(
        series.t,
        np.column_stack([series.values, -x / z]),
        (*series.names, "force_angle"),
        (*series.units, "rad"),
        series.facts,
    )


def average(points: list[IntersectionPoint]) -> tuple[IntersectionPoint, Array]:
    """The mean over trials, and the standard deviation of z over them [m], shape (F,); NaN for one trial."""
    z = np.array([point.z for point in points])
    first, share = points[0], np.mean([point.share for point in points], axis=0)
    mean = IntersectionPoint(first.frequency, z.mean(axis=0), share, sum(p.windows for p in points), first.height)
    return mean, z.std(axis=0, ddof=1) if len(points) > 1 else np.full(z.shape[1], np.nan)


def _cross_spectrum(values: Array, step: float, length: int) -> tuple[Array, Array, int]:
    """Frequencies, real part of the cross-spectrum (F, 2, 2), and how many windows it is of."""
    parts = cut_windows(values, length, "linear")
    Y = np.fft.rfft(parts, PADDED * length, axis=1)
    S = np.einsum("wfi,wfj->fij", Y, Y.conj()).real / len(parts)
    return np.asarray(np.fft.rfftfreq(PADDED * length, step), float), np.asarray(S, float), len(parts)


def _locate(frequency: Array, S: Array, windows: int, height: float | None) -> IntersectionPoint:
    """The result from the real cross-spectrum, shape (F, 2, 2), in rad and m."""
    # θ and p are of like size in these units, and so are their errors: the eigenvector is of the units, as published
    values, vectors = np.linalg.eigh(S)
    with np.errstate(divide="ignore", invalid="ignore"):
        z, share = vectors[:, 1, 1] / vectors[:, 0, 1], values[:, 1] / values.sum(axis=1)
    return IntersectionPoint(frequency, z, share, windows, height)
