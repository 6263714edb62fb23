"""Results for the tests of report and comparison: the shipped plants in closed form, simulated crudely on a grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from icmj.controller import Continuous, Controller, EventTrigger, system_matched
from icmj.design import Design, design_lq
from icmj.linear_plant import LinearPlant
from icmj.measurement import Measurement
from icmj.result import AmplitudeLaw, Growth, Result
from icmj.runfile import parse_run
from icmj.simulation import Events, Outcome, Simulation
from icmj.theory.error_system import ErrorSystem, error_system
from icmj.theory.prediction import Crossing, Locus, Orbit, Prediction

NAMES = {"states": ("hinge", "hinge_rate"), "inputs": ("torque",), "outputs": ("angle",)}
PENDULUM = LinearPlant([[0, 1], [1, 0]], [[0], [1]], [[1, 0]], **NAMES)
FIGURE = {0.8: "simple-gain=0o8", 1.2: "simple-gain=1o2", 1.7: "simple-gain=1o7"}
PAPER = {0.8: (1.8, 1, True), 1.2: (1.53, -1, True), 1.7: (1.1, -1, False)}


def neglected(zeta: float) -> LinearPlant:
    """The pendulum behind the second-order actuator."""
    A = [[0, 1, 0, 0], [1, 0, 0, 1], [0, 0, -20 * zeta, -100], [0, 0, 1, 0]]
    states = (*NAMES["states"], "torque_act0", "torque_act1")
    return LinearPlant(A, [[0], [0], [100], [0]], [[1, 0, 0, 0]], states, NAMES["inputs"], NAMES["outputs"])


def run_text(name: str, title: str, figure: str = "", paper: tuple | None = None, q_t: float = 0.01) -> str:
    """A run file's text."""
    facts = ""
    if paper:
        facts = f"delta_crit = {paper[0]}\neigenvalue = {paper[1]}\ncycle = {str(paper[2]).lower()}\n"
    return (
        f'[case]\nname = "{name}"\ntitle = "{title}"\n[case.paper]\nfigure = "{figure}"\n{facts}'
        f'[assumed]\nmodel = "pendulum.xml"\n[controller]\nq_t = {q_t}\n'
        "[simulation]\nduration = 30.0\ninitial = { hinge = 0.02 }\n"
    )


def simulate(system: ErrorSystem, controller: Controller, x0: np.ndarray, duration: float, plant: str) -> Simulation:
    """Crude event-driven simulation on a 10 ms grid, events by bisection; good enough to draw."""
    trigger = controller.trigger
    n, m, h = system.n, system.n_hat, 0.01
    X = system.from_original(np.concatenate([x0, np.zeros(2 * m)]))
    continuous = isinstance(trigger, Continuous)
    A = system.A_C
    if continuous:  # x̃_h follows x̃_o
        reduce = system.T_bar @ system.T
        A = reduce @ A @ reduce
    M = np.zeros_like(A) if continuous else system.T_t.T @ trigger.Q_t @ system.T_t
    q2 = 0.0 if continuous else trigger.q_t**2
    step, t, last = expm(A * h), 0.0, 0.0
    rows, times, events, marks, extremes = [X], [0.0], [], [], []
    seen = [X]
    while t < duration - 1e-9:
        new, dt = step @ X, h
        if not continuous and new @ M @ new >= q2 and t + h - last > trigger.delta_min:
            crossing = lambda d, X=X: (expm(A * d) @ X) @ M @ (expm(A * d) @ X) - q2  # noqa: E731
            dt = brentq(crossing, 0, h) if crossing(0) < 0 else h
            new = expm(A * dt) @ X
            t += dt
            events.append(new)
            marks.append(t)
            y = np.array([*seen, new]) @ system.C_y.T
            extremes.append((y.max(0), y.min(0)))
            seen, last = [], t
            rows.append(new)
            times.append(t)
            X = system.A_D @ new
        else:
            t += dt
            X = new
            rows.append(X)
            times.append(t)
        seen.append(X)
        if np.abs(X).max() > 1e3:
            break
    rows, events = np.array(rows), np.array(events).reshape(-1, n + 2 * m)
    original, at_events = system.to_original(rows), system.to_original(events)
    ok = np.concatenate([[True], np.diff(times) > 1e-12])
    u = rows @ system.C_u.T if not continuous else -(original[:, n : n + m] @ system.design.k.T)
    E = np.full(len(rows), np.nan) if continuous else np.einsum("ni,ij,nj->n", rows, M, rows) - q2
    y_max = np.array([high for high, _ in extremes]).reshape(-1, system.actual.n_y)
    y_min = np.array([low for _, low in extremes]).reshape(-1, system.actual.n_y)
    return Simulation(
        plant=plant,
        control="continuous" if continuous else "event",
        t=np.array(times)[ok],
        x=original[ok, :n],
        y=(rows @ system.C_y.T)[ok],
        u=u[ok],
        x_o=original[ok, n : n + m],
        x_h=original[ok, n + m :],
        E=E[ok],
        events=Events(np.array(marks), at_events[:, :n], at_events[:, n : n + m], at_events[:, n + m :], y_max, y_min),
        outcome=Outcome("completed", t, "completed"),
        precision={"integrator": "matrix exponential", "order": "exact", "timestep": 0.01, "event_tolerance": 1e-12},
    )


def predict_crudely(system: ErrorSystem, trigger: EventTrigger, delta: float | None, sign: int, cycle: bool):
    """A prediction around a known Δ_crit."""
    grid = np.linspace(0.02, 4.0, 300)
    locus = Locus(grid, np.array([np.sort_complex(np.linalg.eigvals(system.phi(d)).astype(complex)) for d in grid]))
    if delta is None:
        return Prediction(
            None, None, False, None, None, None, (), 4.0, None, None, "none", np.nan, None, True, True, locus, locus
        )
    g = lambda d: np.min(np.abs(np.linalg.eigvals(system.phi(d)) - sign))  # noqa: E731
    fine = np.linspace(delta - 0.02, delta + 0.02, 4001)
    delta = float(fine[np.argmin([g(d) for d in fine])])
    values, V = np.linalg.eig(system.phi(delta))
    order = np.argsort(np.abs(values - sign))
    V = V[:, order]
    others = np.abs(values[order[1:]]).max()
    v = V[:, 0].real * np.sign(V[np.argmax(np.abs(V[:, 0])), 0].real)
    V[:, 0] = v
    M = system.T_t.T @ trigger.Q_t @ system.T_t
    end = expm(system.A_C * delta) @ system.T_bar @ v
    gamma = trigger.q_t / np.sqrt(end @ M @ end)
    t = np.linspace(0, delta, 200)
    X = np.array([expm(system.A_C * s) @ system.T_bar @ v * gamma for s in t])
    y, u = X @ system.C_y.T, X @ system.C_u.T
    peak = lambda a: np.abs(a).max(0)  # noqa: E731
    x = X[:, : system.n]
    E = np.einsum("ni,ij,nj->n", X, M, X) - trigger.q_t**2
    ranges = [np.ptp(np.vstack([a, sign * a]), axis=0) for a in (y, u, x)]
    orbit = Orbit(
        delta, sign, delta if sign > 0 else 2 * delta, gamma, gamma * v, t, X, y, u, X @ system.T_t.T, E,
        peak(y), peak(u), peak(x), *ranges, True, "",
    )  # fmt: skip
    crossing = Crossing(delta, complex(sign), "+1" if sign > 0 else "-1", "rising", float(others))
    multipliers = np.array([0.5, 0.2]) if cycle else np.array([1.19, 0.2])
    return Prediction(
        delta, complex(sign), cycle, orbit.period if cycle else None, gamma, orbit.y_peak, (crossing,), 4.0, orbit,
        multipliers.astype(complex), "attracting" if cycle else "repelling", float(np.linalg.cond(V)),
        np.linalg.inv(V), True, True, locus, locus,
    )  # fmt: skip


def measure_crudely(simulation: Simulation, sign: int, cycle: bool) -> Measurement:
    """Call it a cycle if told so."""
    p = 1 if sign > 0 else 2
    last = simulation.events.interval[-p:]
    peaks = np.maximum(simulation.events.y_max, -simulation.events.y_min)
    if not cycle:
        return Measurement(
            "irregular", None, False, float(simulation.events.interval[-10:].mean()), np.zeros(0), None,
            peaks[-10:].max(0), np.nan, "irregular",
        )  # fmt: skip
    return Measurement(
        "cycle", p, sign < 0, float(last.mean()), last, float(last.sum()), peaks[-p:].max(0), 1e-9, "a cycle"
    )


def pendulum_design() -> Design:
    """The recovered design of the paper's second-order systems."""
    return design_lq(PENDULUM, R_c=0.1, R_o=0.01)


def pendulum_result(b: float = 0.8, plant: str = "linear", duration: float = 30.0) -> Result:
    """One of the paper's simple cases, b = 0.8, 1.2 or 1.7."""
    design, actual = pendulum_design(), PENDULUM.scaled(b)
    delta, sign, cycle = {0.8: (1.807, 1, True), 1.2: (1.528, -1, True), 1.7: (1.112, -1, False)}[b]
    trigger = EventTrigger(design.plant.C.T @ design.plant.C, 0.01)
    controller = Controller(design, system_matched(design), trigger)
    system = error_system(actual, design)
    prediction = predict_crudely(system, trigger, delta, sign, cycle)
    exact = predict_crudely(error_system(PENDULUM, design), trigger, None, 1, False)
    prediction = replace(prediction, locus_exact=exact.locus)
    x0 = np.array([0.02, 0.0])
    simulation = simulate(system, controller, x0, duration, plant)
    run = parse_run(run_text(f"simple-b{b}", f"Simple system, b = {b}", FIGURE[b], PAPER[b]))
    deltas = np.linspace(0.3, 2.5, 8)
    growth = Growth(deltas, np.interp(deltas, prediction.locus.delta, prediction.locus.largest), deltas)
    q_t = np.array([1e-2, 1e-3, 1e-4])
    return Result(
        run, PENDULUM, actual, controller, prediction, simulation,
        simulate(system, controller.triggered_by(Continuous()), x0, duration, plant),
        measure_crudely(simulation, sign, cycle), growth,
        AmplitudeLaw(q_t, 3 * q_t**2, 2 * q_t**2, 2.0, 2.0) if plant == "mujoco" else None,
        provenance={"icmj": "0.1.0", "python": "3.12", "date": "2026-01-01"},
    )  # fmt: skip
