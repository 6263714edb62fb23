"""Every way to step, on every shape of delay: the same events, and the linear plant's to second order."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import icmj
from icmj.case.case import revise
from icmj.controller.controller import Controller
from icmj.controller.delay import Delay
from icmj.controller.design import design_lq, output_weight
from icmj.controller.hold import system_matched
from icmj.controller.rules.quadratic import EventTrigger
from icmj.controller.trigger import ClockTrigger, Trigger
from icmj.engine.deviation import Deviation
from icmj.engine.open_loop import open_loop
from icmj.engine.plant import MujocoPlant, load_plant
from icmj.engine.run import simulate
from icmj.linear.open_loop import open_loop as open_loop_linear
from icmj.linear.run import simulate as simulate_linear
from icmj.simulation.open_loop import OpenLoopInterval
from icmj.simulation.settings import Settings

CHAINS = 240
TIMESTEP = 2e-4
RELATIONS = ("no delay", "Δ_min below", "Δ_min at", "Δ_min above", "clock above", "clock at", "clock below")


@dataclass(frozen=True, eq=False)
class Drawn:
    """A chain of links with a controller, both random."""

    body: MujocoPlant
    control: Controller
    x: np.ndarray
    x_o: np.ndarray
    x_h: np.ndarray

    def sized(self, q_t: float) -> tuple[Controller, np.ndarray, np.ndarray, np.ndarray]:
        """Controller and start, both in proportion to the threshold."""
        trigger = self.control.trigger
        smaller = trigger.resized(q_t) if isinstance(trigger, EventTrigger) else trigger
        return self.control.triggered_by(smaller), q_t * self.x, q_t * self.x_o, q_t * self.x_h


def chain(random: np.random.Generator, links: int) -> str:
    inside = ""
    for link in reversed(range(links)):
        length, mass = random.uniform(0.25, 0.6), random.uniform(3, 30)
        above = f'<body name="b{link + 1}" pos="0 0 {length}">{inside}</body>' if inside else ""
        damping, stiffness = random.uniform(0, 3), random.uniform(0, 100)
        inside = (
            f'<joint name="j{link}" axis="0 1 0" damping="{damping}" stiffness="{stiffness}"/>'
            f'<inertial pos="0 0 {0.6 * length}" mass="{mass}" diaginertia="{mass / 8} {mass / 8} {mass / 20}"/>{above}'
        )
    motors = "".join(f'<motor name="m{link}" joint="j{link}"/>' for link in range(links))
    sensors = "".join(f'<jointpos name="y{link}" joint="j{link}"/>' for link in range(links))
    return f"""<mujoco model="chain"><compiler angle="radian"/>
  <option timestep="{TIMESTEP}" integrator="RK4"><flag contact="disable"/></option>
  <worldbody><body name="b0">{inside}</body></worldbody>
  <actuator>{motors}</actuator><sensor>{sensors}</sensor></mujoco>"""


def drawn(folder: Path, seed: int) -> Drawn:
    random = np.random.default_rng(seed)
    path, relation = folder / f"{seed}.xml", RELATIONS[seed % len(RELATIONS)]
    path.write_text(chain(random, 1 + seed % 4), encoding="utf-8")
    assumed = load_plant(path).linearisation.plant
    gains = design_lq(assumed, R_c=1e-5, R_o=1e-5)
    t_d = 0.0 if relation == "no delay" else random.uniform(0.03, 0.12)
    trigger: Trigger
    if relation.startswith("clock"):
        trigger = ClockTrigger({"clock above": 1.7, "clock at": 1.0, "clock below": 0.4}[relation] * t_d)
    else:
        share = {"Δ_min below": random.uniform(0, 0.9), "Δ_min at": 1.0, "Δ_min above": 1.6}.get(relation, 0.0)
        trigger = EventTrigger(output_weight(gains), 1.0, share * t_d)
    control = Controller(gains, system_matched(gains), trigger, Delay(t_d))
    x = np.concatenate([random.uniform(-0.7, 0.7, assumed.n // 2), random.uniform(-2, 2, assumed.n // 2)])
    # the observer is off by part of a threshold, so that no event is due at once
    gap = 0.3 * random.standard_normal(assumed.n) / np.sqrt(assumed.n)
    # with a delay the event has reset nothing yet: the hold is a threshold away, and leaves further until the action
    e = random.standard_normal(assumed.n)
    e *= float(t_d > 0) / np.sqrt(e @ output_weight(gains) @ e)
    body = load_plant(path, Deviation(gain=float(random.uniform(0.75, 1.3))))
    return Drawn(body, control, x, x + gap, x + gap + e)


def flights(case: Drawn, q_t: float) -> list[OpenLoopInterval]:
    """At the default tolerance, at a fine timestep, at half of it, and on the linear plant."""
    control, *start = case.sized(q_t)
    settings = Settings(duration=3.0, limit=1e3)
    stepped = (settings, *(replace(settings, timestep=h, integrator="RK4") for h in (TIMESTEP, TIMESTEP / 2)))
    ways = [open_loop(case.body, control, way) for way in stepped]
    ways.append(open_loop_linear(case.body.linearisation.plant, control, settings))  # type: ignore[arg-type]
    return [fly(*start) for fly in ways]


def condition(case: Drawn) -> float:
    """How many times its relative size a change of the threshold moves the linear plant's event; large in a touch."""
    control, *start = case.sized(1.0)
    if not isinstance(trigger := control.trigger, EventTrigger):
        return 0.0
    plant, settings = case.body.linearisation.plant, Settings(duration=3.0, limit=1e3)
    ways = [control.triggered_by(trigger.resized(size)) for size in (1.0, 1 + 1e-6)]
    one, other = (open_loop_linear(plant, way, settings)(*start).length for way in ways)
    return abs(other - one) / one * 1e6


@pytest.mark.slow
@pytest.mark.kernels
def test_random_chains_have_the_same_intervals_whatever_steps_them(tmp_path: Path) -> None:
    compared, least = 0, 25
    for seed in range(CHAINS):
        if compared == least:
            break
        case = drawn(tmp_path, seed)
        if case.control.delay.in_flight(case.control.trigger.clock) > 1 or (touch := condition(case)) > 30:
            continue
        departures = {}
        for q_t in (1e-2, 1e-3):
            chosen, fixed, half, linear = flights(case, q_t)
            # the tolerance is what is stated of the one, Richardson's difference of the other
            stated = 1e-8 * chosen.length * max(touch, 1.0) + 2 * abs(fixed.length - half.length) + 1e-12
            assert abs(chosen.length - fixed.length) <= 10 * stated, seed
            departures[q_t] = abs(chosen.length - linear.length) / linear.length
        # second order in the threshold: a hundredth where it is a tenth, and nothing where both are rounding
        assert departures[1e-2] < 0.2, seed
        assert departures[1e-3] < departures[1e-2] / 30 + 1e-6, seed
        compared += 1
    assert compared == least


@pytest.mark.parametrize("seed", [6, 13, 20, 27])
def test_chains_with_several_predictions_under_way_move_the_same_whatever_steps_them(tmp_path: Path, seed: int) -> None:
    case = drawn(tmp_path, seed)
    assert case.control.delay.in_flight(case.control.trigger.clock) > 1
    departures = []
    for q_t in (1e-2, 1e-3):
        control, x, x_o, _ = case.sized(q_t)
        settings = Settings(duration=0.8, limit=1e3)
        chosen = simulate(case.body, control, settings, x0=x, x_o0=x_o)
        fixed = simulate(case.body, control, replace(settings, timestep=TIMESTEP), x0=x, x_o0=x_o)
        linear = simulate_linear(case.body.linearisation.plant, control, settings, x0=x, x_o0=x_o)
        size = np.abs(linear.x).max(axis=0)
        assert (np.abs(chosen.x[-1] - fixed.x[-1]) < 1e-6 * size).all()
        departures.append(float((np.abs(chosen.x[-1] - linear.x[-1]) / size).max()))
    assert departures[1] < departures[0] / 30 + 1e-6


@pytest.mark.parametrize("shape", [(0.0, 0.02), (0.1, 0.02), (0.1, 0.17), (0.1, 0.3)], ids=str)
@pytest.mark.parametrize("name", ["simple-0.8", "three-link-1.1"])
def test_what_is_sampled_late_has_the_same_events_whatever_steps_it(root: Path, name: str, shape) -> None:
    """Δ_min below, at and above the delays of sampling and action together."""
    delay, delta_min = shape
    control = {"controller.delta_min": delta_min, "controller.sampling_delay": 0.07, "assumed.delay": delay or None}
    plain = {"simulation.timestep": None, "simulation.duration": DURATION}
    case = icmj.prepare(icmj.load_run(root / "runs" / f"{name}.toml").with_(**control, **plain))

    def found(plant: str = "mujoco", **settings: object):
        tables = {f"simulation.{key}": value for key, value in settings.items()}
        return icmj.simulate(revise(case, case.run.with_(**tables)), plant)

    chosen, fixed, half, linear = found(), found(timestep=1e-3), found(timestep=5e-4), found("linear")
    t = fixed.events.t
    assert len(t) >= 2
    assert len(chosen.events) == len(t)
    stated = np.exp(3.2 * t) * (1e-8 * t + 1e-12) + 2 * np.abs(t - half.events.t)
    assert (np.abs(chosen.events.t - t) <= 10 * stated).all()
    assert abs(chosen.events.t[0] - linear.events.t[0]) < 0.02 * linear.events.t[0]
    for run in (chosen, fixed, linear):
        assert np.diff(run.events.t, prepend=-0.07).min() >= max(delta_min, 0.07 + delay) - 1e-9


SHIPPED = sorted(Path(__file__).parents[2].glob("runs/*.toml"))
# (delay, Δ_min) [s]: none, Δ_min below, at, above the delay; at it in numbers that no float holds exactly
SHAPES = ((0.0, 0.01), (0.1, 0.01), (0.1, 0.1), (0.1, 0.25), (0.07, 0.07))
DURATION = 4.0


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: f"delay={shape[0]}, delta_min={shape[1]}")
@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_cases_have_the_same_events_whatever_steps_them(path: Path, shape: tuple[float, float]) -> None:
    delay, delta_min = shape
    changes = {"assumed.delay": delay or None, "controller.delta_min": delta_min, "simulation.duration": DURATION}
    plain = {"simulation.timestep": None, "simulation.tolerance": None, "simulation.integrator": None}
    case = icmj.prepare(icmj.load_run(path).with_(**changes, **plain, **{"simulation.disturbance": []}))
    assert case.run.simulation.timestep is None

    def events(**settings: object) -> np.ndarray:
        tables = {f"simulation.{key}": value for key, value in settings.items()}
        return icmj.simulate(revise(case, case.run.with_(**tables)), "mujoco").events.t

    chosen, fixed, half = events(), events(timestep=1e-3), events(timestep=5e-4)
    linear = icmj.simulate(case, "linear").events.t
    assert len(fixed) >= 2
    assert len(chosen) == len(fixed)
    growth = np.exp(3.2 * fixed)  # the fastest pole of the bodies is at 3.1 rad/s
    stated = growth * (1e-8 * fixed + 1e-12) + 2 * np.abs(fixed - half)
    assert (np.abs(chosen - fixed) <= 10 * stated).all()
    # the first event of all, before the bodies' nonlinearity has grown; leans are of 0.02 rad
    assert abs(chosen[0] - linear[0]) < 0.02 * linear[0]
