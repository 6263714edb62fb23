"""Plants, controllers and an independent simulator for the tests of the linear part."""

from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from icmj import Controller, Design, LinearPlant, Settings, design_lq, system_matched, zero_order
from icmj.controller.rules.quadratic import EventTrigger, as_weight
from icmj.controller.trigger import Continuous
from icmj.runfile.run_tables import SimulationTable

PENDULUM = LinearPlant([[0, 1], [1, 0]], [[0], [1]], [[1, 0]], ("hinge", "hinge_rate"), ("torque",), ("angle",))


def pendulum_design() -> Design:
    """The recovered design of the paper's second-order systems."""
    return design_lq(PENDULUM, R_c=0.1, R_o=0.01)


PLANT = PENDULUM.scaled(0.9)


def continuous() -> Controller:
    """The pendulum's, without events."""
    return replace(event_controller(pendulum_design()), trigger=Continuous())


def driven() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(A, B, C) of plant and observer under continuous control, driven by (d, n)."""
    d = pendulum_design()
    P = d.plant
    A = np.block([[PLANT.A, -PLANT.B @ d.k], [d.L @ PLANT.C, P.A - d.L @ P.C - P.B @ d.k]])
    B = np.block([[PLANT.B, np.zeros((2, 1))], [np.zeros((2, 1)), d.L]])
    return A, B, np.hstack([PLANT.C, np.zeros((1, 2))])


def neglected(zeta: float) -> LinearPlant:
    """The pendulum behind ω_n²/(s² + 2ζω_n s + ω_n²), ω_n = 10 rad/s."""
    A = [[0, 1, 0, 0], [1, 0, 1, 0], [0, 0, 0, 1], [0, 0, -100, -20 * zeta]]
    names = ("hinge", "hinge_rate", "torque", "torque_d")
    return LinearPlant(A, [[0], [0], [0], [100]], [[1, 0, 0, 0]], names, ("torque",))


def event_controller(design, *, Q_t="output", q_t=0.01, delta_min=0.01, hold="system-matched") -> Controller:
    held = system_matched(design) if hold == "system-matched" else zero_order(design)
    return Controller(design, held, EventTrigger(as_weight(Q_t, design), q_t, delta_min))


def settings(duration=20.0, **more) -> Settings:
    return Settings(duration=duration, **{"limit": 1e6, **more})


def settings_from(table) -> Settings:
    """Settings from a run file's table."""
    return SimulationTable.model_validate(table).settings()


def random_loop(seed: int, n: int, n_hat: int, n_u: int, n_y: int) -> tuple[LinearPlant, Design]:
    """A random assumed plant of order n̂ with an LQ design, and an actual plant of order n near it."""
    random = np.random.default_rng(seed)
    A_hat = random.standard_normal((n_hat, n_hat))
    assumed = LinearPlant(A_hat, random.standard_normal((n_hat, n_u)), random.standard_normal((n_y, n_hat)))
    design = design_lq(assumed, R_c=0.1, R_o=0.01)
    A = np.zeros((n, n))
    A[:n_hat, :n_hat] = A_hat + 0.1 * random.standard_normal((n_hat, n_hat))
    if n > n_hat:
        A[n_hat:, n_hat:] = -np.diag(random.uniform(3, 8, n - n_hat))
        A[:n_hat, n_hat:] = 0.1 * random.standard_normal((n_hat, n - n_hat))
        A[n_hat:, :n_hat] = 0.1 * random.standard_normal((n - n_hat, n_hat))
    B = np.vstack([assumed.B * 1.1, 0.1 * random.standard_normal((n - n_hat, n_u))])
    C = np.hstack([assumed.C, 0.05 * random.standard_normal((n_y, n - n_hat))])
    return LinearPlant(A, B, C), design


def loop_matrix(plant: LinearPlant, controller: Controller) -> np.ndarray:
    """ẋ of the closed loop in the original coordinates (x, x_o, x_h), written down from the paper's equations."""
    d, P = controller.design, controller.design.plant
    return np.block([
        [plant.A, np.zeros((plant.n, P.n)), -plant.B @ d.k],
        [d.L @ plant.C, P.A - d.L @ P.C, -P.B @ d.k],
        [np.zeros((P.n, plant.n)), np.zeros((P.n, P.n)), controller.hold.A_h],
    ])  # fmt: skip


def ivp_events(plant, controller, duration, x, x_o, torque=None, max_step=0.02, reading=None):
    """Event times and (x, x_o, x_h) before each reset, by SciPy's DOP853 with event location."""
    M, trigger = loop_matrix(plant, controller), controller.trigger
    n, m = plant.n, controller.design.plant.n
    N = np.vstack([plant.B, np.zeros((2 * m, plant.n_u))])

    heard = np.vstack([np.zeros((n, plant.n_y)), controller.design.L, np.zeros((m, plant.n_y))])

    def rhs(t, z):
        rate = M @ z if torque is None else M @ z + N @ torque(t)
        return rate if reading is None else rate + heard @ reading(t)

    def E(t, z):
        e = z[n + m :] - z[n : n + m]
        return e @ trigger.Q_t @ e - trigger.q_t**2

    E.terminal, E.direction = True, 1
    t, z, times, states = 0.0, np.concatenate([x, x_o, x_o]), [], []
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-15, "max_step": max_step}
    while t < duration:
        ready = min(t + trigger.delta_min, duration)
        if ready > t:
            z = solve_ivp(rhs, (t, ready), z, **options).y[:, -1]
        t = ready
        if t >= duration:
            break
        if E(t, z) < 0:
            run = solve_ivp(rhs, (t, duration), z, events=E, **options)
            t, z = run.t[-1], run.y[:, -1]
            if run.status != 1:
                break
        times.append(t)
        states.append(z.copy())
        z[n + m :] = z[n : n + m]
    return np.array(times), np.array(states)


def ivp_run(
    plant, controller, duration, x, x_o, x_h=None, *, torque=None, reading=None, share=None, bends=(), max_step=0.02
):
    """A run by SciPy's DOP853, restarted wherever something is due, straight from the words of the paper.

    An event is taken up at once, or with a delay acts later by a prediction: the model, run by the matrix exponential
    through the resets that are still to come. Noise is ``share`` times the command, bent at times ``bends``.
    Returns event times, (x, x_o, x_h) just before each, and the last state.
    """
    M, trigger, delay = loop_matrix(plant, controller), controller.trigger, controller.delay
    n, m, d = plant.n, controller.design.plant.n, controller.design
    model = np.block([[d.plant.A, -d.plant.B @ d.k], [np.zeros((m, m)), controller.hold.A_h]])
    drive = np.vstack([plant.B, np.zeros((2 * m, plant.n_u))])
    heard = np.vstack([np.zeros((n, plant.n_y)), d.L, np.zeros((m, plant.n_y))])
    faces, least = trigger.faces(d), max(trigger.delta_min, delay.t_d)

    def rhs(t, z):
        rate = M @ z
        rate = rate if torque is None else rate + drive @ torque(t)
        rate = rate if share is None else rate - drive @ (share(t) * (d.k @ z[n + m :]))
        return rate if reading is None else rate + heard @ reading(t)

    def E(t, z):
        return float(faces.levels(z[n + m :] - z[n : n + m]).max()) if len(faces) else -1.0

    E.terminal, E.direction = True, 1
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-15, "max_step": max_step}
    under_way = []  # (when it acts, when that is expected, the prediction)
    t, z = 0.0, np.concatenate([x, x_o, x_o if x_h is None else x_h])
    times, states, ready, tick = [], [], 0.0, 1

    def taken_up(t, z):
        if not delay:
            z[n + m :] = z[n : n + m]
            return
        state, now = z[n:].copy(), t
        for _, expected, prediction in under_way:
            if expected > t + 1e-9:
                state, now = expm(model * (expected - now)) @ state, expected
                state[m:] = prediction
        end = t + delay.predicted
        under_way.append((t + delay.t_d, end, (expm(model * (end - now)) @ state)[:m]))

    taken_up(t, z)
    ready = least
    while t < duration - 1e-12:
        clock = tick * trigger.clock
        act = under_way[0][0] if under_way else np.inf
        bend = min((at for at in bends if at > t + 1e-12), default=np.inf)
        stop = min(duration, clock, act, bend, np.inf if t >= ready - 1e-12 or not len(faces) else ready)
        fired = bool(len(faces)) and t >= ready - 1e-12 and E(t, z) >= 0
        if not fired and stop > t + 1e-13:
            watched = {"events": E} if len(faces) and t >= ready - 1e-12 else {}
            part = solve_ivp(rhs, (t, stop), z, **options, **watched)
            t, z, fired = part.t[-1], part.y[:, -1].copy(), part.status == 1
        if abs(t - act) < 1e-12:
            z[n + m :] = under_way.pop(0)[2]
        if abs(t - clock) < 1e-12:
            fired, tick = True, tick + 1
        if fired:
            times.append(t)
            states.append(z.copy())
            taken_up(t, z)
            ready = t + least
    return np.array(times), np.array(states).reshape(-1, n + 2 * m), z
