"""A plant of your own
===================

A plant is given by a transfer function. It is analysed, simulated and measured without a model file.
"""

import control
from matplotlib import pyplot as plt

import icmj

# An unstable plant, and the same plant with an input gain 20 % higher than the controller assumes
assumed = icmj.LinearPlant.from_statespace(control.ss(control.tf([2], [1, 0.5, -3])))
actual = assumed.scaled(1.2)

design = icmj.design_lq(assumed, R_c=0.1, R_o=0.01)
trigger = icmj.EventTrigger(icmj.output_weight(design), q_t=0.01, delta_min=0.01)
system = icmj.error_system(actual, design)
prediction = icmj.predict(system, trigger)
print(f"critical interval {prediction.delta_crit:.6f} s, eigenvalue {prediction.eigenvalue.real:+.0f}")
print(f"period {prediction.period:.6f} s, peak output {prediction.amplitude[0]:.6f}, {prediction.verdict}")

controller = icmj.Controller(design, icmj.system_matched(design), trigger)
run = icmj.simulate_plant(actual, controller, icmj.Settings(duration=40.0), x0=[0.01, 0.0])
motion = icmj.measure(run, T_hat=system.T_hat)
print(motion.words)

# %%
# The upper panel shows the output, the lower one the open-loop intervals, which settle at the critical interval
# (dotted).
figure, (top, bottom) = plt.subplots(2, 1, figsize=(7, 4.2), sharex=True, layout="constrained")
top.plot(run.t, run.y, color="#0072b2")
top.set(ylabel="$y$")
bottom.plot(run.events.t, run.events.interval, "o", markersize=4, color="#0072b2")
bottom.axhline(prediction.delta_crit, color="black", linestyle=":")
bottom.set(xlabel="$t$ (s)", ylabel=r"$\Delta_{ol}$ (s)", ylim=(0, None))
plt.show()
