"""Does the model sway like a person?
==================================

The recorded centre of pressure of a person who stands still is compared with that of the three-link model under noise.
Their sizes are similar, but their speeds are not: the command of the model jumps at every event, and muscles would
smooth it.

The recording is :download:`standing.csv <../../examples/standing.csv>`; put it, or your own, beside the notebook.
"""

from pathlib import Path

from matplotlib import pyplot as plt

import icmj
from icmj.measurement.sway import from_torque

examples = Path(__file__).resolve().parent if "__file__" in globals() else Path()
recorded = icmj.read_series(examples / "standing.csv", columns=["ap"], rate=100.0)

# The three-link model stands on fixed feet, so its centre of pressure is the ankle torque divided by the weight above
# the feet. The torque that acts is b = 0.9 of the command.
case = icmj.prepare(icmj.load_run("quiet-standing"))
run = icmj.simulate(case, "linear").to_series(rate=100.0, controller=case.controller)
simulated = from_torque(run.since(6.0), "u.ankle_torque", 77.68 * 9.81 / 0.9)

person = icmj.measure_sway(icmj.Series(recorded.t, 10 * recorded.values, ("person",), ("mm",)))  # was in cm
model = icmj.measure_sway(icmj.Series(simulated.t, 1e3 * simulated.values, ("model",), ("mm",)))  # was in m
for sway in (person, model):
    found = sway.coordinates[0]
    short = found.diffusion.short.H
    print(f"{found.name}: RMS {found.rms:.1f} mm, mean speed {found.speed:.0f} mm/s, H on short times {short:.2f}")

# %%
# Over seconds, both wander similarly. Below a tenth of a second the sway of the person is smooth; that of the model is
# not.
figure, axes = plt.subplots(2, 2, figsize=(8, 5.4), layout="constrained", sharex="col", sharey="col")
for (left, right), sway in zip(axes, (person, model), strict=True):
    icmj.plots.sway_diffusion(left, sway)
    icmj.plots.sway_spectrum(right, sway)
for above in axes[0]:
    above.set_xlabel("")
plt.show()
