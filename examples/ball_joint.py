"""A pole on a ball joint, in three dimensions
===========================================

The pole has arms that are spread sideways, so that it falls more slowly to the side than forwards.
"""

import tempfile
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import icmj

MODEL = """
<mujoco model="ball_joint">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="RK4"><flag contact="disable"/></option>
  <worldbody>
    <body name="pole"><joint name="ball" type="ball" damping="0.2"/>
      <inertial pos="0 0 0.9" mass="70" diaginertia="30 10 22"/></body>
  </worldbody>
  <actuator>
    <motor name="roll" joint="ball" gear="1 0 0"/>
    <motor name="pitch" joint="ball" gear="0 1 0"/>
    <motor name="yaw" joint="ball" gear="0 0 1"/>
  </actuator>
  <sensor><ballquat name="tilt" joint="ball"/></sensor>
</mujoco>"""
# the outputs are the vector part of the quaternion, which is half the angles
RUN = """
case = { name = "ball", title = "A pole on a ball joint" }
assumed = { model = "ball.xml", outputs = ["tilt.1", "tilt.2", "tilt.3"] }
actual = { gain = [0.9, 0.9, 1.0] }
design = { R_c = 1e-6, R_o = 1e-6 }
controller = { q_t = 0.002 }
"""
with tempfile.TemporaryDirectory() as folder:
    Path(folder, "ball.xml").write_text(MODEL, encoding="utf-8")
    case = icmj.prepare(icmj.parse_run(RUN, Path(folder, "run.toml")))
print("states:", ", ".join(case.actual.linearisation.plant.states))
print("poles:", np.round(np.sort(np.linalg.eigvals(case.actual.linearisation.plant.A).real), 3))
prediction = case.prediction
print(f"predicted interval {prediction.delta_crit:.6f} s, {prediction.verdict}")
start = case.system.to_original(case.system.T_bar @ prediction.orbit.x_bar)
runs = {}
for plant in ("linear", "mujoco"):
    run = icmj.simulate(case, plant, start=(start[:6], start[6:12]), duration=10 * prediction.delta_crit)
    print(f"{plant:7s} first interval {run.events.interval[0]:.6f} s")
    runs[plant] = run

# %%
# The pole sways forwards and backwards. The slower fall to the side does not cause a separate cycle.
figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
for (plant, run), (width, colour) in zip(runs.items(), ((4, "#9bd0f0"), (1, "#a03c00")), strict=True):
    axes.plot(run.t, 2 * np.degrees(run.y[:, 1]), label=plant, linewidth=width, color=colour)
axes.set(xlabel="$t$ (s)", ylabel="pitch (deg)")
axes.legend()
plt.show()
