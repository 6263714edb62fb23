"""The closed loop on MuJoCo by others: the bare plant, the paper's equations in numpy, SciPy's integrator."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from icmj import Controller, EventTrigger, MujocoPlant
from icmj.engine.closed_loop import ComposedLoop
from icmj.engine.isolation import isolate_engine
from icmj.engine.native.field import callbacks


class Flight(NamedTuple):
    """One open-loop interval: its length [s], the extremes of the outputs in it, and these at its end."""

    length: float
    y_max: np.ndarray
    y_min: np.ndarray
    y: np.ndarray


class Equations(NamedTuple):
    """The right-hand side of (x, muscles, x_o, x_h), and the outputs as departure."""

    flow: Callable[[float, np.ndarray], np.ndarray]
    outputs: Callable[[np.ndarray], np.ndarray]


def equations(body: MujocoPlant, control: Controller, lags: Sequence[tuple[float, ...]] = ()) -> Equations:
    """The closed loop between events; for joints that turn about one axis, and plain motors.

    Where each motor has a lag, (τ,) or (ω₀, ζ), x goes on with what these keep: a, or a' and a. u = −k x_h,
    x_h' = A_h x_h, x_o' = A x_o + B u + L (y − C x_o).
    """
    gains, point, y_0 = control.design, body.linearisation.point, body.linearisation.y
    A, B, C = gains.plant.A, gains.plant.B, gains.plant.C
    model = body.spec.copy().compile()
    data, nv, size, b = mujoco.MjData(model), model.nv, len(A), body.linearisation.ports.b
    ends = 2 * nv + np.cumsum([len(lag) for lag in lags], dtype=int)
    assert model.nq == nv
    assert model.na == 0

    def outputs(s: np.ndarray) -> np.ndarray:
        """y as departure; leaves the accelerations under u in the data."""
        data.qpos[:], data.qvel[:] = point.qpos + s[:nv], point.qvel + s[nv : 2 * nv]
        data.ctrl[:] = point.ctrl + (s[ends - 1] if lags else -b * (gains.k @ s[-size:]))
        mujoco.mj_forward(model, data)
        return np.array(data.sensordata) - y_0

    def flow(t: float, s: np.ndarray) -> np.ndarray:
        y, seen, held = outputs(s), s[-2 * size : -size], s[-size:]
        u = -gains.k @ held
        muscles: list[float] = []
        for lag, end, wanted in zip(lags, ends, b * u, strict=bool(lags)):
            rate, a = s[end - 2 : end]
            if len(lag) == 1:
                muscles.append((wanted - a) / lag[0])
            else:
                muscles += [lag[0] ** 2 * (wanted - a) - 2 * lag[1] * lag[0] * rate, rate]
        return np.concatenate([
            s[nv : 2 * nv], data.qacc, muscles, A @ seen + B @ u + gains.L @ (y - C @ seen), control.hold.A_h @ held,
        ])  # fmt: skip

    return Equations(flow, outputs)


def course(body: MujocoPlant, control: Controller, x: np.ndarray, x_o: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The states (x, x_o, x_h) at times ``t`` after an event; outputs follow with ``equations(…).outputs``.

    By DOP853 at 1e-12 in steps of a third of the fastest time constant: between its own steps it errs as others do.
    """
    parts = body.linearisation.plant.A, control.design.A_o, control.hold.A_h
    fastest = max(float(np.abs(np.linalg.eigvals(A)).max()) for A in parts)
    run = solve_ivp(
        equations(body, control).flow, (0, t[-1]), np.concatenate([x, x_o, x_o]), "DOP853",
        t_eval=t, rtol=1e-12, atol=1e-17, max_step=0.3 / fastest,
    )  # fmt: skip
    return np.asarray(run.y.T)


def flight(
    body: MujocoPlant, control: Controller, x: np.ndarray, x_o: np.ndarray, lags: Sequence[tuple[float, ...]] = ()
) -> Flight:
    """From right after an event to the next, |e|² = q_t² in the norm of Q_t with e = x_h − x_o, by DOP853 at 1e-12."""
    trigger, size = control.trigger, len(x_o)
    assert isinstance(trigger, EventTrigger)
    flow, outputs = equations(body, control, lags)

    def event(t: float, s: np.ndarray) -> float:
        e = s[-size:] - s[-2 * size : -size]
        return float(e @ trigger.Q_t @ e) - trigger.q_t**2

    event.terminal, event.direction = True, 1  # type: ignore[attr-defined]
    start = np.concatenate([x, x_o, x_o])
    run = solve_ivp(flow, (0, 5), start, "DOP853", events=event, rtol=1e-12, atol=1e-15, dense_output=True)
    high, low = extremes(lambda t: outputs(run.sol(t)), run.t[-1])
    return Flight(float(run.t[-1]), high, low, outputs(run.sol(run.t[-1])))


def extremes(signal: Callable[[float], np.ndarray], end: float, samples: int = 301) -> tuple[np.ndarray, np.ndarray]:
    """Largest and smallest values of a smooth signal on [0, end], by Brent's method around its largest samples."""
    t = np.linspace(0, end, samples)
    y = np.array([signal(instant) for instant in t])
    found = []
    for sign in (1.0, -1.0):
        best = (sign * y).max(axis=0)
        for i, at in enumerate((sign * y).argmax(axis=0)):
            around = t[max(at - 1, 0)], t[min(at + 1, samples - 1)]
            top = minimize_scalar(
                lambda instant, i=i, sign=sign: -sign * signal(instant)[i],
                bounds=around, method="bounded", options={"xatol": 1e-12},
            )  # fmt: skip
            best[i] = max(best[i], -top.fun)
        found.append(sign * best)
    return found[0], found[1]


def rates(loop: ComposedLoop, rows: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """(qvel, qacc, act_dot) by ``mj_forward`` with the callbacks at all ``rows``, moved by each of ``moves``."""
    model, data = loop.model, mujoco.MjData(loop.model)
    cuts, found = [model.nq, model.nq + model.nv], np.zeros((len(rows), len(moves), 2 * model.nv + model.na))
    with isolate_engine(*callbacks()):
        for row, out in zip(rows, found, strict=True):
            for place, rate in zip(row + moves, out, strict=True):
                data.qpos[:], data.qvel[:], data.act[:] = np.split(place, cuts)
                mujoco.mj_forward(model, data)
                rate[:] = np.concatenate([data.qvel, data.qacc, data.act_dot])
    return found
