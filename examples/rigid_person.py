"""
Where is the intersection point of a rigid person?
==================================================

When a rigid person sways about the ankles, mechanics alone determines where the lines of action of the ground reaction
force intersect, whatever the controller. How accurate is an estimate from two minutes of sway, and how much error does
spectral leakage of its window cause?
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import icmj

parser = argparse.ArgumentParser(description="The intersection point of a rigid person, estimated and by mechanics.")
parser.add_argument("--picture", default="", help="file to write the figure to")
picture = parser.parse_known_args()[0].picture

# %%
# The person has a mass of 60 kg. The centre of mass is 0.9 m above the ankles, which are at ground level; the moment of
# inertia about the centre of mass is 9 kg m².
MODEL = """<mujoco><option gravity="0 0 -9.81" timestep="0.002" integrator="RK4"/>
<worldbody><body><joint name="ankle" axis="0 1 0"/>
<inertial pos="0 0 0.9" mass="60" diaginertia="9 9 0.1"/></body></worldbody>
<actuator><motor name="torque" joint="ankle"/></actuator>
<sensor><jointpos name="lean" joint="ankle"/></sensor></mujoco>"""
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "rigid.xml"
    path.write_text(MODEL)
    body = icmj.load_plant(path)
plant = body.linearisation.plant
mass, height, g = 60.0, 0.9, 9.81  # kg, m, m/s²
inertia = 9.0 + mass * height**2  # kg m² about the ankle

# %%
# Two controllers have the same design and are disturbed by a white-noise torque at the ankle.
design = icmj.design_lq(plant, R_c=1e-6, R_o=1e-8)
hold = icmj.system_matched(design)
CONTROLLERS = {
    "continuous": icmj.Controller(design, hold, icmj.Continuous()),
    "events": icmj.Controller(design, hold, icmj.EventTrigger(plant.C.T @ plant.C, 0.003, 0.2)),
}
PLANTS = {"linear": plant, "MuJoCo": body}
noise = icmj.Gaussian(input=plant.inputs[0], size=5.0, interval=0.02, seed=3)
settings = icmj.Settings(duration=130.0, record_interval=0.01, disturbance=(noise,), limit=0.5)


def mechanics(frequency: np.ndarray) -> np.ndarray:
    """z/h of a rigid person, by Newton and Euler."""
    return g / (height * (2 * np.pi * frequency) ** 2) + inertia / (mass * height**2)


# %%
# The upper panel compares the estimate with mechanics, the lower one shows its error, for windows of 5.12 s and 20.48
# s. A window leaks power of the slow, large sway into the neighbouring frequencies, where the true height is smaller;
# the leakage of a longer window reaches less far.
figure, (curve, error) = plt.subplots(2, 1, sharex=True, figsize=(7, 6), layout="constrained")
f = np.geomspace(0.1, 8, 200)
curve.loglog(f, mechanics(f), "k-", lw=1, label="mechanics")
curve.legend(frameon=False)
for (name, law), colour in zip(CONTROLLERS.items(), ("#0072b2", "#d55e00"), strict=True):
    for which, of in PLANTS.items():
        run = icmj.simulate_plant(of, law, settings)
        force = icmj.experiments.force_angle(icmj.engine.ground_force(body, run), "force.x", "force.z")
        t = np.arange(10.0, 130.0, 0.01)
        values = np.column_stack([np.interp(t, force.t, column) for column in force.values.T])
        force = icmj.Series(t - t[0], values, force.names, force.units)
        for window, line in ((5.12, "-"), (20.48, ":")):
            found = icmj.experiments.intersection_point(
                force, "force_angle", "cop.x", height=height, window=window, band=(0.1, 8.0)
            )
            off = 100 * (found.ratio / mechanics(found.frequency) - 1)
            worst = [np.abs(off[part]).max() for part in (found.frequency >= 1, found.frequency >= 0.4, slice(None))]
            print(f"{name}, {which}, {window:g} s: off by {worst[0]:.2f} % from 1 Hz on,", end=" ")
            print(f"{worst[1]:.1f} % from 0.4 Hz on, {worst[2]:.0f} % from 0.1 Hz on")
            if which == "linear" or window < 10:
                marks = {"color": colour, "ls": line if which == "linear" else "--", "lw": 1}
                curve.loglog(found.frequency, found.ratio, **marks)
                error.semilogx(found.frequency, off, **marks, label=f"{name}, {which}, {window:g} s")
error.axhspan(-1, 1, color="0.9", zorder=0)
curve.set(ylabel="intersection point, $z/h$")
error.set(ylabel="error of the estimate (%)", xlabel="frequency (Hz)", ylim=(-30, 30))
error.legend(frameon=False, fontsize="small", ncols=2)
if picture:
    figure.savefig(picture, dpi=130)
