"""People who follow pairs of steps: plants of order 0, 1 and 2 driven by a joystick, and controllers of each kind."""

import numpy as np

from icmj import Controller, Delay, Gaussian, LinearPlant, Series, Settings, design_lq, system_matched
from icmj.controller.design import output_weight
from icmj.controller.rules.quadratic import EventTrigger
from icmj.controller.setpoint import setpoint
from icmj.controller.step_pairs import StepPairs
from icmj.controller.trigger import ClockTrigger, Continuous
from icmj.linear.run import simulate

T_D, D_OL, D_S = 0.14, 0.35, 0.12  # delay, open-loop interval, sampling delay [s]
PLANTS = {
    "zero": LinearPlant([[-20.0]], [20.0], [1.0], ("dot",), ("joystick",), ("dot",)),  # a lag of 50 ms
    "first": LinearPlant([[0.0]], [1.0], [1.0], ("dot",), ("joystick",), ("dot",)),
    "second": LinearPlant([[0, 1.0], [0, 0]], [0, 1.0], [1.0, 0], ("dot", "dot_rate"), ("joystick",), ("dot",)),
    "unstable": LinearPlant([[0, 1.0], [1, 0]], [0, 1.0], [1.0, 0], ("dot", "dot_rate"), ("joystick",), ("dot",)),
}


def controller(kind: str, pairs: StepPairs, plant: str = "zero", delta: float = D_OL, q_t: float = 0.05) -> Controller:
    """One of the kinds of van de Kamp et al. 2013, figure 8."""
    design = design_lq(PLANTS[plant], R_c=1.0, R_o=0.1)
    followed = setpoint(PLANTS[plant], [pairs.target("dot")])
    trigger = {
        "event": EventTrigger(output_weight(design), q_t, delta_min=delta),
        "sampling": EventTrigger(output_weight(design), q_t, delta_min=delta),
        "clock": ClockTrigger(delta),
        "continuous": ClockTrigger(T_D / 20),  # the continuous predictor controller in the limit
        "no delay": Continuous(),
    }[kind]
    delay, late = Delay(T_D * (kind != "no delay")), D_S * (kind == "sampling")
    return Controller(design, system_matched(design), trigger, delay, followed, sampling_delay=late)


def recorded(of: Controller, pairs: StepPairs, interval: float = 0.01, noise: float = 0.0, seed: int = 0) -> Series:
    """Set-point and joystick at even rows; ``noise`` acts on the joystick, half of it on what is seen."""
    disturbance = ()
    if noise:
        motor = Gaussian(input="joystick", size=noise, corner=3.0, interval=0.02, seed=2 * seed)
        disturbance = (motor, Gaussian(output="dot", size=noise / 2, corner=3.0, interval=0.02, seed=2 * seed + 1))
    settings = Settings(duration=pairs.end, limit=1e9, record_interval=interval, disturbance=disturbance)
    run = simulate(of.plant, of, settings)
    even = np.abs(run.t / interval - np.round(run.t / interval)) < 1e-7
    joystick = run.applied if noise else run.u
    return Series(run.t[even], np.column_stack([run.r, joystick])[even], ("target", "joystick"), ("m", "m"))


def sampled_late(pairs: StepPairs, plant: str = "zero") -> Series:
    """The joystick of a controller that samples d_s after the event, by definition: its steps stand where it samples.

    Both steps are in one sample where the second comes before it; else the second is sampled when it comes, and d_s
    has gone, and Δ_ol since the last sample.
    """
    first = pairs.t[:, 0] + D_S
    second = np.where(pairs.isi < D_S, first, np.maximum(pairs.t[:, 1], pairs.t[:, 0] + D_OL) + D_S)
    moved = np.column_stack([first, second + 1e-9]) + T_D
    meant = StepPairs(moved, pairs.sizes)
    return recorded(controller("no delay", meant, plant), meant)


def expected(kind: str, pairs: StepPairs) -> np.ndarray:
    """Both reaction times by the definition of each kind [s], shape (P, 2)."""
    isi, none = pairs.isi, np.zeros(len(pairs))
    if kind == "event":
        return T_D + np.column_stack([none, np.maximum(0, D_OL - isi)])
    if kind == "clock":
        return T_D + np.ceil(pairs.t / D_OL) * D_OL - pairs.t
    if kind == "sampling":
        return T_D + D_S + np.column_stack([none, np.where(isi < D_S, -isi, np.maximum(0, D_OL - isi))])
    return np.full(pairs.t.shape, T_D if kind == "continuous" else 0.0)
