"""Signals that a controller is given, terms and impulses: both plants against matrix exponentials."""

from dataclasses import dataclass, replace
from functools import cached_property

import engine_cases
import linear_cases
import numpy as np
import pytest
from scipy.linalg import expm

from icmj import Continuous, Controller, IcmjError, Settings, simulate_plant
from icmj.controller.realisation import Realisation
from icmj.linear.open_loop import open_loop

DRIVE = np.array([0.3, -0.5])  # what the signal does to the rate of x_o
SIZE, START, END, IMPULSE, LATER = 1e-3, 0.3, 0.9, 2e-3, 0.7


@dataclass(frozen=True, eq=False)
class Told(Controller):
    """The intermittent controller with an observer that is told something: a constant for a while, and an impulse."""

    @cached_property
    def realisation(self) -> Realisation:
        bare = Controller(self.design, self.hold, self.trigger, self.delay).realisation
        column = np.concatenate([DRIVE, DRIVE if self.kind == "continuous" else np.zeros(2)])[:, None]
        mode = bare.modes[0]
        rates = replace(mode.rates, N=np.hstack([mode.N, column]), H=np.pad(mode.rates.H, ((0, 1), (0, 0))))
        mode = replace(mode, N=rates.N, S=np.pad(mode.S, ((0, 0), (0, 1))), rates=rates)
        signals = np.array([[0, SIZE, 0, 0, START, END], [0, IMPULSE, 0, 0, LATER, LATER]])
        return replace(bare, modes=(mode,), signals=signals)


def told(plant, trigger):
    bare = linear_cases.event_controller(linear_cases.pendulum_design())
    if plant != "linear":
        bare = engine_cases.controller("pendulum")
    return Told(bare.design, bare.hold, trigger or bare.trigger)


def by_exponentials(plant, controller, end):
    """(x, x_o) at the end of continuous control from rest, by hand."""
    d = controller.design
    F = np.zeros((5, 5))
    F[:2, :2], F[:2, 2:4] = plant.A, -plant.B @ d.k
    F[2:4, :2], F[2:4, 2:4] = d.L @ plant.C, d.A_o - d.plant.B @ d.k
    on = F.copy()
    on[2:4, 4] = SIZE * DRIVE
    z = np.array([0, 0, 0, 0, 1.0])
    z = expm(on * (LATER - START)) @ z
    z[2:4] += IMPULSE * DRIVE
    return (expm(F * (end - END)) @ expm(on * (END - LATER)) @ z)[:4]


def test_the_linear_plant_follows_them_exactly() -> None:
    controller = told("linear", Continuous())
    run = simulate_plant(linear_cases.PENDULUM, controller, Settings(duration=2.0))
    expected = by_exponentials(linear_cases.PENDULUM, controller, 2.0)
    np.testing.assert_allclose(np.append(run.x[-1], run.x_o[-1]), expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("steps", [{"tolerance": 1e-11}, {"timestep": 0.002, "integrator": "RK4"}])
def test_the_engine_follows_them(steps) -> None:
    plant = engine_cases.plant("pendulum")
    controller = told("mujoco", Continuous())
    run = simulate_plant(plant, controller, Settings(duration=2.0, **steps))
    expected = by_exponentials(plant.linearisation.plant, controller, 2.0)
    # the pendulum's sine: cubic in what is some 1e-3
    np.testing.assert_allclose(np.append(run.x[-1], run.x_o[-1]), expected, rtol=0, atol=1e-7)


@pytest.mark.parametrize("steps", [None, {"tolerance": 1e-9}, {"timestep": 0.003, "integrator": "RK4"}])
def test_an_impulse_beyond_the_threshold_is_an_event_at_once(steps) -> None:
    bare = engine_cases.controller("pendulum", q_t=5e-4, delta_min=0.0)
    plant = engine_cases.plant("pendulum")
    controller = Told(bare.design, bare.hold, bare.trigger)
    if steps is None:
        run = simulate_plant(plant.linearisation.plant, controller, Settings(duration=1.0))
    else:
        run = simulate_plant(plant, controller, Settings(duration=1.0, **steps))
    assert np.any(run.events.t == LATER)
    assert run.E[np.searchsorted(run.t, LATER)] > 0


def test_an_interval_alone_has_no_signals() -> None:
    with pytest.raises(IcmjError, match="signals of its own"):
        open_loop(linear_cases.PENDULUM, told("linear", None), Settings())
