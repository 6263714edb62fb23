"""
Can a frequency response reveal intermittent control?
=====================================================

A set-point that is a sum of sinusoids is followed by the continuous predictor controller, by a clock-driven controller
and by an event-driven one with a small threshold. The three frequency responses are hard to distinguish, except for the
lag that sampling causes: intermittent control masquerades as continuous control.
"""

from __future__ import annotations

import argparse

import matplotlib.pyplot as plt
import numpy as np

import icmj
from icmj.controller import sines

parser = argparse.ArgumentParser(description="Frequency responses of continuous and intermittent control.")
parser.add_argument("--picture", default="", help="file to write the figure to")
picture = parser.parse_known_args()[0].picture

plant = icmj.LinearPlant(
    [[0, 1], [1, 0]], [[0], [1]], [[1, 0]], ("angle", "rate"), ("torque",), ("angle",), ("rad", "rad/s")
)
design = icmj.design_lq(plant, R_c=0.1, R_o=0.01)
delay, interval, period = icmj.Delay(0.1), 0.2, 51.3  # [s]; sampling maps no line onto another one

# %%
# All frequencies are multiples of 1/period. Aliases that sampling folds back into the band fall between them.
lines = np.unique(np.round(np.geomspace(0.04, 1.6, 22) * period)) / period
phases = 2 * np.pi * np.random.default_rng(1).random(len(lines))
sizes = 0.02 / (1 + lines)
followed = icmj.setpoint(plant, [icmj.Target({"angle": 1.0}, sines(sizes, lines, phases))])
continuous = icmj.PredictorController(design, delay, followed)
hold, Q_t = icmj.system_matched(design), np.eye(2)
rivals = {
    "continuous predictor": continuous,
    f"clock of {interval:g} s": icmj.Controller(design, hold, icmj.ClockTrigger(interval), delay, followed),
    f"events, at least {interval:g} s apart": icmj.Controller(
        design, hold, icmj.EventTrigger(Q_t, 1e-3, interval), delay, followed
    ),
}

# %%
# One period of each run, after the motion has settled, is correlated with the sinusoids of the set-point.
settings = icmj.Settings(duration=2 * period, record_interval=period / 4096)
responses = {}
for name, law in rivals.items():
    run = icmj.simulate_plant(plant, law, settings, x0=[0.0, 0.0])
    t = period + period / 4096 * np.arange(4096)
    y = np.interp(t, run.t, run.y[:, 0])
    there = 2 / len(t) * np.exp(-2j * np.pi * np.outer(lines, t)) @ y
    responses[name] = there / (sizes * np.exp(1j * (phases - np.pi / 2)))

# %%
# The response of the continuous controller is also known in closed form. Sampling adds a lag of half an interval.
omega = 2 * np.pi * np.geomspace(lines[0], lines[-1], 200)
exact = icmj.theory.predictor_loop(plant, continuous).response(omega)[2][:, 0, 0]
figure, (gain, phase) = plt.subplots(2, 1, sharex=True, figsize=(7, 6), layout="constrained")
gain.loglog(omega / 2 / np.pi, np.abs(exact), "k-", lw=1, label="continuous predictor, exact")
phase.semilogx(omega / 2 / np.pi, np.degrees(np.unwrap(np.angle(exact))), "k-", lw=1)
lagging = np.unwrap(np.angle(exact)) - omega * interval / 2
phase.semilogx(omega / 2 / np.pi, np.degrees(lagging), "k:", label="half an interval later")
for (name, found), marker in zip(responses.items(), "o^x", strict=True):
    gain.loglog(lines, np.abs(found), marker, mfc="none", label=name)
    phase.semilogx(lines, np.degrees(np.unwrap(np.angle(found))), marker, mfc="none")
gain.set(ylabel="gain, angle/set-point (rad/rad)")
phase.set(ylabel="phase (°)", xlabel="frequency (Hz)")
gain.legend(frameon=False)
phase.legend(frameon=False)
if picture:
    figure.savefig(picture, dpi=130)
