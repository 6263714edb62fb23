"""A linear plant under intermittent control that follows r(t), by SciPy's DOP853, from the words of the rule.

States are absolute: x, x_o and x_h; r is a function, and r_h the set-point that was last taken up. Nothing is counted
from anything else, and r is no state: it begins anew wherever r or its rate jumps, or something is due.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

OPTIONS = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-15, "max_step": 0.02}


def follow(
    plant,
    controller,
    steady: tuple[np.ndarray, np.ndarray],
    r: Callable,
    edges: Sequence[float],
    duration: float,
    x,
    x_o,
):
    """Events, (x, x_o, x_h) just before each, and the last; ``r(t, side)`` is r on the left (−1) or right (+1) of t."""
    d, trigger, delay = controller.design, controller.trigger, controller.delay
    P, k, (x_ss, u_ss), A_h = d.plant, d.k, steady, controller.hold.A_h
    n, m = plant.n, d.plant.n
    faces, least = trigger.faces(d), max(trigger.delta_min, controller.sampling_delay + delay.t_d)
    continuous = trigger.kind == "continuous"
    r_h = r(0.0, 1)

    def wanted(r):
        return x_ss @ r

    def command(x_h, r):
        return -k @ (x_h - wanted(r)) + u_ss @ r

    def rate(t, z, side=1):
        x, x_o, x_h = z[:n], z[n : n + m], z[n + m :]
        u = command(x_o, r(t, side)) if continuous else command(x_h, r_h)
        model = P.A @ x_o + P.B @ u + d.L @ (plant.C @ x - P.C @ x_o)
        return np.concatenate([plant.A @ x + plant.B @ u, model, A_h @ (x_h - wanted(r_h))])

    def E(t, z, side=1):
        e = (z[n + m :] - wanted(r_h)) - (z[n : n + m] - wanted(r(t, side)))
        return float(faces.levels(e).max()) if len(faces) and not continuous else -1.0

    def predicted(x, x_h, r_h, until):
        """Model and hold ``until`` later, which go on from x and x_h with r_h, by an exponential with a constant."""
        M = np.zeros((2 * m + 1, 2 * m + 1))
        M[:m, :m], M[:m, m:-1], M[:m, -1] = P.A, -P.B @ k, P.B @ (k @ wanted(r_h) + u_ss @ r_h)
        M[m:-1, m:-1], M[m:-1, -1] = A_h, -A_h @ wanted(r_h)
        end = expm(M * until) @ np.concatenate([x, x_h, [1.0]])
        return end[:m], end[m:-1]

    under_way, times, states = [], [], []
    late, sample = controller.sampling_delay, np.inf
    t, z, tick = 0.0, np.concatenate([x, x_o, x_o]), 1

    def taken_up():
        nonlocal z, r_h
        now = r(t, 1)
        if not delay:
            z[n + m :], r_h = z[n : n + m], now
            return
        at, x_at, x_h, of = t, z[n : n + m], z[n + m :], r_h
        for _, expected, state, its in under_way:
            if expected > t + 1e-9:
                x_at, _ = predicted(x_at, x_h, of, expected - at)
                at, x_h, of = expected, state, its
        end = t + delay.predicted
        under_way.append((t + delay.t_d, end, predicted(x_at, x_h, of, end - at)[0], now))

    if not continuous:
        taken_up()
    ready = least - late  # as if the threshold had been reached so long before
    while t < duration - 1e-12:
        clock, act = min(tick * trigger.clock, sample), under_way[0][0] if under_way else np.inf
        edge = min([at for at in edges if at > t + 1e-13], default=np.inf)
        watched = len(faces) and t >= ready - 1e-12 and sample == np.inf
        fired = watched and E(t, z) >= 0
        stop = min(duration, clock, act, edge, np.inf if watched or not len(faces) else ready)
        if not fired and stop > t + 1e-13:
            events = lambda t, z: E(t, z, -1) if t >= stop - 1e-12 else E(t, z)  # noqa: B023, E731
            events.terminal, events.direction = True, 1
            part = solve_ivp(
                lambda t, z: rate(t, z, -1 if t >= stop - 1e-12 else 1),  # noqa: B023
                (t, stop), z, **OPTIONS, **({"events": events} if watched else {}),
            )  # fmt: skip
            t, z, fired = part.t[-1], part.y[:, -1].copy(), part.status == 1
            watched = len(faces) and t >= ready - 1e-12 and sample == np.inf
            fired = fired or (bool(watched) and t < duration and E(t, z) >= 0)
        if abs(t - act) < 1e-12:
            _, _, z[n + m :], r_h = under_way.pop(0)
            fired = bool(watched) and t < duration - 1e-12 and E(t, z) >= 0
        sampled = abs(t - clock) < 1e-12
        if fired and late:
            sample, ready, fired = t + late, t + least, False
        if sampled:
            fired, tick, sample = True, tick + 1, np.inf
        if fired:
            times.append(t)
            states.append(z.copy())
            taken_up()
            ready = ready if late else t + least
    return np.array(times), np.array(states).reshape(-1, n + 2 * m), z
