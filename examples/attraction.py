"""
Which gains hold a body upright?
================================

A one-link person is held by delayed feedback. The passive stiffness of the ankle is 0.8 of what would hold the body by
itself. The feedback is either continuous, or switched off while the body moves towards the upright. For each pair of
gains, the map shows the factor by which each round of the motion is larger or smaller than the round before.
"""

from __future__ import annotations

import argparse

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import CenteredNorm

import icmj

parser = argparse.ArgumentParser(description="The map of attraction of switched feedback.")
parser.add_argument("--picture", default="", help="file to write the figure to")
parser.add_argument("--points", type=int, default=50, help="gains of each kind")
given = parser.parse_known_args()[0]

# %%
# The body and the gains of intermittent control are those of Asai et al. (2009).
m, h, g = 60.0, 1.0, 9.81
mgh, inertia = m * g * h, m * h**2
plant = icmj.LinearPlant(
    [[0, 1], [(mgh - 0.8 * mgh) / inertia, -4.0 / inertia]], [[0], [1 / inertia]], np.eye(2),
    states=("theta", "theta_rate"), inputs=("torque",), outputs=("theta", "omega"),
)  # fmt: skip
law = icmj.SwitchingPD(plant, "theta", "omega", P=0.25 * mgh, D=10.0, delay=0.2, slope=-0.4)
print(icmj.experiments.rounds(plant, law).words)

# %%
# Every point of the map is simulated exactly, which takes a few milliseconds.
P, D = np.linspace(0.02, 1.6, given.points) * mgh, np.linspace(-60, 320, given.points)
found = icmj.attraction(plant, law, P, D)

# %%
# With the gains shown in blue the body stands, with those in red it falls. Where feedback never switches off, there are
# no rounds, and the motion grows or decays monotonically: these gains are pale. Under continuous feedback the body
# stands only within the dashed line.
figure, axes = plt.subplots(figsize=(7, 5), layout="constrained")
shown = np.log10(np.where(np.isnan(found.factor), np.where(found.stands, 0.7, 1.4), found.factor))
image = axes.pcolormesh(
    P / mgh, D, np.clip(shown, -1.5, 1.5), cmap="RdBu_r", norm=CenteredNorm(0, 1.5), shading="nearest"
)
axes.contour(P / mgh, D, found.growth, levels=[0], colors="k", linewidths=1)
# from the characteristic equation at s = jω: I ω² + K − mgh + P cos ωt + D ω sin ωt = 0 and its imaginary part
omega = np.linspace(1e-3, 8, 800)
late, rest = 0.2 * omega, inertia * omega**2 + 0.2 * mgh
p = rest * np.cos(late) + 4.0 * omega * np.sin(late)
d = (rest * np.sin(late) - 4.0 * omega * np.cos(late)) / omega
axes.plot(p / mgh, d, "k--", lw=1, label="limit of continuous feedback")
axes.axvline(0.2, color="k", ls="--", lw=1)
axes.plot(0.25, 10, "ko", mfc="w", label="switched, as printed")
axes.plot(0.8, 270, "ks", mfc="w", label="continuous, as printed")
axes.set(xlabel="P / mgh", ylabel="D (N m s/rad)", xlim=(P[0] / mgh, P[-1] / mgh), ylim=(D[0], D[-1]))
axes.legend(loc="lower right")
figure.colorbar(image, label=r"$\log_{10}$ of the factor per round")
if given.picture:
    figure.savefig(given.picture, dpi=130)
