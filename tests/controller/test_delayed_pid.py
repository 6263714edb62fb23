"""Delayed PID with force feedback: against transfer functions, a Nyquist count, and the method of steps."""

from dataclasses import replace

import numpy as np
import pytest
from oracles.delay import of_law

from icmj import DelayedPID, LinearPlant, Settings
from icmj.errors import AnalysisError
from icmj.linear.run import simulate
from icmj.theory.delay_roots import delay_loop, rightmost_roots

# Pasma et al. (2017), Front Comput Neurosci 11:99, table 1
J, MGH, K, B = 66.0, 75 * 9.81 * 0.83, 40.5, 68.8
OMEGA, BETA, DELAY = 16.8, 0.99, 0.097
K_P, K_D, G, TAU = 943.9, 313.5, 0.0018, 17.4

A = np.array(
    [[0, 1, 0, 0], [(MGH - K) / J, -B / J, 1 / J, 0], [0, 0, 0, 1], [0, 0, -(OMEGA**2), -2 * BETA * OMEGA]]
)  # fmt: skip
BODY = LinearPlant(
    A, np.array([0, 0, 0, OMEGA**2]), np.eye(4)[:3], ("lean", "lean_rate", "pull", "pull_rate"), ("ankle",),
    ("theta", "omega", "torque"),
)  # fmt: skip
PRINTED = DelayedPID(BODY, "theta", "omega", K_P, K_D, DELAY, force="torque", force_gain=G, force_time=TAU)
OF_COMMAND = replace(PRINTED, force="")
WITH_INTEGRAL = replace(PRINTED, I=50.0, weight=0.9)
BOTH = replace(WITH_INTEGRAL, force="")


def _equation(law: DelayedPID, s: complex) -> complex:
    """1 + NC (w B_p TD ACT − F …), zero at a root, in transfer functions alone."""
    body = 1 / (J * s**2 + B * s + K - MGH)
    neural, late = law.P + law.I / s + law.D * s, np.exp(-s * law.delay)
    muscle = OMEGA**2 / (s**2 + 2 * BETA * OMEGA * s + OMEGA**2)
    force = law.force_gain / (law.force_time * s + 1)
    return 1 + neural * (law.weight * body * late * muscle - force * (late * muscle if law.force else 1.0))


@pytest.mark.parametrize("law", [PRINTED, OF_COMMAND, WITH_INTEGRAL, BOTH, replace(PRINTED, force="", force_gain=0.0)])
def test_its_roots_are_zeros_of_the_transfer_functions(law: DelayedPID) -> None:
    roots = rightmost_roots(delay_loop(BODY, law), 6)
    for s in roots:
        step = 1e-6 * (1 + abs(s))
        slope = (_equation(law, s + step) - _equation(law, s - step)) / (2 * step)
        assert abs(_equation(law, s) / slope) < 1e-8 * (1 + abs(s))


@pytest.mark.parametrize(("law", "unstable"), [
    (PRINTED, 0),
    (OF_COMMAND, 0),
    (WITH_INTEGRAL, 0),
    (BOTH, 0),
    (replace(PRINTED, P=3000.0), 2),  # too strong for the delay
    (replace(PRINTED, P=300.0), 2),  # too weak for gravity, and the torque leads further away
    (replace(PRINTED, P=300.0, force="", force_gain=0.0), 1),  # too weak for gravity
])  # fmt: skip
def test_the_frequency_response_turns_as_often_as_roots_are_unstable(law: DelayedPID, unstable: int) -> None:
    line = 1e-3  # 1/s, to the right of the poles of the integral and the force feedback, to the left of the body's
    omega = np.concatenate([[0.0], np.geomspace(1e-5, 1e5, 100_001)])
    value = np.array([_equation(law, complex(line, w)) for w in omega])
    direct = 1 - law.D * law.force_gain / law.force_time * (not law.force)  # where it goes at high frequencies
    assert value[-1] == pytest.approx(direct, abs=1e-3)
    turns = 2 * np.angle(value[1:] / value[:-1]).sum() / (2 * np.pi)  # of the whole line, by symmetry
    assert turns == pytest.approx(1 - unstable, abs=1e-3)  # the body has one unstable pole
    roots = rightmost_roots(delay_loop(BODY, law), 4)
    assert int((roots.real > line).sum()) == unstable


def test_the_printed_case_stands_with_a_slow_root_of_the_force_feedback() -> None:
    laws = PRINTED, replace(PRINTED, force="", force_gain=0.0)
    roots, without = (rightmost_roots(delay_loop(BODY, law), 3) for law in laws)
    # force feedback adds one slow real root
    assert roots[0].imag == 0
    assert roots[0].real < 0
    assert roots[:3] == pytest.approx([-0.22240144, -1.14788144 + 4.08013271j, -1.14788144 - 4.08013271j], abs=1e-8)
    assert roots[1] == pytest.approx(without[0], abs=0.5)
    of_command = rightmost_roots(delay_loop(BODY, OF_COMMAND), 3)
    assert of_command == pytest.approx([-0.214406, -1.141548 + 4.268631j, -1.141548 - 4.268631j], abs=1e-6)


@pytest.mark.parametrize("law", [PRINTED, OF_COMMAND, WITH_INTEGRAL, BOTH])
def test_it_moves_as_the_method_of_steps_says(law: DelayedPID) -> None:
    x0 = np.array([0.01, 0.0, 0.0, 0.0])
    run = simulate(BODY, law, Settings(duration=1.0, record_interval=0.05), x0=x0)
    motion = of_law(BODY, law, x0).run(1.0)
    expected = np.array([motion.z(t)[:4] for t in run.t])
    assert np.abs(run.x - expected).max() < 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize("law", [WITH_INTEGRAL, BOTH])
def test_its_equation_holds_along_a_run(law: DelayedPID) -> None:
    run = simulate(BODY, law, Settings(duration=3.0, record_interval=1e-3), x0=np.array([0.01, 0.0, 0.0, 0.0]))
    late = round(law.delay / 1e-3)
    theta, omega, torque = run.y[np.maximum(np.arange(len(run.t)) - late, 0)].T  # as they are read
    if not law.force:
        torque = run.u[:, 0]
    f, integral = np.zeros(len(theta)), np.zeros(len(theta))
    for i in range(len(theta) - 1):  # by the trapezium rule
        h, T = 1e-3, (torque[i] + torque[i + 1]) / 2
        f[i + 1] = f[i] + h * (G * T - f[i]) / TAU
        integral[i + 1] = integral[i] + h * (law.weight * (theta[i] + theta[i + 1]) - f[i] - f[i + 1]) / 2
    f_rate = (G * torque - f) / TAU
    u = -(K_P * (law.weight * theta - f) + law.I * integral + K_D * (law.weight * omega - f_rate))
    assert np.abs(u - run.u[:, 0]).max() < 1e-4 * np.abs(run.u).max()


@pytest.mark.parametrize(("wrong", "words"), [
    ({"position": "knee"}, "the plant's outputs are theta, omega, torque"),
    ({"rate": "theta"}, "the same output serves twice"),
    ({"input": "hip"}, "name the input that is controlled, one of ankle"),
    ({"P": np.nan}, "P must be a finite number"),
    ({"weight": np.inf}, "weight must be a finite number"),
    ({"delay": 0.0}, "the delay of the delayed PID controller must be positive"),
    ({"force_time": -1.0}, "time constant of the force feedback"),
    ({"force": "", "force_time": 0.5}, "it must be below 1"),
])  # fmt: skip
def test_what_makes_no_sense_is_refused(wrong: dict, words: str) -> None:
    with pytest.raises(AnalysisError, match=words):
        replace(PRINTED, **wrong)
