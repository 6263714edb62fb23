"""The inverted pendulum of gymnasium
==================================

The model file is used unchanged, with a run file of five lines.
"""

import importlib.util
import sys
from pathlib import Path

from matplotlib import pyplot as plt

import icmj

found = importlib.util.find_spec("gymnasium")
if found is None:
    sys.exit("gymnasium is not installed: pip install gymnasium brings its models")
folder = Path(found.origin).parent / "envs" / "mujoco" / "assets"

# the centre of mass lies slightly beside the axis of the pole, so that the pole balances at a small angle
RUN = """
case = { name = "gymnasium", title = "gymnasium's inverted pendulum" }
assumed = { model = "inverted_pendulum.xml", outputs = "joints", operating_point = "balance", free = ["hinge"] }
actual = { gain = 0.9 }
design = { Q_c = "identity", R_c = 0.1, R_o = 0.01 }
controller = { q_t = 1e-3 }
simulation = { duration = 20.0, initial = { hinge = 1e-3 }, timestep = 0.002 }
"""
case = icmj.prepare(icmj.parse_run(RUN, folder / "run.toml"))
print(f"rests at a lean of {case.actual.linearisation.point.qpos[1]:.6f} rad")
print(f"predicted interval {case.prediction.delta_crit:.6f} s, {case.prediction.verdict}")
run = icmj.simulate(case, "mujoco")
print(icmj.measure(run, T_hat=case.system.T_hat).words)

# %%
# The open-loop intervals grow until the motion reaches the cycle.
figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
axes.plot(run.events.t, run.events.interval, "o-", color="#a03c00", label="measured")
axes.axhline(case.prediction.delta_crit, color="black", linestyle=":", label="predicted")
axes.set(xlabel="$t$ (s)", ylabel=r"$\Delta_{ol}$ (s)", ylim=(0, None))
axes.legend()
plt.show()
