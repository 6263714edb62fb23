"""The ellipse that holds a further point of a sway in a plane with a probability of 95 %."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from icmj.base.array import Array
from icmj.measurement.measure import Definition, Number, Signal, define_measure

LEVEL = 0.95


@dataclass(frozen=True, eq=False)
class Ellipse:
    """The prediction ellipse of points in a plane: a further point lies in it with probability ``level``.

    Not to be confused with the confidence ellipse of the mean, which shrinks as the record grows.

    Attributes:
        centre: mean, shape (2,).
        axes: half lengths of the axes, the longer first, shape (2,) [unit].
        angle: of the longer axis from the first coordinate, in (−π/2, π/2] [rad].
        level: probability.
    """

    centre: Array
    axes: Array
    angle: float
    level: float = LEVEL

    @property
    def area(self) -> float:
        """π a b [unit²]."""
        return float(np.pi * self.axes.prod())

    def facts(self) -> Mapping[str, Any]:
        """What records hold of it."""
        return {**vars(self), "area": self.area}

    def outline(self, points: int = 181) -> Array:
        """The ellipse as a closed curve, shape (points, 2)."""
        turn = np.linspace(0, 2 * np.pi, points)
        along = np.array([np.cos(self.angle), np.sin(self.angle)])
        across = np.array([-along[1], along[0]])
        return (
            self.centre + np.outer(self.axes[0] * np.cos(turn), along) + np.outer(self.axes[1] * np.sin(turn), across)
        )


def prediction_ellipse(points: Array, level: float = LEVEL) -> Ellipse:
    """The prediction ellipse of normally distributed points, with the exact factor for their number.

    They are taken as independent: of a record that is not much longer than the memory of its motion, fewer further
    points lie in it.

    The squared half axes are the eigenvalues of the covariance times 2(N+1)(N−1)/(N(N−2)) F(2, N−2) (Chew 1966,
    J Am Stat Assoc 61:605-617). The factor tends to the quantile of χ² with two degrees of freedom, which
    the code of Schubert & Kirchner (2014, Gait Posture 39:518-522) takes: 0.08 % less at N = 6000.

    Args:
        points: shape (N, 2), N > 2.
        level: probability.
    """
    from scipy.special import fdtri

    N = len(points)
    factor = 2 * (N + 1) * (N - 1) / (N * (N - 2)) * fdtri(2, N - 2, level)
    variances, directions = np.linalg.eigh(np.cov(points.T))
    along = directions[:, 1]
    angle = float(np.arctan2(along[1], along[0]))
    angle = angle - np.pi if angle > np.pi / 2 else angle + np.pi if angle <= -np.pi / 2 else angle
    return Ellipse(points.mean(axis=0), np.sqrt(factor * np.maximum(variances[::-1], 0)), angle, level)


@define_measure(
    "ellipse", of=["plane"], standard=True,
    numbers=[
        Number("ellipse.area", "95 % prediction ellipse, area", "U²", "area"),
        Number("ellipse.major", "ellipse, longer half axis", "U", "axes.0"),
        Number("ellipse.minor", "ellipse, shorter half axis", "U", "axes.1"),
        Number("ellipse.angle", "ellipse, angle", "rad", "angle"),
    ],
    definitions=[Definition(
        "95 % prediction ellipse",
        r"area $\pi\,\frac{2(N+1)(N-1)}{N(N-2)}F_{0.95;2,N-2}\sqrt{\det\Sigma_x}$ with the covariance matrix "
        r"$\Sigma_x$; also its semi-axes (half axes), and the angle of the longer one to the first coordinate",
        "Chew 1966; see Schubert & Kirchner 2014",
    )],
)  # fmt: skip
def of_signal(signal: Signal) -> Ellipse:
    """95 % prediction ellipse of a plane."""
    return replace(prediction_ellipse(signal.about), centre=signal.mean)


MEASURE = of_signal
