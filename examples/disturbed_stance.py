"""How does a person recover from a push?
======================================

A standing person is pushed at the ankle. The open-loop intervals change, and then return to those of the cycle.
"""

import numpy as np
from matplotlib import pyplot as plt

import icmj

shipped = icmj.load_run("three-link-0.9")
push = """
[[simulation.disturbance]]
kind = "impulse"                # N m s at the ankle, spread over 50 ms
input = "ankle_torque"
size = 0.5
start = 15.0
"""
run_file = icmj.parse_run(shipped.text + push, shipped.path)
case = icmj.prepare(run_file)
run = icmj.simulate(case, "mujoco")
for t, interval in zip(run.events.t, run.events.interval, strict=True):
    if t > 12:
        print(f"{t:7.3f} s   interval {interval:.4f} s   {'#' * round(60 * interval)}")
print(icmj.measure(run, T_hat=case.system.T_hat).words)

# %%
# The push at 15 s changes the intervals. A few events later they are equal to the critical interval again.
figure, (top, bottom) = plt.subplots(2, 1, figsize=(7, 4.4), sharex=True, layout="constrained")
top.plot(run.t, np.degrees(run.y), linewidth=0.9, label=case.actual.linearisation.plant.outputs)
top.set(ylabel="segment angle (deg)")
top.legend(ncols=3)
bottom.step(run.events.t, run.events.interval, where="pre", color="#a03c00")
bottom.axhline(case.prediction.delta_crit, color="black", linestyle=":")
bottom.set(xlabel="$t$ (s)", ylabel=r"$\Delta_{ol}$ (s)", xlim=(8, 30), ylim=(0, 1.2))
plt.show()
