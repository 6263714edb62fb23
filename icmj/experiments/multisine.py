"""Multi-sine: the response at the excited spectral lines of a periodic stimulus, and the remnant at the others.

A linear loop answers a line with that line. What is left, the *remnant*, is noise, or what a controller that is not
linear, such as an intermittent one, makes of the stimulus. Over P periods of T s the record has lines 1 / (P T) apart;
the stimulus has some of the whole multiples of 1 / T.

The frequency response of a linear closed loop: responses of plant and command to sinusoids at each signal.

Continuous control is linear, delayed or not; so is any controller that reads delayed outputs and has one mode. With a
delay t_d the observer's state is carried ahead over the delay that is assumed, by the model under the commands v that
are on their way (v acts t_d later: u = e^{−jωt_d} v):

    x_p = e^{Â t} x_o + (jω − Â)⁻¹ (I − e^{(Â − jω)t}) B̂ v,      v = −k̂ x_p

which is the limit of a clock that ticks ever faster. Intermittent control has no frequency response: what it makes of
a line depends on the others. Its continuous limit is what it is compared with.

Independent channels of a person on a surface that tilts: their response, and a fit of it.

With the body B = 1/(J s² − m g h), passive stiffness and damping P = K + D₀ s, feedback N = K_p + K_d s after the delay
τ, and the weight W of the angle to the surface beside that to the vertical, the body's angle in space over the tilt is

    (P B + W N B e^{−sτ}) / (1 + P B + N B e^{−sτ})

without force feedback (Peterka 2002; the form is that of his published model).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array, steps_in
from icmj.base.card import Card, WithCard
from icmj.controller.controller import Controller, Law, has_trigger
from icmj.errors import AnalysisError, DataError
from icmj.plant.linear_plant import LinearPlant, Match, match_ports
from icmj.series.even_rows import even_series
from icmj.series.series import Series


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Frequency responses to S signals at F frequencies.

    Attributes:
        frequency: frequencies [Hz], shape (F,).
        signals: ``d.<input>``, added to the command; ``n.<output>``, an error of the reading; ``r.<name>``, set-point.
        x, y, u: responses of plant state, outputs and command, complex, shapes (F, n, S), (F, n_y, S), (F, n_u, S).
        applied: responses of the acting input u + d, shape (F, n_u, S).
    """

    frequency: Array
    signals: tuple[str, ...]
    x: np.ndarray
    y: np.ndarray
    u: np.ndarray
    applied: np.ndarray

    def of(self, signal: str) -> int:
        """Index of a signal.

        Raises:
            AnalysisError: if there is no such signal.
        """
        if signal not in self.signals:
            raise AnalysisError(f"no signal {signal!r} acts on the loop; expected one of {', '.join(self.signals)}")
        return self.signals.index(signal)


def frequency_response(
    plant: LinearPlant, controller: Law, frequency: ArrayLike, *, match: Match = "name"
) -> FrequencyResponse:
    """The frequency response of ``plant`` under ``controller``, whose trigger is replaced by continuous control.

    Args:
        plant: the actual plant.
        controller: a :class:`icmj.Controller`, or another one of a single mode without events.
        frequency: frequencies [Hz], positive, shape (F,).
        match: how inputs and outputs of the plant are assigned to those of the controller's model.

    Raises:
        AnalysisError: if they do not correspond, a frequency is not positive, or the controller is not linear.
    """
    f = np.atleast_1d(np.asarray(frequency, dtype=float))
    if f.ndim != 1 or not (np.isfinite(f).all() and (f > 0).all()):
        raise AnalysisError("frequencies must be positive and finite, as a vector [Hz]")
    plant = match_ports(plant, controller.plant, match)
    law = _respond_observed(controller, f) if has_trigger(controller) else _respond_delayed(controller, f)
    s, n, n_u, n_y = 2j * np.pi * f[:, None, None], plant.n, plant.n_u, plant.n_y
    # u = T (C x + n) + Q r, and x = (s − A)⁻¹ B (u + d)
    T, Q = law
    R = Q.shape[2]
    D = np.concatenate([np.eye(n_u), np.zeros((n_u, n_y + R))], axis=1)
    own = np.concatenate([np.zeros((len(f), n_u, n_u)), T, Q], axis=2)
    x = np.linalg.solve(s * np.eye(n) - plant.A - plant.B @ T @ plant.C, plant.B @ (own + D))
    u = T @ (plant.C @ x) + own
    names = controller.setpoint.names if has_trigger(controller) and controller.setpoint else ()
    signals = (
        *(f"d.{name}" for name in plant.inputs or map(str, range(n_u))),
        *(f"n.{name}" for name in plant.outputs or map(str, range(n_y))),
        *(f"r.{name}" for name in names),
    )
    return FrequencyResponse(f, signals, x, plant.C @ x, u, u + D)


def _respond_observed(controller: Controller, f: Array) -> tuple[np.ndarray, np.ndarray]:
    """Response of the command to readings and set-point, shapes (F, n_u, n_y) and (F, n_u, R)."""
    from scipy.linalg import expm

    design, delay = controller.model[0], controller.delay
    A, B, C, k, L = design.plant.A, design.plant.B, design.plant.C, design.k, design.L
    n, R = len(A), len(A) - controller.plant.n
    s, eye = 2j * np.pi * f[:, None, None], np.eye(n)
    late = np.exp(-s * delay.t_d)
    ahead = expm(A * delay.predicted)
    carried = np.linalg.solve(s * eye - A, (eye - ahead * np.exp(-s * delay.predicted)) @ B)
    # v = −k (ahead x_o + carried v), u = late v
    to_v = np.linalg.solve(np.eye(len(k)) + k @ carried, -k @ ahead)
    # the observer knows u: s x_o = (A − L C) x_o + B u + L y + s r in the last entries
    own = s * eye - (A - L @ C) - B @ (late * to_v)
    moved = np.concatenate([np.zeros((n - R, R)), np.eye(R)])
    return late * to_v @ np.linalg.solve(own, L + 0j * s), late * to_v @ np.linalg.solve(own, s * moved)


def _respond_delayed(controller: Law, f: Array) -> tuple[np.ndarray, np.ndarray]:
    """The same for any controller without events, in its one mode."""
    real = controller.realisation
    if len(real.modes) != 1 or real.eventful or real.commands or real.period < np.inf:
        raise AnalysisError(
            f"the {controller.kind} controller is not linear, or reads its own commands; a frequency response is of "
            "one mode without events and resets"
        )
    on, n_y = real.modes[0], controller.plant.n_y
    s = 2j * np.pi * f[:, None, None]
    v = np.concatenate([np.exp(-s * tau) * np.eye(n_y) for tau in real.taps], axis=1)
    inner = np.linalg.solve(s * np.eye(len(on.M)) - on.M, on.N @ v) if len(on.M) else np.zeros((len(f), 0, n_y))
    return -on.K @ inner - on.S @ v, np.zeros((len(f), controller.plant.n_u, 0), complex)


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
    pair = even_series(pair)
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
    count = steps_in((len(pair) + _SHORT) * step / period) * length
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
