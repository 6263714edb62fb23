"""Plants for the tests of the theory: the shipped pendulum in closed form, and random ones."""

from collections.abc import Callable, Iterator

import numpy as np
from linear_cases import loop_matrix
from scipy.linalg import block_diag, expm
from scipy.optimize import brentq, linear_sum_assignment

from icmj import Continuous, Controller, LinearPlant, Prediction, Settings, Simulation
from icmj.controller.design import Design, design_lq
from icmj.controller.hold import system_matched
from icmj.errors import DesignError
from icmj.linear.run import simulate
from icmj.theory.error_system import ErrorSystem, error_system
from icmj.theory.event_maps import compute_jacobians

Level = Callable[[np.ndarray], complex]

NAMES = ("v", "y")


def pendulum(gain: float = 1.0) -> LinearPlant:
    """b/(s² − 1), the paper's simple system, states (v, y)."""
    return LinearPlant([[0, 1], [1, 0]], [[gain], [0]], [[0, 1]], NAMES, ("u",), ("y",))


def pendulum_design() -> Design:
    """The recovered design of the notes, section 4."""
    return design_lq(pendulum(), R_c=0.1, R_o=0.01)


def neglected(zeta: float, omega: float = 10.0) -> LinearPlant:
    """The pendulum behind ω²/(s² + 2ζωs + ω²), states (v, y, rate, torque)."""
    A = [[0, 1, 0, 1], [1, 0, 0, 0], [0, 0, -2 * zeta * omega, -(omega**2)], [0, 0, 1, 0]]
    return LinearPlant(A, [[0], [0], [omega**2], [0]], [[0, 1, 0, 0]], (*NAMES, "rate", "torque"), ("u",), ("y",))


def three_link(gain: float = 1.0) -> LinearPlant:
    """The three-link standing model of the notes, section 5, from its segment table (states: rates, angles).

    Lagrange's equations in the segment angles to the vertical, linearised upright; independent of MuJoCo.
    """
    mass = np.array([7.44, 16.00, 54.24])
    length = np.array([0.4428, 0.4410, 0.5184])
    com = np.array([0.25107, 0.25005, 0.32452])
    inertia = np.array([0.13305, 0.32464, 3.58602])
    g = 9.81
    lever = np.array([[com[j] if i == j else length[j] if j < i else 0.0 for j in range(3)] for i in range(3)])
    M = np.einsum("i,ij,ik->jk", mass, lever, lever) + np.diag(inertia)
    gravity = g * np.diag(mass @ lever)
    joints = np.array([[1.0, 0, 0], [-1, 1, 0], [0, -1, 1]])  # joint angle from segment angles
    topple = g * np.array([mass[j:] @ (lever[j:, j:].sum(axis=1)) for j in range(3)])
    stiffness = joints.T @ np.diag([0.0, 0.8 * topple[1], 0.8 * topple[2]]) @ joints
    damping = joints.T @ np.diag(0.005 * topple) @ joints
    inverse = np.linalg.inv(M)
    A = np.block([[-inverse @ damping, inverse @ (gravity - stiffness)], [np.eye(3), np.zeros((3, 3))]])
    B = np.vstack([inverse @ joints.T, np.zeros((3, 3))])
    C = np.hstack([np.zeros((3, 3)), np.eye(3)])
    return LinearPlant(A, B * gain, C)


def three_link_design() -> Design:
    """The calibrated design of the notes, section 5."""
    return design_lq(three_link(), R_c=5e-7, R_o=2e-7)


SHIPPED = ("b=0.8", "b=1.2", "b=1.7", "b=0.9 three-link", "b=1.1 three-link", "zeta=0.1", "zeta=0.5", "exact")


def shipped(case: str) -> ErrorSystem:
    """The error system of one of the shipped cases."""
    if "three-link" in case:
        return error_system(three_link(float(case[2:5])), three_link_design())
    if case.startswith("zeta"):
        return error_system(neglected(float(case[5:])), pendulum_design())
    return error_system(pendulum(1.0 if case == "exact" else float(case[2:])), pendulum_design())


def random_systems(seed: int, count: int, *, mismatch: float = 0.3) -> Iterator[ErrorSystem]:
    """Error systems of random unstable plants of order 2 to 4, one or two inputs and outputs, under an LQ design.

    The actual plant is the assumed one with every entry of A, B and C disturbed by up to ``mismatch`` times a
    normal number; only those with a stable observer-based loop under continuous control are kept.
    """
    rng = np.random.default_rng(seed)
    made = 0
    while made < count:
        n, n_u, n_y = rng.integers(2, 5), rng.integers(1, 3), rng.integers(1, 3)
        A = rng.normal(size=(n, n))
        A += (rng.uniform(0.2, 2.0) - np.linalg.eigvals(A).real.max()) * np.eye(n)
        assumed = LinearPlant(A, rng.normal(size=(n, n_u)), rng.normal(size=(n_y, n)))
        weights = {"R_c": 10 ** rng.uniform(-2, 0.5), "R_o": 10 ** rng.uniform(-2, 0.5)}
        try:
            design = design_lq(assumed, **weights)
        except DesignError:
            continue
        size = mismatch * rng.uniform()
        A, B, C = (M * (1 + size * rng.normal(size=M.shape)) for M in (assumed.A, assumed.B, assumed.C))
        system = error_system(LinearPlant(A, B, C), design)
        if np.linalg.eigvals(system.T @ system.A_C @ system.T_bar).real.max() < -0.05:
            made += 1
            yield system


def step(crossing) -> int:
    """By how many the eigenvalues outside of the unit circle change there."""
    size = 2 if crossing.kind == "complex" else 1
    return crossing.multiplicity * size * {"rising": 1, "falling": -1, "tangent": 0}[crossing.direction]


def pair_of_holds(q: complex, c: complex, r: complex) -> ErrorSystem:
    """A system whose φ has, beside e^{−Δ}, the eigenvalue e^{qΔ} + r (e^{cΔ} − e^{qΔ})/(c − q) and its conjugate.

    x̃_o' = q x̃_o + r x̃_h and x̃_h' = c x̃_h, in complex numbers written as 2 × 2 blocks.
    """

    def block(z: complex) -> np.ndarray:
        return np.array([[z.real, -z.imag], [z.imag, z.real]]) if complex in map(type, (q, c, r)) else np.array([[z]])

    m = len(block(q))
    A_C = np.zeros((1 + 2 * m, 1 + 2 * m))
    A_C[0, 0] = -1
    A_C[1 : 1 + m, 1 : 1 + m], A_C[1 : 1 + m, 1 + m :], A_C[1 + m :, 1 + m :] = block(q), block(r), block(c)
    one = LinearPlant([[-1]], [[1]], [[1]])
    design = Design(LinearPlant(-np.eye(m), np.ones((m, 1)), np.ones((1, m))), np.zeros((1, m)), np.zeros((m, 1)))
    return ErrorSystem(A_C, np.zeros((m, 1)), one, design)


def dip(depth: float) -> tuple[ErrorSystem, list[float]]:
    """λ = αe^{−Δ} + (1 − α)e^{−3Δ} with least value −``depth``, and where it passes −1 (closed form)."""
    beta = brentq(lambda b: 2 * b / 3 * np.sqrt(b / (3 * (1 + b))) - depth, 0.1, 100, xtol=1e-15, rtol=1e-15)
    alpha = -beta
    r = (1 - alpha) * (-3 + 1)  # r/(c − q) = 1 − α
    # −1 = αz + (1 − α)z³ with z = e^{−Δ}
    z = np.roots([1 - alpha, 0, alpha, 1])
    z = z[np.abs(z.imag) < 1e-9].real
    return pair_of_holds(-1.0, -3.0, r), sorted(-np.log(z[(z > 0) & (z < 1)]))


INTEGRATOR = [[0.0]]
DOUBLE = [[0.0, 1.0], [0.0, 0.0]]
OSCILLATOR = [[0.0, 3.0], [-3.0, 0.0]]
GROWING = [[0.5]]


def beside(gain, extra, driven=None, shown=None) -> LinearPlant:
    """The pendulum with more states beside it.

    Args:
        gain: of the input.
        extra: their matrix.
        driven: how the pendulum drives them, shape (count, 2).
        shown: output row on them, if there is such an output.
    """
    plain, extra = pendulum(gain), np.asarray(extra)
    count = len(extra)
    A = block_diag(plain.A, extra)
    A[2:, :2] = 0 if driven is None else driven
    B, C = np.vstack([plain.B, np.zeros((count, 1))]), np.hstack([plain.C, np.zeros((1, count))])
    if shown is not None:
        C = np.vstack([C, np.concatenate([[0, 0], shown])])
    names = (*NAMES, *"pqrs"[:count])
    return LinearPlant(A, B, C, names, ("u",), ("y",) if shown is None else ("y", "place"))


def system_beside(extra, *, known=True, gain=0.8, **more) -> ErrorSystem:
    """The b = 0.8 system with more states, known to the controller or not, which does nothing about them."""
    plain, count = pendulum_design(), len(extra)
    actual = beside(gain, extra, **more)
    if not known:
        return error_system(actual, plain)
    k = np.hstack([plain.k, np.zeros((1, count))])
    L = np.zeros((2 + count, actual.n_y))
    L[:2, :1] = plain.L
    return error_system(actual, Design(beside(1.0, extra, **more), k, L))


def whole(system: ErrorSystem, x_bar: np.ndarray) -> np.ndarray:
    """(x, x_o, x_h) at an event of what is left of it in x̄; without a delay the hold begins where the observer is."""
    has_hold = len(x_bar) == system.n + 2 * system.n_hat
    return system.to_original(x_bar if has_hold else system.T_bar @ x_bar)


def next_event(system: ErrorSystem, level: Level, z: np.ndarray, delta: float) -> np.ndarray:
    """(x, x_o, x_h) at the event near ``delta``, from that at the event before, as plant, observer and hold say.

    The state is complex, and real but for a tiny part; ``level`` of a hold error is 1 at an event.
    """
    d, P, n, m = system.design, system.design.plant, system.n, system.n_hat
    M = loop_matrix(system.actual, Controller(d, system_matched(d), Continuous()))
    model = np.block([[P.A, -P.B @ d.k], [np.zeros((m, m)), d.A_c]])
    acted = expm(M * system.delay.t_d) @ z
    acted[n + m :] = (expm(model * system.delay.predicted) @ z[n:])[:m]
    flight = delta - system.delay.t_d
    base = expm(M * 0.95 * flight) @ acted

    def held(z: np.ndarray) -> np.ndarray:
        return z[n + m :] - z[n : n + m]

    def excess(s: float) -> float:
        return level(held(expm(M * s) @ base.real)) - 1

    end = expm(M * brentq(excess, 0.0, 0.1 * flight, xtol=1e-15, rtol=1e-14)) @ base
    slope = level(held(end.real) + 1e-30j * held(M @ end.real)).imag / 1e-30
    return end - M @ end * ((level(held(end)) - 1) / slope)  # the event of the tiny part is tinily elsewhere


def assert_multipliers_agree(system, rule, prediction: Prediction, level: Level | None = None) -> None:
    """By differences along the imaginary axis, Im f(x + ih)/h: nothing is cut off, and nothing cancels."""
    orbit, size = prediction.orbit, len(prediction.orbit.x_bar)
    level = level or (lambda e: e @ rule.Q_t @ e / rule.q_t**2)
    J, h = compute_jacobians(system, rule, orbit)[0], 1e-30 * np.abs(orbit.x_bar).max()
    start, columns = whole(system, orbit.x_bar), []
    for direction in h * np.eye(size):  # coordinates change linearly
        end = next_event(system, level, start + 1j * whole(system, direction), orbit.delta)
        columns.append(system.from_original(end.imag)[:size] / h)
    measured = np.column_stack(columns)
    # what is left is rounding: that of a state which grows some thousandfold within an interval
    assert np.abs(J - measured).max() < 1e-9 * max(1.0, np.abs(J).max())
    gap = np.abs(prediction.multipliers[:, None] - np.linalg.eigvals(measured))
    assert gap[linear_sum_assignment(gap)].max() < 1e-9 * max(1.0, np.abs(prediction.multipliers).max())


def started_beside(system: ErrorSystem, rule, prediction: Prediction, seed: int) -> tuple[Simulation, bool]:
    """A simulation of 80 intervals from 1e-3 beside the orbit, and whether it ends ten times nearer to it.

    Its mirror image counts, too.
    """
    orbit, size = prediction.orbit, np.linalg.norm(prediction.orbit.x_bar)
    away = np.random.default_rng(seed).normal(size=len(orbit.x_bar))
    start = whole(system, orbit.x_bar + 1e-3 * size * away / np.linalg.norm(away))
    x, x_o, x_h = np.split(start, [system.n, system.n + system.n_hat])
    controller = Controller(system.design, system_matched(system.design), rule, system.delay)
    settings = Settings(duration=80 * orbit.delta, record_interval=1e3, limit=1e6)
    run = simulate(system.actual, controller, settings, x0=x, x_o0=x_o, x_h0=x_h)
    events = run.events
    after = np.hstack([events.x, events.x_o, events.x_h if system.delay else events.x_o])
    at = system.from_original(after)[:, : len(orbit.x_bar)]
    gap = np.minimum(*(np.linalg.norm(at - s * orbit.x_bar, axis=1) for s in (1, -1)))
    return run, len(gap) > 10 and bool(gap[-3:].max() < 1e-4 * size)


def visiting() -> ErrorSystem:
    """The fifth of a series of random plants of 16 to 24 states, kept because of what its eigenvalues do at 0.159 s."""
    rng, made = np.random.default_rng(3), 0
    while True:
        n = int(rng.integers(16, 25))
        n_u, n_y = rng.integers(1, n // 2 + 1, size=2)
        A = rng.normal(size=(n, n)) * 10 ** rng.uniform(-0.5, 0.5)
        if rng.uniform() < 0.3:
            A = A - A.T + 0.1 * rng.normal(size=(n, n))
        A += (rng.uniform(-0.5, 1.5) - np.linalg.eigvals(A).real.max()) * np.eye(n)
        assumed = LinearPlant(A, rng.normal(size=(n, n_u)), rng.normal(size=(n_y, n)))
        try:
            design = design_lq(assumed, R_c=10 ** rng.uniform(-2, 1), R_o=10 ** rng.uniform(-2, 1))
        except DesignError:
            continue
        size = 0.5 * rng.uniform()
        A, B, C = (M * (1 + size * rng.normal(size=M.shape)) for M in (assumed.A, assumed.B, assumed.C))
        made += 1
        if made == 5:
            return error_system(LinearPlant(A, B, C), design)
