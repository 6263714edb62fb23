"""Two muscles that can only pull
==============================

A calf and a shin muscle hold a rod upright. Their tone is part of the operating point, and their activations are
states.
"""

import tempfile
from pathlib import Path

from matplotlib import pyplot as plt

import icmj

MODEL = """
<mujoco model="muscles">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="RK4"><flag contact="disable"/></option>
  <default>
    <muscle ctrllimited="true" ctrlrange="0 1" force="1500" range="0.75 1.05" timeconst="0.02 0.04"/>
  </default>
  <worldbody>
    <body name="rod"><joint name="ankle" axis="0 1 0" damping="5"/>
      <inertial pos="0 0 0.9" mass="70" diaginertia="6 6 1"/></body>
  </worldbody>
  <actuator>
    <muscle name="calf" joint="ankle" gear="-1" lengthrange="-1 1" tausmooth="0.3"/>
    <muscle name="shin" joint="ankle" gear="1" lengthrange="-1 1" tausmooth="0.3"/>
  </actuator>
  <sensor><jointpos name="sway" joint="ankle"/></sensor>
  <keyframe><key name="tone" qpos="0" ctrl="0.2 0.2" act="0.2 0.2"/></keyframe>
</mujoco>"""
RUN = """
case = { name = "muscle", title = "Two muscles" }
assumed = { model = "muscle.xml", keyframe = "tone", operating_point = "static control" }
actual = { gain = 0.9 }
design = { R_c = 1e-3, R_o = 1e-4 }
controller = { q_t = 1e-4 }
simulation = { duration = 60.0, initial = { ankle = 1e-4 } }
"""
with tempfile.TemporaryDirectory() as folder:
    Path(folder, "muscle.xml").write_text(MODEL, encoding="utf-8")
    case = icmj.prepare(icmj.parse_run(RUN, Path(folder, "run.toml")))
plant = case.actual.linearisation.plant
print("states:", ", ".join(plant.states))
tone = zip(plant.inputs, case.actual.linearisation.point.ctrl, strict=True)
print("tone:", ", ".join(f"{name} {ctrl:.3f}" for name, ctrl in tone))
for notice in case.notices:
    print("note:", notice)
print(f"predicted interval {case.prediction.delta_crit:.6f} s, {case.prediction.verdict}")
run = icmj.simulate(case, "mujoco")
print(icmj.measure(run, T_hat=case.system.T_hat).words)

# %%
# The commands to the two muscles, as deviations from their tone, have opposite signs.
figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
late = run.t > run.t[-1] - 5
axes.plot(run.t[late], run.applied[late], label=plant.inputs)
axes.set(xlabel="$t$ (s)", ylabel="excitation (1)")
axes.legend()
plt.show()
