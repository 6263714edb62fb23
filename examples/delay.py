"""What does a neural delay change?
================================

The figure shows the critical interval as a function of the delay, for a controller that knows the delay and for
controllers that overestimate or underestimate it by a tenth.

To draw the figure of the documentation page on delays: ``python examples/delay.py --picture delay.png --points 25``.
"""

import argparse

import numpy as np
from matplotlib import pyplot as plt

import icmj

CASES = ("simple-0.8", "simple-1.2", "three-link-0.9", "three-link-1.1")

arguments = argparse.ArgumentParser(description=__doc__)
arguments.add_argument("--points", type=int, default=7)
arguments.add_argument("--picture")
given = arguments.parse_known_args()[0]
delays = np.linspace(0.0, 0.3, given.points)


def unbroken(values):
    """Interrupt the curve at jumps, where another crossing has become the critical one."""
    values = np.array(values)
    jump = np.append(np.abs(np.diff(values)) > 0.15 * values[:-1], False)
    return np.where(jump, np.nan, values)


figure, stack = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
for axes, system in zip(stack, ("simple", "three-link"), strict=True):
    for name in [name for name in CASES if name.startswith(system)]:
        case = icmj.prepare(icmj.load_run(name))
        plant, controller = case.actual.linearisation.plant, case.controller
        colour = None  # the first curve of a case determines its colour
        for mistake, style in ((1.0, "-"), (1.1, "--"), (0.9, ":")):
            found = []
            for t_d in delays:
                delay = icmj.Delay(t_d, mistake * t_d)
                loop = icmj.error_system(plant, controller.design, controller.hold, delay=delay)
                prediction = icmj.predict(loop, case.rule, delta_max=case.run.analysis.delta_max)
                good = prediction.cycle and prediction.verdict == "attracting"
                found.append(prediction.delta_crit if good else np.nan)
            label = f"b = {name.split('-')[-1]}" if mistake == 1.0 else None
            (line,) = axes.plot(delays, unbroken(found), style, color=colour, label=label)
            colour = line.get_color()
            if mistake == 1.0:
                print(f"{name:15s} " + " ".join(f"{value:.4f}" for value in found))
    axes.set(title=f"{system} system", xlabel="delay $t_d$ (s)", ylabel=r"$\Delta_{crit}$ (s)")
    axes.legend(fontsize=8)
figure.suptitle("solid: delay known; dashed: assumed 10 % too long; dotted: 10 % too short", fontsize=9)
if given.picture:
    figure.savefig(given.picture, dpi=150)
plt.show()
