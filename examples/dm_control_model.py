"""The cart-pole of dm_control
===========================

The model file is used unchanged. The printed lines show how much of the actuator's range the controller needs, and the
figure shows the motion.
"""

import importlib.util
import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import icmj

found = importlib.util.find_spec("dm_control")
if found is None:
    sys.exit("dm_control is not installed: pip install dm_control brings its models")
folder = Path(found.origin).parent / "suite"

RUN = """
case = { name = "dm_control", title = "The cart-pole of dm_control" }
assumed = { model = "cartpole.xml", outputs = "joints" }
actual = { gain = 0.9 }
design = { Q_c = "identity", R_c = 0.1, R_o = 0.01 }
controller = { q_t = 1e-3 }
simulation = { duration = 40.0, initial = { hinge_1 = 1e-3 }, integrator = "RK4", timestep = 0.005 }
"""
case = icmj.prepare(icmj.parse_run(RUN, folder / "run.toml"))
print(f"predicted interval {case.prediction.delta_crit:.6f} s, {case.prediction.verdict}")
run = icmj.simulate(case, "mujoco")
print(icmj.measure(run, T_hat=case.system.T_hat).words)
saturated = run.precision["saturated_share"]
print(f"control up to {np.abs(run.applied).max():.4f} of a range of 1, saturated {saturated:.0%}")

# %%
# Cart and pole in the last four seconds:
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
late = run.t > run.t[-1] - 4
for axes, i, label, factor in ((left, 0, "cart (mm)", 1e3), (right, 1, "pole (mrad)", 1e3)):
    axes.plot(run.t[late], factor * run.y[late, i], color="#a03c00")
    axes.set(xlabel="$t$ (s)", ylabel=label)
plt.show()
