"""Standing with a lean
====================

The operating point is a given pose, here a lean of the ankle by 0.035 rad. icmj computes the torques that hold it.
"""

import numpy as np
from matplotlib import pyplot as plt

import icmj

LEAN = """
case = { name = "lean", title = "Leaning forwards by 2 degrees" }
assumed = { model = "../models/three_link.xml", operating_point = "static control", pose = { ankle = 0.035 } }
actual = { gain = 0.9 }
design = { R_c = 5e-7, R_o = 2e-7 }
controller = { q_t = 0.002 }
"""
case = icmj.prepare(icmj.parse_run(LEAN, icmj.load_run("three-link-0.9").path))
point = case.actual.linearisation
for name, torque in zip(point.plant.inputs, point.point.ctrl, strict=True):
    print(f"{name:13s} {torque:8.2f} N m hold the lean")
print(f"predicted interval {case.prediction.delta_crit:.4f} s, {case.prediction.verdict}")
orbit = case.prediction.orbit
start = case.system.to_original(case.system.T_bar @ orbit.x_bar)
run = icmj.simulate(case, "mujoco", start=(start[:6], start[6:12]))
print(icmj.measure(run, T_hat=case.system.T_hat).words)
ankle = run.applied[:, 0]
print(f"relative to it, the ankle torque varies from {np.min(ankle):+.2f} to {np.max(ankle):+.2f} N m")

# %%
# The figure shows the ankle torque minus the torque that holds the lean. It jumps at each event and then follows the
# hold.
figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
late = run.t > run.t[-1] - 4
axes.plot(run.t[late], ankle[late], color="#a03c00")
axes.set(xlabel="$t$ (s)", ylabel="ankle torque (N m)")
plt.show()
