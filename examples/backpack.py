"""A load that the controller does not know: a backpack
=====================================================

How does a hidden load change the sway? The controller assumes wrong values of mass, centre of mass and inertia of the
trunk. The ankle angle of the actual person is adjusted until the load is balanced.
"""

import numpy as np
from matplotlib import pyplot as plt

import icmj

SHIPPED = icmj.load_run("three-link-0.9").path  # paths in RUN are relative to the folder of this file

TRUNK, COM, INERTIA = 54.24, np.array([0.0, 0.0, 0.32452]), 3.58602  # kg, m, kg m²
WHERE = np.array([-0.15, 0.0, 0.35])  # position of the backpack relative to the hip, behind the back

RUN = """
case = { name = "backpack", title = "A backpack that the controller does not know of" }
[assumed]
model = "../models/three_link.xml"
keyframe = "upright"
[actual]
operating_point = "balance"     # the ankle finds where the load is balanced; knee and hip are held
free = ["ankle"]
[design]
R_c = 5e-7
R_o = 2e-7
[controller]
q_t = 0.005
[simulation]
initial = { ankle = 0.005 }
"""


def backpack(load: float) -> str:
    """Changes of the actual plant that add ``load`` kg to the trunk."""
    mass = TRUNK + load
    com = (TRUNK * COM + load * WHERE) / mass
    inertia = INERTIA + TRUNK * np.sum((COM - com) ** 2) + load * np.sum((WHERE - com) ** 2)
    changes = {"mass": mass, "centre_of_mass": com.tolist(), "inertia": [float(inertia), float(inertia), 0.5]}
    return "".join(
        f'[[actual.change]]\nwhat = "{what}"\nof = "trunk"\nvalue = {value}\n' for what, value in changes.items()
    )


predicted = {}
for load in (5.0, 10.0, 15.0):
    case = icmj.prepare(icmj.parse_run(RUN + backpack(load), SHIPPED))
    lean = np.degrees(case.actual.linearisation.point.qpos[0])
    prediction = case.prediction
    predicted[load] = prediction.delta_crit
    print(f"{load:4.0f} kg: leans {lean:.2f}°, predicted {prediction.delta_crit:.4f} s, {prediction.verdict}")
run = icmj.simulate(case, "mujoco")
print(icmj.measure(run, T_hat=case.system.T_hat).words)

# %%
# The heavier the load, the shorter the interval. With the heaviest load, the motion settles on its cycle.
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
left.plot(predicted.keys(), predicted.values(), "o-", color="#0072b2")
left.set(xlabel="load (kg)", ylabel=r"predicted $\Delta_{crit}$ (s)")
right.plot(run.t, np.degrees(run.y), linewidth=0.8, label=case.actual.linearisation.plant.outputs)
right.set(xlabel="$t$ (s)", ylabel="segment angle (deg)", title=f"{load:.0f} kg", xlim=(0, 12))
right.legend()
plt.show()
