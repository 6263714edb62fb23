"""Runs on the engine that are done twice, compiled in the tests' process and interpreted in one of their own.

``python engine_runs.py OUT.npz`` does them all and writes what they recorded, as ``name/quantity``.
"""

import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from engine_cases import MODELS, controller, plant
from model_cases import CROWDED, HOOKED, MUSCLE, RICH, SERVO, pendulum, written
from tapped_cases import SWITCHING, person

import icmj
from icmj.controller.controller import Controller
from icmj.controller.delay import Delay
from icmj.controller.design import design_lq
from icmj.controller.hold import system_matched
from icmj.controller.law import Law
from icmj.controller.rules.box import BoxTrigger
from icmj.controller.rules.quadratic import EventTrigger
from icmj.controller.setpoint import Target, pulse, ramp, setpoint, sines, step
from icmj.controller.trigger import ClockTrigger, Continuous, Trigger
from icmj.engine.deviation import Deviation
from icmj.engine.open_loop import EngineOpenLoop, open_loop
from icmj.engine.plant import MujocoPlant, load_plant
from icmj.engine.run import simulate
from icmj.plant.activation import Activation
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation.settings import Settings
from icmj.simulation.simulation import Simulation
from icmj.simulation.sources import Bias, Impulse, Noise, Step

Recorded = dict[str, np.ndarray]
ROWS = ("t", "x", "y", "u", "x_o", "x_h")
EVENTS = ("t", "x", "x_o", "x_h", "y_max", "y_min")
DISTURBED = (
    Noise("torque", 0.02, bandwidth=6.0, seed=1, start=0.2),
    Impulse("torque", 0.02, start=0.5003, duration=0.0371),
)
NOISY = (Noise("ankle_torque", 1.0, bandwidth=6.0, seed=1), Noise(output="trunk", size=1e-3, bandwidth=20.0, seed=2))

# on bodies, what joints move and what tendons do, beside commands and errors
ON_TRUNK = Impulse(body="trunk", force=(40.0, 0.0, -15.0), torque=(0.0, 3.0, 0.0), point=(0.02, 0.0, 0.4),
                   size=2e-3, start=0.3003, duration=0.0717)  # fmt: skip
PUSHED = (
    ON_TRUNK, Step("knee_torque", 0.1, 0.5), Noise(body="shank", force=(1.0, 0, 0), size=0.2, bandwidth=3.0, seed=2),
    Noise("ankle_torque", 0.1, corner=1.0, seed=1), Bias("trunk", 1e-3, 0.2),
)  # fmt: skip
RICHLY = (
    Step(body="c", force=(0.1, 0.2, -0.1), torque=(0.01, 0, 0.02), point=(0, 0.1, 0)),
    Impulse("low", 0.02, 0.01, 0.02),
)
SWAYED = Noise("ankle", 2.0, bandwidth=3.0, seed=4), Bias("theta", 1e-2, 0.3), Step("ankle", 1.0, 0.7)
TUGGED = (Step("ankle", 0.5, 0.1),)
CALF = """<tendon><fixed name="calf"><joint joint="lean" coef="0.9"/></fixed></tendon><actuator>
  <motor name="ankle" tendon="calf" gear="20"/></actuator>"""


def recorded(run: Simulation) -> Recorded:
    """What two runs are compared by."""
    found = {name: getattr(run, name) for name in ROWS}
    found |= {f"events.{name}": getattr(run.events, name) for name in EVENTS}
    told = {"outcome": run.outcome.kind, **{name: run.precision[name] for name in ("integrator", "steps")}}
    return found | {name: np.array(value) for name, value in told.items()}


def leaning(
    actual: str, assumed: str, settings: Settings, trigger: Trigger | None = None, delay: Delay | None = None
) -> Recorded:
    """A shipped body that leans at the start."""
    control = controller(assumed, 0.01)
    control = replace(control, delay=delay or Delay(), trigger=trigger or control.trigger)
    body = plant(actual, 0.9)
    x0 = np.zeros(body.linearisation.plant.n)
    x0[0] = 0.02
    return recorded(simulate(body, control, settings, x0=x0, error_estimate=False))


def lagging(settings: Settings) -> Recorded:
    """A shipped body whose muscles the controller does not know, two of the three."""
    muscles = Activation(1, {"ankle_torque": 0.03, "hip_torque": 0.02})
    body = load_plant(MODELS / "three_link.xml", Deviation(gain=0.9), "upright", activation=muscles)
    x0 = np.r_[0.02, np.zeros(7)]
    return recorded(simulate(body, controller("three_link", 0.01), settings, x0=x0, error_estimate=False))


def by_steps(integrator: str = "RK4", **more: object) -> Settings:
    return Settings(**{"duration": 1.5, "timestep": 4e-3, "integrator": integrator, **more})  # type: ignore[arg-type]


def following(
    settings: Settings, trigger: Trigger | None = None, delay: Delay | None = None, late: float = 0.0
) -> Recorded:
    """A shipped body whose set-point moves in every way."""
    control = controller("three_link", 0.003)
    first, last = control.design.plant.outputs[::2]
    moves = (
        Target({first: 1.0}, step(0.02)), Target({first: 1.0}, pulse(-0.03, 0.3003, 0.4)),
        Target({last: 1.0}, ramp(0.02, 0.2, 0.5)), Target({last: 1.0}, sines(0.01, [0.5, 1.7], [0.3, 1.0], 0.1)),
    )  # fmt: skip
    control = replace(
        control,
        delay=delay or Delay(),
        trigger=trigger or control.trigger,
        setpoint=setpoint(control.design.plant, moves),
        sampling_delay=late,
    )
    return recorded(simulate(plant("three_link", 0.9), control, settings, error_estimate=False))


def chosen(tolerance: float, **more: object) -> Settings:
    return Settings(**{"duration": 1.5, "tolerance": tolerance, **more})  # type: ignore[arg-type]


def stranger(body: MujocoPlant, trigger: Trigger) -> Controller:
    """A stable design on some other plant with as many inputs and outputs."""
    n_u, n_y = body.linearisation.plant.n_u, body.linearisation.plant.n_y
    random = np.random.default_rng(5)
    gains = design_lq(LinearPlant(-np.eye(3), random.normal(size=(3, n_u)), random.normal(size=(n_y, 3))))
    return Controller(gains, system_matched(gains), trigger)


def brought(text: str, keyframe: str, deviation: Deviation | None = None) -> MujocoPlant:
    """A model of a user's."""
    with tempfile.TemporaryDirectory() as folder:
        return load_plant(written(Path(folder), text), deviation or Deviation(), keyframe)


def rich(settings: Settings, trigger: Trigger) -> Recorded:
    """A ball joint, velocities among the outputs, several inputs."""
    body = brought(RICH, "up")
    x = 0.1 * np.random.default_rng(1).normal(size=13)
    run = simulate(body, stranger(body, trigger), settings, x0=x[:10], x_o0=x[10:], error_estimate=False)
    return recorded(run)


def driven(text: str, settings: Settings, keyframe: str = "stand", q_t: float = 0.02) -> Recorded:
    """A model of a user's that leans at the start."""
    body = brought(text, keyframe)
    gains = design_lq(body.linearisation.plant)
    n = gains.plant.n
    control = Controller(gains, system_matched(gains), EventTrigger(np.eye(n), q_t))
    return recorded(simulate(body, control, settings, x0=np.r_[0.01, np.zeros(n - 1)], error_estimate=False))


def given_up() -> Recorded:
    """MuJoCo runs out of memory on the way."""
    loose = controller("pendulum").triggered_by(Continuous())
    settings = Settings(duration=2.0, initial={"hinge": 0.5}, limit=9.0, record_interval=0.05)
    body = brought(CROWDED.format(memory="60K"), "upright", Deviation(gain=0.0))
    return recorded(simulate(body, loose, settings, error_estimate=False))


def diverging() -> Recorded:
    """Torques with the wrong sign, far too strong."""
    settings = Settings(duration=60.0, limit=1e300, timestep=0.01)
    wrong = plant("three_link", -40.0)
    run = simulate(wrong, controller("three_link"), settings, x0=0.05 * np.ones(6), error_estimate=False)
    # the last state is of numbers beside which all digits of the one before are rounding
    return {name: value for name, value in recorded(run).items() if name in ("t", "events.t", "outcome", "steps")}


def tapped(law: Law, settings: Settings) -> Recorded:
    """A person whose controller reads delayed outputs."""
    run = simulate(person(), law, settings, x0=np.array([0.1, 0.03]), error_estimate=False)
    return recorded(run) | {"mode": run.mode}


def due_at_once() -> Recorded:
    """The event function is above zero at the start, and waits for Δ_min."""
    start = {"x0": [0.01, 0.0], "x_o0": [0.0, 0.0], "x_h0": [0.5, 0.0]}
    control = controller("pendulum", 0.01, 0.02)
    return recorded(simulate(plant("pendulum", 0.8), control, Settings(duration=0.5), **start, error_estimate=False))


def touching() -> Recorded:
    """E rises above zero and falls again within one step."""
    start, body = {"x0": [0.05, -0.08]}, plant("pendulum", 0.8)
    free = controller("pendulum", 1e3)
    swing = simulate(body, free, Settings(duration=0.8, timestep=1e-4, record_interval=1e-6), **start)
    e = np.abs((swing.x_h - swing.x_o) @ free.design.plant.C[0])
    top = e[: int(np.argmax((e[1:-1] > e[:-2]) & (e[1:-1] > e[2:]))) + 2].max()
    # the threshold as a number of few digits: that of the two runs must be the same
    control = controller("pendulum", float(f"{top * (1 - 1e-5):.7g}"))
    run = simulate(body, control, Settings(duration=0.6, timestep=0.0107), **start, error_estimate=False)
    return recorded(run)


def shipped(name: str) -> Recorded:
    """A shipped case, shortened, as its run file has it."""
    run = icmj.load_run(MODELS.parent / "runs" / f"{name}.toml").with_(**{"simulation.duration": 1.5})
    return recorded(icmj.simulate(icmj.prepare(run), "mujoco"))


def flights() -> Recorded:
    """Two intervals, one after the other."""
    fly = open_loop(plant("three_link", 0.9), controller("three_link"), Settings(duration=6.0))
    first = fly(0.01 * np.ones(6), np.zeros(6))
    second = fly(first.x, first.x_o)
    return {"t": np.array([first.length, second.length]), "x": second.x, "events.y_max": second.y_max}


def neighbours(body: Callable[[], MujocoPlant]) -> Recorded:
    """Rates around some states."""
    fly, rows, moves = around(body())
    return {"rates": fly.rates(rows, moves)}


def around(body: MujocoPlant) -> tuple[EngineOpenLoop, np.ndarray, np.ndarray]:
    """A flight, rows and moves to ask for its rates at."""
    rng, fly = np.random.default_rng(0), open_loop(body, stranger(body, EventTrigger(np.eye(3), 0.02)), Settings())
    model = fly.loop.model
    size = model.nq + model.nv + model.na
    rows = 0.1 * rng.normal(size=(4, size))
    rows[:, : model.nq] += model.qpos0
    moves = 1e-2 * rng.normal(size=(9, size))
    moves[[2, 3, 6, 8], : model.nq + model.nv] = 0.0  # which are not worth going through the positions again
    moves[0] = 0.0
    return fly, rows, moves


BODIES: dict[str, Callable[[], MujocoPlant]] = {
    "three_link": lambda: plant("three_link"),
    "pendulum_neglected": lambda: plant("pendulum_neglected"),
    "muscle": lambda: brought(pendulum(MUSCLE), "stand"),
    "limited": lambda: brought(pendulum(SERVO, joint='limited="true" range="-1 1"'), "stand"),
    "rich": lambda: brought(RICH, "up"),
}
THREE, NEGLECTED = ("three_link", "three_link"), ("pendulum_neglected", "pendulum")
PENDULUM, TICK = ("pendulum", "pendulum"), Delay(0.1)
BOX = BoxTrigger(np.array([0.7, 1.0, 1.5]) * 1e-2)

FIXED: dict[str, Callable[[], Recorded]] = {
    "RK4": partial(leaning, *THREE, by_steps()),
    "clock": partial(leaning, *THREE, by_steps(), ClockTrigger(0.313)),
    "continuous": partial(leaning, *THREE, by_steps(), Continuous()),
    "Euler": partial(leaning, *THREE, by_steps("Euler")),
    "implicitfast": partial(leaning, *THREE, by_steps("implicitfast")),
    "discrete": partial(leaning, *THREE, by_steps("discrete")),
    "pendulum": partial(leaning, *PENDULUM, by_steps(duration=2.5)),
    "neglected": partial(leaning, *NEGLECTED, by_steps(duration=2.5)),
    "pushed": partial(leaning, *PENDULUM, by_steps(duration=2.5, disturbance=DISTURBED)),
    "pushed neglected": partial(leaning, *NEGLECTED, by_steps(duration=2.5, disturbance=DISTURBED)),
    "noisy": partial(leaning, *THREE, by_steps(disturbance=NOISY)),
    "noisy and delayed": partial(leaning, *THREE, by_steps(disturbance=NOISY), None, TICK),
    "delayed": partial(leaning, *THREE, by_steps(), None, Delay(0.1, 0.104)),
    "delayed clock": partial(leaning, *THREE, by_steps(), ClockTrigger(0.21), Delay(0.05, 0.047)),
    "fast clock": partial(leaning, *THREE, by_steps(), ClockTrigger(0.031), TICK),
    "clock on a tick": partial(leaning, *THREE, by_steps(), ClockTrigger(0.025), TICK),
    "box": partial(leaning, *THREE, by_steps(), BOX),
    "box on states": partial(leaning, *THREE, by_steps(), BoxTrigger(np.linspace(1, 3, 6) * 1e-2, "state")),
    "rich": partial(rich, by_steps(duration=0.3, timestep=2e-3, limit=100.0), EventTrigger(np.eye(3), 0.02)),
    "muscles": partial(lagging, by_steps()),
    "servo": partial(driven, pendulum(SERVO), by_steps(duration=1.0)),
    "muscle": partial(driven, pendulum(MUSCLE), by_steps(duration=1.0)),
    "pushed body": partial(leaning, *THREE, by_steps(disturbance=PUSHED)),
    "pushed rich": partial(
        rich, by_steps(duration=0.3, timestep=2e-3, limit=100.0, disturbance=RICHLY), EventTrigger(np.eye(3), 0.02)
    ),
    "pushed tendon": partial(driven, pendulum("").replace("<actuator></actuator>", CALF), by_steps(disturbance=TUGGED)),
    "hooked": partial(driven, HOOKED, by_steps(), "aside", 2e-4),
    "tapped": partial(tapped, SWITCHING, by_steps(duration=2.5)),
    "tapped and pushed": partial(tapped, SWITCHING, by_steps(disturbance=SWAYED)),
    "set-point": partial(following, by_steps()),
    "set-point under a fast clock": partial(following, by_steps(), ClockTrigger(0.031), TICK),
    "set-point, sampled late": partial(following, by_steps(), None, TICK, 0.07),
    "touching": touching,
    "diverging": diverging,
}
CHOSEN: dict[str, Callable[[], Recorded]] = {
    "chosen set-point": partial(following, chosen(1e-6)),
    "chosen set-point with a delay": partial(following, chosen(1e-6), None, TICK),
    "chosen set-point, sampled late": partial(following, chosen(1e-6), None, None, 0.07),
    "chosen, muscles": partial(lagging, chosen(1e-6, duration=0.8)),
    "chosen, loose": partial(leaning, *THREE, chosen(1e-2)),
    "chosen": partial(leaning, *THREE, chosen(1e-6)),
    "chosen, delayed clock": partial(leaning, *THREE, chosen(1e-6), ClockTrigger(0.313), TICK),
    "chosen, delayed": partial(leaning, *THREE, chosen(1e-6), EventTrigger(np.eye(6), 0.02, 0.1), TICK),
    "chosen, pushed neglected": partial(leaning, *NEGLECTED, chosen(1e-6, disturbance=DISTURBED)),
    "chosen, pushed and delayed": partial(leaning, *PENDULUM, chosen(1e-6, disturbance=DISTURBED), None, Delay(0.2)),
    "chosen, continuous": partial(leaning, *PENDULUM, chosen(1e-6), Continuous()),
    "chosen, pushed body": partial(leaning, *THREE, chosen(1e-5, disturbance=PUSHED)),
    "chosen, hooked": partial(driven, HOOKED, chosen(1e-6), "aside", 2e-4),
    "chosen, tapped": partial(tapped, SWITCHING, chosen(1e-6, duration=2.5)),
    "chosen, tapped and pushed": partial(tapped, SWITCHING, chosen(1e-6, disturbance=SWAYED)),
    "balls": partial(rich, Settings(duration=0.2, tolerance=1e-5, limit=100.0), Continuous()),
    "due at once": due_at_once,
    "flights": flights,
    "simple-0.8": partial(shipped, "simple-0.8"),
    "three-link-0.9-delay": partial(shipped, "three-link-0.9-delay"),
}
OTHERS: dict[str, Callable[[], Recorded]] = {
    "given up": given_up,
    **{f"around {name}": partial(neighbours, body) for name, body in BODIES.items()},
}
RUNS = FIXED | CHOSEN | OTHERS


if __name__ == "__main__":
    # where neither MuJoCo's structs are declared nor there is a compiler
    sys.modules["mujoco.introspect"] = sys.modules["numba"] = None  # type: ignore[assignment]
    np.savez(sys.argv[1], **{f"{name}/{key}": value for name, run in RUNS.items() for key, value in run().items()})
