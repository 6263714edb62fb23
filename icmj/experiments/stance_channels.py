"""Independent channels of a person on a surface that tilts: their response, and a fit of it.

With the body B = 1/(J s² − m g h), passive stiffness and damping P = K + D₀ s, feedback N = K_p + K_d s after the delay
τ, and the weight W of the angle to the surface beside that to the vertical, the body's angle in space over the tilt is

    (P B + W N B e^{−sτ}) / (1 + P B + N B e^{−sτ})

without force feedback (Peterka 2002; the form is that of his published model).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.errors import DataError

_STARTS = ((1.3, 0.35, 0.12, 0.5), (1.3, 0.35, 0.2, 0.9), (1.1, 0.5, 0.08, 0.2))  # of K_p/mgh, K_d/K_p, τ, W


CHANNEL_NUMBERS = ("P", "D", "delay", "weight of the surface")
_ENDS = np.array([1e-2, 1e-3, 0.0, -0.5]), np.array([20.0, 5.0, 0.6, 1.5])  # of K_p/mgh, K_d/K_p [s], τ [s], W
_LOGS = np.array([True, True, False, False])  # of which are sought on a logarithmic scale
_AT_END = 1e-3  # of a range, which is at its end; fits leave bounds that they would cross by far less


@dataclass(frozen=True)
class StanceChannels:
    """A one-link person with independent sensory channels.

    Attributes:
        inertia: moment of inertia J about the ankle [kg m²].
        toppling: toppling stiffness m g h [N m/rad].
        stiffness, damping: passive stiffness K [N m/rad] and damping D₀ [N m s/rad].
        P, D: feedback gains K_p [N m/rad] and K_d [N m s/rad].
        delay: delay τ of the feedback [s].
        weight: weight W of the angle to the surface and its rate; the angle to the vertical and its rate have the
            weight 1 − W.
        half_widths: half the widths of the 95 % confidence intervals of P, D, delay and weight, shape (4,), from a fit;
            ``None`` otherwise.
        doubts: of a fit, which numbers are at an end of the range sought, or have an interval that is wider than it.
    """

    inertia: float
    toppling: float
    stiffness: float = 0.0
    damping: float = 0.0
    P: float = 0.0
    D: float = 0.0
    delay: float = 0.0
    weight: float = 1.0
    half_widths: Array | None = field(default=None, compare=False)
    doubts: tuple[str, ...] = field(default=(), compare=False)

    def response(self, frequency: ArrayLike) -> np.ndarray:
        """Response of the angle of the body in space to that of the surface at frequencies [Hz], complex."""
        s = 2j * np.pi * np.asarray(frequency, dtype=float)
        body, passive = 1 / (self.inertia * s**2 - self.toppling), self.stiffness + self.damping * s
        active = (self.P + self.D * s) * np.exp(-s * self.delay)
        return np.asarray((passive + self.weight * active) * body / (1 + (passive + active) * body))


def fit_channels(body: StanceChannels, frequency: ArrayLike, response: ArrayLike, radius: ArrayLike) -> StanceChannels:
    """Fit P, D, delay and weight of a body to a measured response.

    Args:
        body: the body, with inertia, toppling stiffness, passive stiffness and damping.
        frequency: lines [Hz], shape (L,).
        response: measured response, complex, shape (L,).
        radius: radius of confidence of each response, which determines its weight, shape (L,); weights are equal if it
            is zero or unknown.

    Returns:
        The fitted body, with half the widths of the 95 % confidence intervals. They follow from the scatter of the
        residuals at the lines, whatever their sizes are (a sandwich estimate with leverages: MacKinnon and White 1985).

    Raises:
        DataError: if there are fewer than three lines, or shapes do not fit.
    """
    from scipy.optimize import least_squares
    from scipy.special import stdtrit

    f, measured, apart = (np.asarray(of) for of in (frequency, response, radius))
    if f.ndim != 1 or len(f) < 3 or measured.shape != f.shape or apart.shape != f.shape:
        raise DataError(f"a fit of channels needs a response at three lines or more; got {len(np.atleast_1d(f))}")
    known = np.isfinite(apart) & (apart > 0)
    floor = 1e-3 * np.abs(measured)  # a line without noise does not decide alone
    weight = 1 / np.maximum(np.where(known, apart, floor), floor)

    def of(numbers: Array) -> StanceChannels:
        p, d, delay, share = numbers
        P = float(np.exp(p)) * body.toppling
        return replace(body, P=P, D=float(np.exp(d)) * P, delay=float(delay), weight=float(share))

    def left(numbers: Array) -> Array:
        difference = (of(numbers).response(f) - measured) * weight
        return np.concatenate([difference.real, difference.imag])

    bounds = tuple(np.where(_LOGS, np.log(np.where(_LOGS, end, 1.0)), end) for end in _ENDS)
    starts = [np.array([np.log(p), np.log(d), delay, share]) for p, d, delay, share in _STARTS]
    exact: dict[str, Any] = {"xtol": 1e-14, "ftol": 1e-14, "gtol": 1e-14, "x_scale": [0.3, 0.3, 0.05, 0.2]}
    found = [least_squares(left, start, bounds=bounds, **exact) for start in starts]
    best = min(found, key=lambda fit: float(fit.cost))
    fitted, J, residual = of(best.x), np.asarray(best.jac), np.asarray(best.fun)
    inverse = np.linalg.pinv(J.T @ J)
    leverage = np.einsum("ij,jk,ik->i", J, inverse, J)
    scaled = J * (residual / np.maximum(1 - leverage, 1e-3))[:, None]
    covariance = inverse @ (scaled.T @ scaled) @ inverse
    # P is exp(p) and D is exp(d) P, up to constants
    slopes = np.array([[fitted.P, 0, 0, 0], [fitted.D, fitted.D, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    deviation = np.sqrt(np.maximum(np.diag(slopes @ covariance @ slopes.T), 0.0))
    half = stdtrit(len(residual) - 4, 0.975) * deviation
    near = np.minimum(best.x - bounds[0], bounds[1] - best.x) < _AT_END * (bounds[1] - bounds[0])
    return replace(fitted, half_widths=half, doubts=_doubt(near, half, body.toppling, fitted.P))


def _doubt(near: np.ndarray, half: Array, toppling: float, P: float) -> tuple[str, ...]:
    """What of a fit is at an end of its range, or as uncertain as before."""
    said = []
    if near.any():
        said.append(f"{_join(near)} {'is' if near.sum() == 1 else 'are'} at an end of the range sought")
    units = np.array([toppling, P, 1.0, 1.0])
    wide = ~(2 * half <= (_ENDS[1] - _ENDS[0]) * units)  # an open interval, too
    if wide.any():
        said.append(f"the interval of {_join(wide)} is as wide as the range sought, or wider")
    return tuple(said)


def _join(which: np.ndarray) -> str:
    return " and ".join(name for name, one in zip(CHANNEL_NUMBERS, which, strict=True) if one)
