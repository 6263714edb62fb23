"""What is icmj, in 150 lines without it?
======================================

Intermittent control of a standing person, written with numpy, SciPy, MuJoCo, python-control and rerun alone: the model,
its linearisation, the design, the theory's critical interval, the simulation with events, and the comparison. Events
are looked for once a step, and late by up to one; the package locates them, for any model, controller and delay.
``CONTRIBUTING.md`` lists its files in this order. It writes ``by_hand.rrd``, which ``rerun by_hand.rrd`` shows.
"""

from pathlib import Path

import control
import mujoco
import numpy as np
import rerun as rr
from scipy.linalg import expm
from scipy.optimize import brentq

# 1. Three links on fixed feet, torques at ankle, knee and hip; what is measured are the angles of the links to the
#    vertical. The controller assumes that a torque is what it commands; in fact it is b times that.
here = Path(__file__).parents[1] if "__file__" in globals() else Path()  # a notebook: beside a folder models/
MODEL = here / "models" / "three_link.xml"
b, q_t, n, n_u = 0.9, 0.01, 6, 3  # threshold of events [rad], numbers of states and of torques
start = [0.02, 0.0, 0.0]  # rad: the person leans forwards about the ankle


def body(gain):
    """The model whose torques are ``gain`` times the command, and room for 12 states of a controller in it."""
    spec = mujoco.MjSpec.from_file(str(MODEL))
    for motor in spec.actuators:
        motor.gainprm[0] = gain
    user, joint = mujoco.mjtDyn.mjDYN_USER, mujoco.mjtTrn.mjTRN_JOINT
    spec.add_actuator(name="memory", trntype=joint, target="ankle", dyntype=user, actdim=2 * n, gainprm=np.zeros(10))
    return spec.compile()


# 2. Linearise: centred differences of the accelerations and the measurements around upright standing.
def linearise(model):
    data = mujoco.MjData(model)

    def answer(z):  # z = (angles, rates, torques)
        data.qpos[:], data.qvel[:], data.ctrl[:n_u] = np.split(z, 3)
        mujoco.mj_forward(model, data)
        return np.concatenate([data.qvel, data.qacc, data.sensordata])

    steps = 1e-5 * np.eye(n + n_u)
    slopes = np.array([(answer(step) - answer(-step)) / 2e-5 for step in steps]).T
    return slopes[:n, :n], slopes[:n, n:], slopes[n:, :n]


A, B, C = linearise(body(b))  # the plant that is there
A_hat, B_hat, C_hat = linearise(body(1.0))  # the one that the controller assumes

# 3. Design on the assumed plant: state feedback u = −k x and observer gain L, both by weights (the paper's Q and R).
k, _, _ = control.lqr(A_hat, B_hat, C_hat.T @ C_hat, 5e-7 * np.eye(n_u))
L, _, _ = control.lqe(A_hat, B_hat, C_hat, np.eye(n_u), 2e-7 * np.eye(len(C_hat)))

# 4. The controller: an observer x_o of the state, and a hold x_h that goes on between events as the closed loop of the
#    assumed plant would; u = −k x_h. At an event x_h := x_o. An event comes when the two have grown apart by q_t.
A_h, Q_t = A_hat - B_hat @ k, C_hat.T @ C_hat

# 5. Error system: the loop in the coordinates (x, x_o − x, x_h − x), in which it is an open-loop motion between events.
dA, dB, dC = A_hat - A, B_hat - B, C_hat - C
A_C = np.block([
    [A - B @ k, np.zeros((n, n)), -B @ k],
    [dA - dB @ k - L @ dC, A_hat - L @ C_hat, -dB @ k],
    [A_h - (A - B @ k), np.zeros((n, n)), A_h + B @ k],
])  # fmt: skip
T_bar, T = np.kron([[1, 0], [0, 1], [0, 1]], np.eye(n)), np.kron([[1, 0, 0], [0, 1, 0]], np.eye(n))


def phi(delta):
    """From one event to the next, ``delta`` seconds later, of (x, x_o − x): the jump makes x_h − x equal to x_o − x."""
    return T @ expm(A_C * delta) @ T_bar


# 6. The critical interval: where the largest eigenvalue of φ rises to 1, and the motion comes back as it was.
def size(delta):
    return np.abs(np.linalg.eigvals(phi(delta))).max() - 1


grid = np.arange(0.02, 3.0, 0.01)
rising = next(i for i in range(len(grid)) if size(grid[i]) < 0 < size(grid[i + 1]))
delta_crit = brentq(size, grid[rising], grid[rising + 1], xtol=1e-12)
values, vectors = np.linalg.eig(phi(delta_crit))
unit = np.argmax(np.abs(values))

# 7. The predicted cycle is its eigenvector, as large as makes the error at the end of the interval that of the rule.
orbit = np.array([expm(A_C * t) @ T_bar @ vectors[:, unit].real for t in np.linspace(0, delta_crit, 500)])
e = orbit[-1, 2 * n :] - orbit[-1, n : 2 * n]
amplitude = np.abs(orbit[:, :n] @ C[0]).max() * q_t / np.sqrt(e @ Q_t @ e)
print(f"predicted: an event every {delta_crit:.6f} s, shank up to {amplitude:.6f} rad, λ = {values[unit].real:+.6f}")


# 8. Simulate: MuJoCo's Runge–Kutta method steps plant and controller together, as the controller is in its state.
def command(model, data):
    """Control callback: the measurements, which are stale within a step, and the command that the hold gives."""
    mujoco.mj_sensorPos(model, data)
    data.ctrl[:n_u] = -k @ data.act[n:]


def remember(model, data, actuator):
    """Activation callback: the rates of observer and hold."""
    x_o, x_h = data.act[:n], data.act[n:]
    data.act_dot[:n] = A_hat @ x_o + B_hat @ data.ctrl[:n_u] - L @ (C_hat @ x_o - data.sensordata)
    data.act_dot[n:] = A_h @ x_h
    return 0.0


def simulate(duration=30.0):
    """Times (N,) of all steps, measurements (N, 3), commands (N, 3), event functions (N,), and times of the events."""
    model = body(b)
    data = mujoco.MjData(model)
    data.qpos[:] = start
    rows, events = [], []
    mujoco.set_mjcb_control(command)
    mujoco.set_mjcb_act_dyn(remember)
    try:
        while data.time < duration:
            mujoco.mj_step(model, data)
            e = data.act[n:] - data.act[:n]
            E = e @ Q_t @ e - q_t**2
            rows.append([data.time, *(C[:, :3] @ data.qpos), *data.ctrl[:n_u], E])
            if E >= 0:  # an event, up to a step ago: it is looked for once a step
                events.append(data.time)
                data.act[n:] = data.act[:n]
    finally:
        mujoco.set_mjcb_control(None)
        mujoco.set_mjcb_act_dyn(None)
    t, y, u, E = np.split(np.array(rows), [1, 4, 7], axis=1)
    return t[:, 0], y, u, E[:, 0], np.array(events)


# 9. Measure the last ten intervals, and how far beyond the threshold the late events came: the cycle is as much larger.
t, y, u, E, events = simulate()
interval, error = (events[-1] - events[-11]) / 10, (t[1] - t[0]) / 10
shank = np.abs(y[(t > events[-11]) & (t <= events[-1]), 0]).max()
beyond = np.sqrt(1 + E[np.isin(t, events[-10:])].max() / q_t**2) - 1
print(f"measured:  an event every {interval:.6f} s, shank up to {shank:.6f} rad")
print(f"looking for events once a step errs by up to {error:.6f} s in this and {beyond:.2%} in that")

# 10. Log it.
rr.init("by_hand", recording_id="by_hand")
rr.save("by_hand.rrd")
time = rr.TimeColumn("time", duration=t)
names = "angle/shank", "angle/thigh", "angle/trunk", "torque/ankle", "torque/knee", "torque/hip", "event_function"
for name, signal in zip(names, np.column_stack([y, u, E]).T, strict=True):
    rr.send_columns(name, [time], rr.Scalars.columns(scalars=signal))
rr.send_columns("event", [rr.TimeColumn("time", duration=events)], rr.TextLog.columns(text=["event"] * len(events)))
