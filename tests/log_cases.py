"""Small results to write logs from: made here with matrix exponentials, not with the simulators of the package."""

import functools
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from icmj import Controller, Deviation, LinearPlant, MujocoPlant, Prediction, RunFile, load_plant, parse_run
from icmj.case.result import AmplitudeLaw, Growth, Result
from icmj.controller.design import Design, design_lq, output_weight
from icmj.controller.hold import system_matched
from icmj.controller.rules.quadratic import EventTrigger
from icmj.engine.linearisation import linearise
from icmj.engine.pose import make_scene
from icmj.measurement.measurement import Measurement
from icmj.simulation.ending import Outcome
from icmj.simulation.pressure import Pressure
from icmj.simulation.simulation import Events, Simulation
from icmj.theory.crossings import Crossing
from icmj.theory.error_system import ErrorSystem, error_system
from icmj.theory.orbit import Orbit

MODELS = Path(__file__).parent.parent / "models"
TEXT = """# a comment with ζ, kept
[case]
name = "made-up"
title = "Made-up case"
[assumed]
model = "models/{model}.xml"
[controller]
q_t = {q_t}
"""


def run_events(
    system: ErrorSystem, trigger: EventTrigger, x_0: np.ndarray, duration: float, step: float
) -> tuple[Simulation, np.ndarray]:
    """Event-driven control of a linear plant on a grid, events by root finding."""
    M = system.T_t.T @ trigger.Q_t @ system.T_t
    t = np.arange(0, duration + step / 2, step)
    X = system.T_bar @ np.concatenate([x_0, -system.T_hat @ x_0])
    start, last, rows, sampled, times, before = X, 0.0, [], [], [], []

    def E(at: float) -> float:
        Z = expm(system.A_C * (at - last)) @ start
        return float(Z @ M @ Z) - trigger.q_t**2

    grid = expm(system.A_C * step)
    for i, now in enumerate(t):
        if i:
            X_next = grid @ X
            while X_next @ M @ X_next >= trigger.q_t**2 and now - last > 1e-6:
                at = brentq(E, max(now - step, last + 1e-9), now, xtol=1e-13)
                X_event = expm(system.A_C * (at - last)) @ start
                times.append(at)
                before.append(X_event)
                rows.append(X_event)
                sampled.append(at)
                last, start = at, system.T_bar @ (system.T @ system.A_D @ X_event)
                X_next = expm(system.A_C * (now - at)) @ start
            X = X_next
        rows.append(X)
        sampled.append(now)
    t = np.array(sampled)
    Z, K = system.to_original(np.array(rows)), len(times)
    n, m = system.n, system.n_hat
    W = system.to_original(np.array(before).reshape(K, n + 2 * m))
    R = np.array(rows)
    y = Z[:, :n] @ system.actual.C.T
    events = Events(np.array(times), W[:, :n], W[:, n : n + m], W[:, n + m :], *(np.zeros((K, system.actual.n_y)),) * 2)
    values = np.einsum("ij,jk,ik->i", R, M, R) - trigger.q_t**2
    u = -Z[:, n + m :] @ system.design.k.T
    return (
        Simulation(
            *("linear", "event", t, Z[:, :n], y, u, Z[:, n : n + m], Z[:, n + m :], values, events),
            Outcome("completed", float(t[-1]), "Ran to the end."),
            {"integrator": "matrix exponential", "order": 0, "event_tolerance": 1e-13},
        ),
        np.array(before),
    )


def run_continuous(actual: LinearPlant, design: Design, x_0: np.ndarray, duration: float, step: float) -> Simulation:
    """u = −k̂ x_o on the same plant."""
    n, m = actual.n, design.plant.n
    A = np.block([[actual.A, -actual.B @ design.k], [design.L @ actual.C, design.A_c - design.L @ design.plant.C]])
    grid, t = expm(A * step), np.arange(0, duration + step / 2, step)
    rows = [np.concatenate([x_0, np.zeros(m)])]
    for _ in t[1:]:
        rows.append(grid @ rows[-1])
    Z = np.array(rows)
    x, x_o = Z[:, :n], Z[:, n:]
    none = np.zeros((0, 1))
    return Simulation(
        *("linear", "continuous", t, x, x @ actual.C.T, -x_o @ design.k.T, x_o, x_o, np.full(len(t), np.nan)),
        Events(np.zeros(0), *(none,) * 5),
        Outcome("completed", float(t[-1]), "Ran to the end."),
    )


def predict_by_hand(system: ErrorSystem, trigger: EventTrigger, delta: float) -> Prediction:
    """Prediction from the eigenvalue of φ nearest the circle at a known Δ_crit (refined by root finding)."""

    def off(at: float) -> float:
        return float(np.min(np.abs(np.abs(np.linalg.eigvals(system.phi(at))) - 1) + 0) * _side(system, at))

    delta = brentq(off, 0.97 * delta, 1.03 * delta, xtol=1e-13)
    values, V = np.linalg.eig(system.phi(delta))
    order = np.argsort(np.abs(np.abs(values) - 1))
    values, V = values[order], V[:, order]
    V_inv = np.linalg.inv(V)
    v = V[:, 0].real / np.linalg.norm(V[:, 0].real)
    t = np.linspace(0, delta, 201)
    M = system.T_t.T @ trigger.Q_t @ system.T_t
    X = np.array([expm(system.A_C * tau) @ system.T_bar @ v for tau in t])
    gamma = trigger.q_t / float(np.sqrt(X[-1] @ M @ X[-1]))
    X = gamma * X
    sign = int(np.sign(values[0].real))
    y, u, e = X @ system.C_y.T, X @ system.C_u.T, X @ system.T_t.T
    E = np.einsum("ij,jk,ik->i", X, M, X) - trigger.q_t**2
    peaks = [np.abs(a).max(axis=0) for a in (y, u, X[:, : system.n])]
    orbit = Orbit(
        *(delta, sign, delta * (1 if sign > 0 else 2), gamma, gamma * v, t, X, y, u, e, E, *peaks),
        *(2 * p for p in peaks),
        admissible=True,
        reason="",
    )
    crossing = Crossing(delta, complex(sign), "+1" if sign > 0 else "-1", "rising", float(np.abs(values[1])))
    return Prediction(
        *(delta, complex(sign), True, orbit.period, gamma, peaks[0], (crossing,), 2 * delta, orbit),
        *(values[1:].astype(complex), "attracting", float(np.linalg.cond(V)), V_inv.astype(complex), True, True),
    )


def _side(system: ErrorSystem, at: float) -> float:
    values = np.linalg.eigvals(system.phi(at))
    return 1.0 if np.abs(values).max() > 1 else -1.0


@functools.cache
def made_up(
    model: str = "pendulum", gain: float = 0.8, delta: float = 1.807, duration: float = 20.0, *, step: float = 0.01
) -> tuple[Result, MujocoPlant]:
    """A complete result of one case, and its plant."""
    three = model == "three_link"
    weights = {"R_c": 5e-7, "R_o": 2e-7} if three else {"R_c": 0.1, "R_o": 0.01}
    q_t = 0.01
    plant = load_plant(MODELS / f"{model}.xml", Deviation(gain), "upright")
    assumed = linearise(load_plant(MODELS / f"{model}.xml", keyframe="upright").spec.compile(), "upright").plant
    design = design_lq(assumed, **weights)
    actual = plant.linearisation.plant
    trigger = EventTrigger(output_weight(design), q_t)
    system = error_system(actual, design)
    x_0 = np.zeros(actual.n)
    x_0[: actual.n // 2] = 0.02
    simulation, _ = run_events(system, trigger, x_0, duration, step)
    run = parse_run(TEXT.format(model=model, q_t=q_t), "runs/made-up.toml")
    amplitude = np.abs(simulation.y[len(simulation.t) // 2 :]).max(axis=0)
    interval = float(simulation.events.interval[-1]) if len(simulation.events) else None
    kind, intervals = "cycle" if interval else "no events", simulation.events.interval[-1:]
    motion = (kind, 1, False, interval, intervals, interval, amplitude)
    measured = Measurement(*motion, 1e-9, "It settled on a cycle.")
    result = Result(
        run,
        assumed,
        actual,
        Controller(design, system_matched(design), trigger),
        predict_by_hand(system, trigger, delta),
        simulation,
        measured,
        continuous=run_continuous(actual, design, x_0, duration, step),
        growth=Growth(np.array([1.0, 2.0]), np.array([0.9, np.nan]), np.array([0.91, 1.1])),
        law=AmplitudeLaw(np.array([1e-2, 1e-3]), np.array([2e-4, 2e-6]), np.array([1e-4, 1e-6]), 2.0, 2.0),
        provenance={"icmj": "0.1.0", "git": "0123abc"},
    )
    return result, plant


def standing() -> Result:
    """The same, of a body that stands on heel and toe, with numbers of its own: the toe lifts for one row."""
    result, _ = made_up(duration=20.0)
    simulation = result.simulation
    rng, events = np.random.default_rng(1), simulation.events
    N, K = len(simulation.t), len(events)
    load = 300 + 10 * rng.standard_normal((N + K, 2))
    load[5] = 600, 0
    x = (load @ [-0.07, 0.18]) / load.sum(axis=1)
    centre = np.column_stack([x, 0 * x])
    pressure = Pressure(
        simulation.t, centre[:N], np.array([0.055, 0.0]), ("heel", "toe"), load[:N], np.array([300.0, 300.0]),
        events.t, centre[N:], load[N:],
    )  # fmt: skip
    return replace(result, simulation=replace(simulation, pressure=pressure))


def with_scene(result: Result, plant: MujocoPlant, magnification: float = 10.0) -> Result:
    """The same with 3D poses."""
    return replace(result, scene=make_scene(plant, result.simulation, magnification))


def assert_same(a: Any, b: Any, where: str = "result") -> None:
    """Equal down to types, dtypes and bits."""
    assert type(a) is type(b), where
    if isinstance(a, np.ndarray):
        assert (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes()), where
    elif isinstance(a, RunFile):
        assert (a.text, a.path, a) == (b.text, b.path, b), where
    elif is_dataclass(a):
        for field in fields(a):
            assert_same(getattr(a, field.name), getattr(b, field.name), f"{where}.{field.name}")
    elif isinstance(a, tuple | list):
        assert len(a) == len(b), where
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_same(x, y, f"{where}[{i}]")
    elif isinstance(a, dict):
        assert a.keys() == b.keys(), where
        for key in a:
            assert_same(a[key], b[key], f"{where}[{key}]")
    else:
        assert a == b or a != a, where


def awkward() -> Result:
    """A result with everything that formats like to lose."""
    result, _ = made_up(duration=3.0)
    x = result.simulation.x.copy()
    x[0, 0], x[1, 0], x[2, 0], x[3, 0] = -0.0, np.inf, np.nextafter(0, 1), 0.1 + 0.2
    x[4, 1] = np.frombuffer(np.uint64(0x7FF8_0000_0000_BEEF).tobytes())[0]  # a NaN with a payload
    precision = {"order": 4, "error": 1 / 3, "name": "RK4 „quoted“\n", "none": float("nan"), "big": 10**15}
    return replace(result, simulation=replace(result.simulation, x=x, precision=precision))
