"""The spread of the intervals about the predicted orbit under small Gaussian noise, without a simulation.

Beside an orbit that attracts the loop is linear, and so is what noise makes of it. With the states z of the noise
appended to the error system, X̄' = Ā_C X̄ + G z and ż = A_z z + white noise, let Φ be the flow from the state at one
event to just before the next and S the covariance that the white noise gathers on the way. An event comes early or late
by δ = h'(X̄ − X̄*) with h = −∇E/(∇E·Ẋ), so that the state there is (I + Ẋ h')(X̄ − X̄*), and with exit, the map to the
state at the event, Π = exit (I + Ẋ h'), J = Π Φ and

    P = J P J' + Π S Π',    var Δ = h'(Φ P Φ' + S) h,    cov(Δ_i, Δ_{i+k}) = λᵏ h'Φ Jᵏ⁻¹ (J P Φ'h + Π S h),

for λ = ±1 the eigenvalue of the orbit, whose halves are mirrored if it is −1.

Noise on a grid, linear between its points, is stationary once its grid has no phase to the events. Its spectral
density is that of the sequence times sinc⁴, and its inverse is a power series in ω² with positive coefficients. Every
truncation is therefore a spectral density, that of as many noise states as it has powers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import factorial

import numpy as np
from scipy.linalg import block_diag, expm

from icmj.base.array import Array, real
from icmj.base.blas_threads import limit_to_one_thread
from icmj.base.card import Card, WithCard
from icmj.base.numbers import amount, number
from icmj.controller.trigger import EventRule, Faces
from icmj.errors import AnalysisError
from icmj.theory.error_system import ErrorSystem
from icmj.theory.orbit import Orbit
from icmj.theory.reduction import Reduction, reduce_system

LARGEST = 0.25  # of the threshold: SD of the hold error's size at an event up to which the loop counts as linear
LAGS = 8  # of the correlations that are given
_ORDER = 4  # states of a noise on a grid
_COARSE = 0.01  # change of the deviation by the last of them beyond which a grid is too coarse
_ATTRACTS = 1 - 1e-9  # magnitude of a multiplier
_APART = 3.0  # SD within which nothing but the event itself may come near to the threshold
_STEPS = 128  # of an interval, at which that is looked at


@dataclass(frozen=True, eq=False)
class SmallNoise:
    """One stationary Gaussian signal, independent of all others, and where it acts.

    Attributes:
        rate: its contribution to ẋ for a value of one standard deviation, shape (n,); of the actual plant.
        reading: its contribution to the observer's readings, shape (n_y,).
        interval: between the points of its grid [s]; 0 for a signal in continuous time.
        corner: at which its first-order low-pass spectrum has fallen to half [Hz]; ``None`` for white noise, whose
            values at the points of the grid are independent.

    Raises:
        AnalysisError: on construction, if a number is not finite, or there is neither a grid nor a corner.
    """

    rate: Array
    reading: Array
    interval: float
    corner: float | None = None

    def __post_init__(self) -> None:
        for name in ("rate", "reading"):
            object.__setattr__(self, name, np.atleast_1d(real(getattr(self, name), f"a noise's {name}", AnalysisError)))
            if not np.isfinite(getattr(self, name)).all():
                raise AnalysisError(f"a noise's {name} must be finite, got {getattr(self, name)}")
        if not 0 <= self.interval < np.inf or not (self.corner is None or 0 < self.corner < np.inf):
            raise AnalysisError(
                f"a noise's interval and corner must be positive and finite, got {self.interval} and {self.corner}"
            )
        if not self.interval and self.corner is None:
            raise AnalysisError("noise in continuous time needs a corner; give one, or an interval")


@dataclass(frozen=True, eq=False, repr=False)
class Spread(WithCard):
    """How intervals vary about the predicted orbit under small noise.

    Attributes:
        interval: Δ of the orbit without noise [s].
        deviation: standard deviation of the intervals [s].
        correlation: of intervals that are 1, 2, … events apart, shape (8,).
        shift: by how much the mean interval is longer than ``interval``, to second order [s].
        epsilon: standard deviation of the size of the hold error at the time of the nominal event, relative to the
            threshold.
        covariance: of the deviation of the state at events from the orbit, shape (N_w, N_w); see
            ``x_bar`` of the orbit. On an orbit with λ = −1 every second state is mirrored.
        t: times since the event, from its action to the nominal next event [s], shape (129,).
        hold_error: standard deviation of the size of the hold error then, relative to the threshold, shape (129,).
    """

    interval: float
    deviation: float
    correlation: Array
    shift: float
    epsilon: float
    covariance: Array
    t: Array
    hold_error: Array

    @property
    def words(self) -> str:
        """Mean and deviation of the intervals, and the correlation of successive ones, in one sentence."""
        return (
            "under the noise of the run file the predicted intervals have a mean of "
            f"{amount(self.interval + self.shift, 's')}, a standard deviation of {amount(self.deviation, 's', 3)}, and "
            f"a correlation of {number(self.correlation[0], 3)} from one to the next"
        )

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        mean, deviation = amount(self.interval + self.shift, "s"), amount(self.deviation, "s", 3)
        rows = (
            ("interval without noise", amount(self.interval, "s")),
            ("mean interval", mean),
            ("deviation of the intervals", deviation),
            ("correlation of successive intervals", number(self.correlation[0], 3)),
            ("deviation of the hold error at an event", f"{number(self.epsilon, 3)} of the threshold"),
        )
        return Card(f"intervals of {mean} ± {deviation}", rows)


@limit_to_one_thread()
def predict_spread(system: ErrorSystem, trigger: EventRule, orbit: Orbit, noise: Sequence[SmallNoise]) -> Spread:
    """The spread of the intervals about an orbit that attracts, to first order in the noise; the mean to second.

    Args:
        system: the error system of the actual plant.
        trigger: the event rule.
        orbit: its orbit, such as ``prediction.orbit``.
        noise: the noises, independent of each other.

    Raises:
        AnalysisError: if the orbit is not admissible or does not attract, as members of a family do not; if there is no
            noise, or one that does not fit, or so much that the loop is not linear, that intervals reach Δ_min, that
            another face ends them or that the event function turns back before the threshold; if a grid is too coarse
            for the observer, or a mode of the plant cannot be changed.
    """
    if not noise:
        raise AnalysisError("no spread is predicted without noise; give at least one")
    shapes = (system.n,), (system.actual.n_y,)
    for of in noise:
        if (of.rate.shape, of.reading.shape) != shapes:
            raise AnalysisError(
                f"a noise has {len(of.rate)} rates and {len(of.reading)} readings; expected {system.n} and "
                f"{system.actual.n_y}"
            )
    if not orbit.admissible:
        raise AnalysisError(f"no spread is predicted about an orbit that is not admissible: {orbit.reason}")
    reduced, faces = reduce_system(system), trigger.faces(system.design)
    if len(reduced.fixed):
        raise AnalysisError(f"no spread is predicted with a mode that drifts under noise: {reduced.modes[-1].words}")
    beside = [_Beside.of(system, reduced, faces, orbit, noise, order) for order in (_ORDER - 1, _ORDER)]
    found = beside[-1].spread()
    if found.epsilon > LARGEST:
        raise AnalysisError(
            f"no spread is predicted: noise moves the hold error at an event by {found.epsilon:.2g} of the threshold, "
            f"too much for a linear theory (at most {LARGEST:g}); simulate, or raise the threshold"
        )
    if abs(beside[0].deviation - found.deviation) > _COARSE * found.deviation:
        raise AnalysisError(
            f"no spread is predicted: a grid of {max(of.interval for of in noise):g} s is too coarse for the observer; "
            "shorten the interval of the noise, or simulate"
        )
    if found.interval - _APART * found.deviation < trigger.delta_min:
        raise AnalysisError(
            f"no spread is predicted: noise makes intervals as short as Δ_min = {trigger.delta_min:g} s; simulate"
        )
    if obstacle := beside[-1].obstacle():
        raise AnalysisError(f"no spread is predicted: {obstacle}; simulate, or raise the threshold")
    return found


@dataclass(frozen=True, eq=False)
class _Beside:
    """The loop beside an orbit, in ζ = (X̄ − X̄*, z); N states of the one and q of the other, N_w + q at an event.

    Attributes:
        A, Q: ζ' = A ζ + white noise of the intensity Q.
        start: X̄* after the action of an event, shape (N,).
        enter, entered: from the state at an event to ζ there, and the covariance that noise gathers until then.
        Phi, S: the same to just before the next event.
        leave: from there to the state at the event.
        gradient, speed: ∇E and Ẋ* there, with zeros for z.
        P: covariance of the state at events.
    """

    system: ErrorSystem
    reduced: Reduction
    faces: Faces
    orbit: Orbit
    A: Array
    Q: Array
    start: Array
    enter: Array
    entered: Array
    Phi: Array
    S: Array
    leave: Array
    gradient: Array
    speed: Array
    P: Array

    @classmethod
    def of(
        cls,
        system: ErrorSystem,
        reduced: Reduction,
        faces: Faces,
        orbit: Orbit,
        noise: Sequence[SmallNoise],
        order: int,
    ) -> _Beside:
        """The loop with ``order`` states for each noise on a grid.

        Raises:
            AnalysisError: if the orbit does not attract.
        """
        N, n, n_hat, t_d = len(system.A_C), system.n, system.n_hat, system.delay.t_d
        own = [make_noise_states(of, order) for of in noise]
        A, Q = (block_diag(first, *(of[i] for of in own)) for i, first in enumerate((system.A_C, np.zeros((N, N)))))
        size, at = len(A), N
        for of, (states, _) in zip(noise, own, strict=True):
            felt = np.concatenate([of.rate, system.design.L @ of.reading, np.zeros(n_hat)])
            A[:N, at] = system.from_original(felt)
            at += len(states)
        enter = block_diag(system.entry @ reduced.lift, np.eye(size - N))
        leave = block_diag(reduced.project @ system.exit, np.eye(size - N))
        entered = np.zeros((size, size))
        if t_d:
            # until the action noise moves plant and observer, and the prediction made at the event knows nothing of it
            waited, entered = gather(A, Q, t_d)
            act = np.eye(size)
            act[n + n_hat : N, : n + n_hat] = np.hstack([-system.T_hat, np.zeros((n_hat, n_hat))])
            act[n + n_hat : N, n + n_hat : N] = 0
            enter[:, N - size :] = act @ waited[:, N:]
            entered = act @ entered @ act.T
        flown, S = gather(A, Q, orbit.delta - t_d)
        S = S + flown @ entered @ flown.T
        start, X = system.entry @ orbit.x_bar, orbit.X[-1]
        gradient, speed = np.zeros(size), np.zeros(size)
        gradient[:N], speed[:N] = faces.gradient(system.T_t @ X) @ system.T_t, system.A_C @ X
        Pi = leave @ (np.eye(size) - np.outer(speed, gradient) / (gradient @ speed))
        J = Pi @ flown @ enter
        if not np.abs(np.linalg.eigvals(J)).max() < _ATTRACTS:
            raise AnalysisError("no spread is predicted about an orbit that does not attract; simulate")
        P = _settle(J, Pi @ S @ Pi.T)
        return cls(
            system, reduced, faces, orbit, A, Q, start, enter, entered, flown @ enter, S, leave, gradient, speed, P
        )

    @property
    def M(self) -> Array:
        """Covariance of ζ at the time of the nominal event."""
        return self.Phi @ self.P @ self.Phi.T + self.S

    @property
    def h(self) -> Array:
        """δ = h'ζ, how late an event is."""
        return -self.gradient / (self.gradient @ self.speed)

    @property
    def deviation(self) -> float:
        """Standard deviation of the intervals [s]."""
        return float(np.sqrt(self.h @ self.M @ self.h))

    def spread(self) -> Spread:
        """All that is told of it."""
        h, M, speed, sign = self.h, self.M, self.speed, self.orbit.sign
        N, variance = len(self.start), self.deviation**2
        slide = np.eye(len(M)) + np.outer(speed, h)
        Pi = self.leave @ slide
        J, lags = Pi @ self.Phi, []
        lagged = Pi @ M @ h  # of the next state with this interval
        for k in range(1, LAGS + 1):
            lags.append(sign**k * float(h @ self.Phi @ lagged) / variance)
            lagged = J @ lagged
        # to second order: E[δ ζ'] and E[δ²] Ẍ/2, the curvature of E, and what they make of the mean at later events
        later = self.A @ (M @ h + variance / 2 * speed)
        R = self.faces.R[self.faces.rows(self.faces.active(self.system.T_t @ self.orbit.X[-1]))] @ self.system.T_t
        curved = self.faces.unit * float(np.trace(R @ (slide @ M @ slide.T)[:N, :N] @ R.T))
        early = -curved / float(self.gradient @ speed)
        mean = np.linalg.solve(np.eye(len(J)) - sign * J, sign * (Pi @ later + early * self.leave @ speed))
        seen = self.reduced.lift.shape[1]
        return Spread(
            interval=self.orbit.delta,
            deviation=self.deviation,
            correlation=np.array(lags),
            shift=float(h @ (self.Phi @ mean + later)) + early,
            epsilon=float(np.sqrt(self.gradient @ M @ self.gradient)) / (2 * self.faces.unit),
            covariance=self.reduced.lift @ self.P[:seen, :seen] @ self.reduced.lift.T,
            t=np.linspace(self.system.delay.t_d, self.orbit.delta, _STEPS + 1),
            hold_error=np.array([across[int(size.argmax())] for size, across in self.follow(_STEPS)]),
        )

    def follow(self, steps: int) -> Iterator[tuple[Array, Array]]:
        """The size of the hold error on each face, in thresholds, and its standard deviation; shapes (F,), (F,).

        They are those at the action of an event and at the end of each of so many steps, of which ``_STEPS`` make an
        interval.
        """
        N, T_t, faces = len(self.start), self.system.T_t, self.faces
        step, fresh = gather(self.A, self.Q, (self.orbit.delta - self.system.delay.t_d) / _STEPS)
        X, M = self.start, self.enter @ self.P @ self.enter.T + self.entered
        for reached in range(steps + 1):
            if reached:
                X, M = step[:N, :N] @ X, step @ M @ step.T + fresh
            e, spread = T_t @ X, T_t @ M[:N, :N] @ T_t.T
            sizes, deviations = np.zeros(len(faces)), np.zeros(len(faces))
            for face in range(len(faces)):
                R = faces.R[faces.rows(face)]
                sizes[face] = np.linalg.norm(R @ e)
                across = (R @ e) @ R / (sizes[face] or np.finfo(float).tiny)
                deviations[face] = np.sqrt(np.maximum(across @ spread @ across, 0.0))
            yield sizes, deviations

    def obstacle(self) -> str:
        """What else than the event on the active face may come within the spread; empty if nothing does."""
        active, flight = self.faces.active(self.system.T_t @ self.orbit.X[-1]), self.orbit.delta - self.system.delay.t_d
        last, steps = np.inf, int(np.ceil(_STEPS * (1 + 4 * self.deviation / flight)))
        for reached, (sizes, deviations) in enumerate(self.follow(steps)):
            if not reached:
                continue
            apart = (1 - sizes) / np.where(deviations > 0, deviations, np.finfo(float).tiny)
            for face in range(len(sizes)):
                if face != active:
                    if apart[face] < _APART:
                        return "noise lets another face of the event rule end the interval"
                    continue
                if apart[face] < -_APART:
                    return ""
                if abs(apart[face]) < _APART and apart[face] > last:
                    when = "before" if reached < _STEPS else "after"
                    return f"within the noise the event function turns back {when} the event"
                last = apart[face]
        return ""


def make_noise_states(noise: SmallNoise, order: int) -> tuple[Array, Array]:
    """A_z and Q of ż = A_z z + white noise of the intensity Q, of which the first is the noise, of variance about one.

    On a grid of the interval i, with y = ωi/2 and the correlation a of successive values, the inverse spectral density
    is [(1 − a)² (y/sin y)⁴ + 4a y² (y/sin y)²]/(i (1 − a²)); its series in y² ends after ``order`` powers.

    Returns:
        shapes (order, order), or (1, 1) in continuous time.
    """
    rate = 0.0 if noise.corner is None else 2 * np.pi * noise.corner
    if not noise.interval:
        return np.array([[-rate]]), np.array([[2 * rate]])
    a = 0.0 if noise.corner is None else float(np.exp(-rate * noise.interval))
    sinc = [(-1) ** k / factorial(2 * k + 1) for k in range(order + 1)]
    inverse = [1.0]  # of the series in y²: y/sin y
    for k in range(1, order + 1):
        inverse.append(-sum(sinc[j] * inverse[k - j] for j in range(1, k + 1)))
    square = np.convolve(inverse, inverse)[: order + 1]
    series = (1 - a) ** 2 * np.convolve(square, square)[: order + 1]
    series[1:] += 4 * a * square[:-1]
    series /= noise.interval * (1 - a**2)
    # density 1/|p(iy)|², with the roots s of p in the left half plane, s² = −y²
    roots = -np.sqrt(np.asarray(-np.roots(series[::-1]), dtype=complex))
    polynomial = np.real(np.poly(roots))
    scale = 2 / noise.interval
    A, Q = np.eye(order, k=1), np.zeros((order, order))
    A[-1] = -polynomial[:0:-1]
    Q[-1, -1] = scale**2 / series[-1]
    return scale * A, Q


def gather(A: Array, Q: Array, t: float) -> tuple[Array, Array]:
    """e^{At} and the covariance that white noise of the intensity Q has made by then, both shape (N, N).

    Over a short time from one exponential (Van Loan 1978, *IEEE Trans. Autom. Control* 23:395–404), then by doubling:
    what it has gathered is carried on, and as much is added.
    """
    N = len(A)
    doublings = max(0, int(np.ceil(np.log2(max(float(np.linalg.norm(A, 1)) * t, 1.0)))))
    both = expm(np.block([[-A, Q], [np.zeros((N, N)), A.T]]) * (t / 2**doublings))
    flown = both[N:, N:].T
    S = flown @ both[:N, N:]
    for _ in range(doublings):
        S = S + flown @ S @ flown.T
        flown = flown @ flown
    return flown, (S + S.T) / 2


def _settle(J: Array, Q: Array) -> Array:
    """P = J P J' + Q for a J that contracts, by doubling."""
    P = Q
    while np.abs(J).max() > 1e-18:
        P = P + J @ P @ J.T
        J = J @ J
    return P
