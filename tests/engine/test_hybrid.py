"""Any hybrid controller in MuJoCo: against the linear plant where the sway is small, and against the event loops."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hybrid_cases import NAMES, START, Bare, Given, Ramp, body, law, laws, plant
from model_cases import written
from tapped_cases import PERSON

import icmj
from icmj.controller.layout import Layout
from icmj.controller.realisation import Mode, Realisation
from icmj.engine.composition import goes_by_steps
from icmj.engine.plant import load_plant
from icmj.engine.run import simulate
from icmj.errors import SimulationError
from icmj.linear.run import simulate_tapped as linear_simulate
from icmj.simulation.settings import Settings
from icmj.simulation.start import start_states

SMALL = 1e-4


class Later(Bare):
    """A controller that reads what was 0.3 s ago, too, and makes nothing of it: so it is followed by stretches."""

    @property
    def realisation(self) -> Realisation:
        real, behind = self.of.realisation, [self.plant.n_y] * self.plant.n_y
        N, S = (np.insert(getattr(real.modes[0], letter), behind, 0.0, axis=1) for letter in "NS")
        return replace(real, modes=(replace(real.modes[0], N=N, S=S, rates=None),), taps=(0.0, 0.3))


def lagging(**changes: object) -> icmj.Law:
    """A PD whose command lags, on the small sway, with a rule, a clock, a period or signals."""
    columns = 2 + ("signals" in changes)
    N, one = np.array([[900.0, 300.0, 1.0]])[:, :columns] * [20.0, 20.0, 1.0][:columns], np.eye(1)
    mode = Mode("on", -20 * one, N, one, np.zeros((1, columns)))
    rule = {"R": np.zeros((0, 1)), "cuts": np.zeros(1, dtype=int), "J": 0.5 * one, "G": 0.7 * one}
    return Given(plant(), Realisation(Layout.of(a=1), (mode,), **rule | changes))  # type: ignore[arg-type]


def stateless() -> icmj.Law:
    """The same without a state."""
    none = np.zeros((0, 0))
    mode = Mode("on", none, np.zeros((0, 2)), np.zeros((1, 0)), np.array([[900.0, 300.0]]))
    return Given(plant(), Realisation(Layout.of(), (mode,), none, none, none, np.zeros(1, dtype=int)))


JUMPS = {"signals": np.array([[0, 1e-3, 0, 0, 0, 0], [0, 2e-3, 0, 0, 0.8, 0.8], [0, 1e-3, 0, 0, 1.5, 1.5]])}
RULE = {"R": np.array([[2e3]]), "cuts": np.array([0, 1])}
ENDS = {
    "a jump of the state at the begin, and one at the end": lambda: lagging(**JUMPS),
    "an action at the end": lambda: lagging(clock=0.5, delay=0.25),
    "a tick at the end": lambda: lagging(clock=0.5),
    "a reset at the end": lambda: lagging(period=0.5),
    "a rule that is beyond at the begin": lambda: lagging(wait=0.2, **RULE),
    "a rule and its action": lambda: lagging(wait=0.2, delay=0.1, **RULE),
    "no state": stateless,
}


@pytest.mark.parametrize("name", ENDS)
@pytest.mark.parametrize("timestep", [None, 0.002])
def test_what_falls_on_begin_and_end_is_as_on_the_linear_plant(name, timestep) -> None:
    """Every row and every command; those that need it know a command's two sides, and go by stretches."""
    own, settings = ENDS[name](), Settings(duration=1.5, record_interval=0.05, timestep=timestep)
    assert goes_by_steps(own) == (name in ("a tick at the end", "a rule that is beyond at the begin"))
    a0 = np.array([1e-3]) if "rule" in name else None
    one = linear_simulate(plant(), own, settings, x0=SMALL * START, a0=a0)
    other = simulate(body(), own, settings, x0=SMALL * START, a0=a0)
    assert len(one.events) == len(other.events)
    np.testing.assert_allclose(other.events.t, one.events.t, atol=1e-7)
    np.testing.assert_allclose(other.t, one.t, atol=1e-7)
    for there, here in ((one.x, other.x), (one.u, other.u), (one.events.x, other.events.x)):
        assert np.abs(here - there).max(initial=0.0) <= 1e-5 * np.abs(there).max(initial=0.0)


@pytest.mark.parametrize("taps", [(0.0,), (0.1,)])
def test_a_controller_starts_in_the_state_that_it_is_given(taps) -> None:
    """Also one that reads delayed outputs alone: its ramp begins at 0.4, so it fires at 0.6 s, and moves the body."""
    own, settings, a0 = Ramp(plant(), taps), Settings(duration=1.0, record_interval=0.05), [0.4]
    one = linear_simulate(plant(), own, settings, x0=SMALL * START, a0=a0)
    other = simulate(body(), own, settings, x0=SMALL * START, a0=a0)
    assert other.events.t == pytest.approx([0.6], abs=1e-9)
    assert other.u[0] == pytest.approx(one.u[0], rel=1e-9)
    leans = np.abs(one.x[:, 0]).max()  # what gravity does goes with its sine
    assert np.abs(other.x - one.x).max() <= leans**2 / 6 * np.abs(one.x).max()
    for bad in ([0.4, 0.0], [np.nan], [[0.4]]):
        for there, run in ((plant(), linear_simulate), (body(), simulate)):
            with pytest.raises(SimulationError, match="start state of the controller: expected 1 finite numbers"):
                run(there, own, settings, a0=bad)


def small(name: str) -> icmj.Law:
    """The controller with all of its sizes that much smaller: on the linear plant, the same motion in small."""
    of, there = laws(), plant()
    return {
        "plain-pd": lambda: of.PlainPD(there),
        "hysteresis": lambda: of.Hysteresis(there, 0.2, q_t=0.002 * SMALL),
        "reflex": lambda: of.WithReflex(there, 0.2, q_t=0.002 * SMALL),
        "alert": lambda: of.Alert(there, 0.2, q_t=0.002 * SMALL, size=0.02 * SMALL, level=0.002 * SMALL, start=1.5),
        "saturating": lambda: of.Saturating(there, 0.2, q_t=0.002 * SMALL, u_max=3.0 * SMALL),
    }[name]()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("timestep", [None, 0.002])
def test_where_the_sway_is_small_it_is_the_linear_plant(name, timestep) -> None:
    settings = Settings(duration=4.0, record_interval=0.05, timestep=timestep)
    one = icmj.simulate_plant(plant(), small(name), settings, x0=SMALL * START)
    other = icmj.simulate_plant(body(), small(name), settings, x0=SMALL * START)
    assert len(one.events) == len(other.events)
    assert other.events.t == pytest.approx(one.events.t, abs=1e-5)
    rows = np.isin(np.round(one.t, 9), np.round(other.t, 9))
    at = np.searchsorted(other.t, one.t[rows] - 1e-9)
    assert np.abs(other.x[at] - one.x[rows]).max() <= 1e-5 * np.abs(one.x).max()
    assert np.isin(np.round(0.05 * np.arange(81), 9), np.round(other.t, 9)).all()
    assert (np.diff(other.t) > 0).all()


@pytest.mark.slow
@pytest.mark.kernels
@pytest.mark.parametrize(
    "file", ["runs/rivals/one-link-event.toml", "runs/simple-0.8.toml", "runs/three-link-0.9-delay.toml"]
)
@pytest.mark.parametrize(("timestep", "bound"), [(None, 1e-6), (0.001, 1e-9)])
def test_the_intermittent_controller_is_what_the_event_loops_give(file, timestep, bound) -> None:
    """Steps that are chosen are others, so events differ by the tolerance; given ones by little more than rounding."""
    case = icmj.prepare(icmj.load_run(file).with_(**{"simulation.duration": 6.0, "simulation.timestep": timestep}))
    x, a = start_states(case.actual.linearisation.plant, case.controller, case.settings, None, None, None)
    one = icmj.simulate(case, "mujoco")
    later = Later(case.controller)
    assert goes_by_steps(case.controller)
    assert not goes_by_steps(later)
    other = simulate(case.actual, later, case.settings, x0=x, a0=a)
    assert len(one.events) == len(other.events) > 2
    assert other.events.t == pytest.approx(one.events.t, abs=bound)
    assert np.abs(other.events.y_max - one.events.y_max).max() <= 10 * bound
    assert np.isfinite(other.precision["output_error"])


def test_a_stretch_that_is_flown_again_begins_with_what_springs_had_yielded(tmp_path: Path) -> None:
    """Step by step only a step is undone. Yielding is taken up once a step, so both err as a step is to the run."""
    text = PERSON.replace("stiffness=", 'springyield="0.002" stiffness=')
    yielding = load_plant(written(tmp_path, text))
    settings = Settings(duration=0.6, timestep=1e-4, record_interval=0.1)
    own = lagging(wait=0.05, R=np.array([[0.12]]), cuts=np.array([0, 1]))
    steps, stretches = (
        simulate(yielding, of, settings, x0=START, error_estimate=False) for of in (own, Later(own))
    )  # fmt: skip
    assert len(steps.events) == len(stretches.events) > 2
    assert np.abs(steps.x[-1] - stretches.x[-1]).max() < 1e-4 / 0.6 * np.abs(steps.x).max()


def test_a_tighter_tolerance_converges() -> None:
    times = []
    for tolerance in (1e-7, 1e-9, 1e-11):  # looser ones take the longest step that a stretch has
        settings = Settings(duration=3.0, tolerance=tolerance)
        times.append(icmj.simulate_plant(body(), law("hysteresis"), settings, x0=START).events.t)
    assert len({len(t) for t in times}) == 1
    assert np.abs(times[1] - times[2]).max() <= max(0.1 * np.abs(times[0] - times[2]).max(), 1e-9)
    assert np.abs(times[0] - times[2]).max() < 1e-6


def test_errors_of_readings_reach_every_path() -> None:
    """A bias of what is read moves the rest to where P (θ + bias) is what holds the body."""
    there = plant()
    settings = Settings(duration=20.0, disturbance=(icmj.Bias("lean", 1e-4),), record_interval=0.1)
    for name in ("plain-pd", "reflex"):
        one = icmj.simulate_plant(there, law(name), settings, x0=0 * START)
        other = icmj.simulate_plant(body(), law(name), replace(settings), x0=0 * START)
        if name == "plain-pd":
            rest = -900.0 * 1e-4 / (900.0 + there.A[1, 0] / -there.B[1, 0])
            assert one.y[-1, 0] == pytest.approx(rest, rel=1e-9)
            assert other.y[-1, 0] == pytest.approx(rest, rel=1e-6)
        assert other.events.t == pytest.approx(one.events.t, abs=1e-3)
