"""
Intermittent or continuous?
===========================

Which experiment can distinguish five controllers that hold the same person in the presence of noise, and how many
trials does it need? Many synthetic people under each controller take part in a double-step and in a multi-sine
experiment. From a few measures of each experiment, a rule learns to recognise the controllers of some people, and is
tested on the others.
"""

from __future__ import annotations

import argparse
import sys
from itertools import combinations

import matplotlib.pyplot as plt
import numpy as np

import icmj

parser = argparse.ArgumentParser(description="Power of double steps and multi-sines to distinguish controllers.")
parser.add_argument("--people", type=int, default=4, help="under each controller")
parser.add_argument("--trials", type=int, default=2, help="of each person and experiment, a power of two")
parser.add_argument("--picture", default="", help="file to write the figure to")
given = parser.parse_known_args()[0]
counts = [2**i for i in range(int(np.log2(given.trials)) + 1)]

# %%
# The one-link person of Asai et al. (2009): 60 kg, 1 m to the centre of mass, an ankle whose own stiffness holds 80 %
# of the weight. Designs, threshold, refractory period and noise are not given there and are choices of this example.
mgh, K, B, J, delay = 588.6, 0.8 * 588.6, 4.0, 60.0, 0.2
person = icmj.LinearPlant(
    [[0, 1], [(mgh - K) / J, -B / J]], [[0], [1 / J]], np.eye(2), ("lean", "lean_rate"), ("torque",),
    ("lean", "lean_rate"), ("rad", "rad/s"), ("N m",), ("rad", "rad/s"),
)  # fmt: skip
design = icmj.design_lq(person, Q_c=np.diag([1.0, 0.0]), R_c=1e-6, R_o=1e-6)
events = icmj.EventTrigger(np.diag([1.0, 0.0]), 0.006, 0.35)
CONTROLLERS = ("events", "clock", "predictor", "switching PD", "delayed PD")
t_d, hold = icmj.Delay(delay), icmj.system_matched(design)


def controller(name: str, target: icmj.controller.Setpoint | None) -> icmj.Law:
    """The controller of this name; those that read only outputs see a target as an error of their readings."""
    if name == "predictor":
        return icmj.PredictorController(design, t_d, target)
    if name in ("events", "clock"):
        return icmj.Controller(design, hold, events if name == "events" else icmj.ClockTrigger(0.35), t_d, target)
    switches = name == "switching PD"
    gains = (0.25 * mgh, 10.0) if switches else (0.8 * mgh, 270.0)
    return icmj.SwitchingPD(person, "lean", "lean_rate", *gains, delay, -0.4, 0.004 * switches, switches)


def noise(seed: int) -> tuple[icmj.Noise, ...]:
    """Noise of the muscle and of the reading, mostly below 1 Hz: continuous control sways by 4.5 mm, as people do."""
    return (
        icmj.Noise(input="torque", size=2.5, corner=1.0, terms=60, seed=2 * seed),
        icmj.Noise(output="lean", size=0.0015, corner=1.0, terms=60, seed=2 * seed + 1),
    )


def simulated(law: icmj.Law, duration: float, *disturbing: object) -> icmj.Simulation:
    settings = icmj.Settings(duration=duration, limit=10.0, record_interval=0.02, disturbance=disturbing)
    return icmj.simulate_plant(person, law, settings)


def even(run: icmj.Simulation, *columns: np.ndarray) -> np.ndarray:
    """Columns at evenly spaced rows only, because events are recorded as rows, too."""
    places = np.rint(run.t / 0.02)
    kept = np.abs(run.t - 0.02 * places) < 1e-7
    return np.column_stack(columns)[kept][np.flatnonzero(np.diff(places[kept], prepend=-1) > 0)]


# %%
# **Double steps.** A trial has two pairs of steps at each of six intervals. The measures, over all trials of a person,
# are the median and the interquartile range of the first reaction time, the median by which the second reaction time is
# longer at short and at long intervals, and the share of pairs with a response to both steps.
SHORT, ISI = 0.25, (0.1, 0.15, 0.2, 0.4, 0.6, 0.9)


def double_step(name: str, seed: int) -> np.ndarray:
    """Interval, RT1 and RT2 of each pair of a trial."""
    pairs = icmj.controller.double_steps(ISI, 1, 0.02, recovery=(2.5, 3.5), seed=seed)
    model, errors = None, ()
    if "PD" in name:
        terms = tuple((-size, 0.0, 0.0, t, np.inf) for size, t in zip(pairs.sizes.flat, pairs.t.flat, strict=True))
        errors = (icmj.Sinusoids(output="lean", terms=terms),)
    else:
        model = icmj.setpoint(person, [pairs.target("lean")])
    run = simulated(controller(name, model), pairs.end, *noise(seed), *errors)
    rows = even(run, run.applied[:, 0])
    t = 0.02 * np.arange(len(rows))
    target = np.sum(pairs.sizes.ravel() * (t[:, None] >= pairs.t.ravel() - 1e-9), axis=1)
    series = icmj.Series(t, np.column_stack([target, rows]), ("target", "torque"), ("rad", "N m"))
    steps = icmj.experiments.reconstruct_steps(series, "torque", pairs)
    return np.column_stack([pairs.isi, steps.rt])


def of_steps(trials: list[np.ndarray]) -> list[float]:
    isi, first, second = np.concatenate(trials).T
    later = second - first
    there = np.isfinite(later)

    def middle(values: np.ndarray) -> float:
        return float(np.median(values)) if len(values) else 0.0

    spread = np.subtract(*np.quantile(first[there], [0.75, 0.25])) if there.any() else 0.0
    short, long = (middle(later[there & of]) for of in (isi < SHORT, isi > SHORT))
    return [middle(first[there]), float(spread), short, long, float(there.mean())]


# %%
# **Multi-sine.** A trial is four periods of 10 s, with a torque at ten frequencies. The measures, over all trials of a
# person, are the remnant and the coherence of the torque that the controller commands.
PERIOD, LINES = 10.0, np.array([1, 2, 3, 5, 7, 11, 13, 17, 23, 29]) / 10.0


def multi_sine(name: str, seed: int) -> icmj.Series:
    random = np.random.default_rng(seed)
    phases = 2 * np.pi * random.random(len(LINES))
    terms = tuple((2.0, 2 * np.pi * f, phase) for f, phase in zip(LINES, phases, strict=True))
    run = simulated(controller(name, None), 6 * PERIOD, icmj.Sinusoids(input="torque", terms=terms), *noise(seed))
    u = even(run, run.u[:, 0])[: round(6 * PERIOD / 0.02)]
    t = 0.02 * np.arange(len(u))
    stimulus = sum(a * np.cos(omega * t + phase) for a, omega, phase in terms)
    both = np.column_stack([stimulus, u])[round(2 * PERIOD / 0.02) :]
    return icmj.Series(0.02 * np.arange(len(both)), both, ("stimulus", "torque"), ("N m", "N m"))


def of_sines(trials: list[icmj.Series]) -> list[float]:
    found = icmj.multisine(trials, "stimulus", "torque", period=PERIOD, lines=LINES)
    return [np.log(found.remnant), float(np.mean(found.coherence))]


# %%
# The rule decides between two controllers by the nearer mean, in units of the common scatter (linear discriminant
# analysis). Means and scatter are learned without the person who is classified. By chance, half of the people would be
# classified correctly.
def rightly(one: np.ndarray, other: np.ndarray) -> float:
    """Share of people who are classified correctly by what is learned from all the others; shapes (P, F)."""
    features, of = np.concatenate([one, other]), np.repeat([0, 1], [len(one), len(other)])
    right = 0
    for i in range(len(features)):
        rest = np.arange(len(features)) != i
        means = [features[rest & (of == kind)].mean(axis=0) for kind in (0, 1)]
        left = features[rest] - np.array(means)[of[rest]]
        scatter = left.T @ left / len(left)
        scatter += 1e-3 * np.diag(np.diag(scatter)) + 1e-12 * np.eye(len(scatter))
        away = [(features[i] - mean) @ np.linalg.solve(scatter, features[i] - mean) for mean in means]
        right += int(np.argmin(away) == of[i])
    return right / len(features)


EXPERIMENTS = {"double step": (double_step, of_steps), "multi-sine": (multi_sine, of_sines)}
found = {}
for experiment, (trial, summarise) in EXPERIMENTS.items():
    for place, name in enumerate(CONTROLLERS):  # every person has other seeds
        rows = []
        for number in range(given.people):
            seeds = 1000 * (100 * place + number) + np.arange(given.trials)
            trials = [trial(name, int(seed)) for seed in seeds]
            rows.append([summarise(trials[:n]) for n in counts])
            print(f"{experiment}, {name}: person {number + 1} of {given.people}", file=sys.stderr, flush=True)
        found[experiment, name] = np.array(rows)  # (people, counts, features)

# %%
# The share of people classified correctly, for each pair of controllers and number of trials.
pairs = list(combinations(CONTROLLERS, 2))
power = {
    (experiment, pair): [rightly(*(found[experiment, name][:, i] for name in pair)) for i in range(len(counts))]
    for experiment in EXPERIMENTS
    for pair in pairs
}
figure, panels = plt.subplots(1, 2, figsize=(9, 4.6), layout="constrained", sharey=True)
for axes, experiment in zip(panels, EXPERIMENTS, strict=True):
    shares = np.array([power[experiment, pair] for pair in pairs])
    image = axes.imshow(100 * shares, vmin=50, vmax=100, aspect="auto", cmap="viridis")
    for (i, j), share in np.ndenumerate(shares):
        axes.text(j, i, f"{100 * share:.0f}", ha="center", va="center", color="white" if share < 0.8 else "black")
    axes.set(title=experiment, xlabel="trials", xticks=range(len(counts)), xticklabels=counts)
    axes.set(yticks=range(len(pairs)), yticklabels=[" – ".join(pair) for pair in pairs])
figure.colorbar(image, ax=panels, label="people classified correctly (%)")


def enough(experiment: str, pair: tuple[str, str]) -> str:
    """The smallest number of trials from which on 95 % are classified correctly."""
    good = [share >= 0.95 for share in power[experiment, pair]]
    least = next((n for i, n in enumerate(counts) if all(good[i:])), None)
    return f"{least}" if least else f"> {counts[-1]}"


print(f"{'trials for 95 % correct':<30} {'double step':>12} {'multi-sine':>12}")
for pair in pairs:
    print(f"{' – '.join(pair):<30} {enough('double step', pair):>12} {enough('multi-sine', pair):>12}")
print("\nmedians, all trials:  RT1, its spread, RT2 - RT1 short and long (s), responded to; remnant (%), coherence")
for name in CONTROLLERS:
    steps, sines = (np.median(found[experiment, name][:, -1], axis=0) for experiment in EXPERIMENTS)
    print(f"{name:<14}", *(f"{value:8.3f}" for value in steps), f"{100 * np.exp(sines[0]):8.2f} {sines[1]:8.3f}")
if given.picture:
    figure.savefig(given.picture, dpi=130)
