"""Plants for the tests of the theory: the shipped pendulum in closed form, and random ones."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from icmj.controller.design import Design, design_lq
from icmj.errors import DesignError
from icmj.plant.linear_plant import LinearPlant
from icmj.theory.error_system import ErrorSystem, error_system

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
