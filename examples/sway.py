"""Does the model stand like people?
=================================

The shipped case ``quiet-standing`` is compared with young people who stand quietly: the centre of pressure in the
anterior–posterior direction, and the intersection point of the ground reaction forces, on both plants. Grey bands show
mean and standard deviation of young people, over 24 trials of eight people, and for the intersection point over 65
people. Their values and sources are in :download:`young_people.csv <../../examples/young_people.csv>`, and a recording
is in :download:`standing.csv <../../examples/standing.csv>`; put both files beside the notebook.
"""

import csv
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import icmj

SEEDS, SETTLE, RATE = range(3), 10.0, 100.0
examples = Path(__file__).resolve().parent if "__file__" in globals() else Path()

with (examples / "young_people.csv").open(encoding="utf-8") as file:
    rows = list(csv.reader((line for line in file if not line.startswith("#")), delimiter=";"))[1:]
people = {name: np.array([row[1:] for row in rows if row[0] == name and row[1]], float).T for name, *_ in rows}
measures = {name: (float(mean), float(spread)) for name, at, mean, spread in rows if not at}

run = icmj.load_run("quiet-standing")
case = icmj.prepare(run.with_(**{"simulation.duration": SETTLE + 60.0}))


def recorded(simulation: icmj.Simulation) -> dict[str, np.ndarray]:
    """What a force plate records of a run that has settled: angle of the force [rad] and centre of pressure [m]."""
    force = icmj.engine.ground_force(case.model, simulation).chosen(["force.x", "force.z", "cop.x"])
    plate = icmj.study.sample_rows(icmj.experiments.force_angle(force, "force.x", "force.z"), simulation, RATE, SETTLE)
    return {name: plate[name] for name in ("force_angle", "cop.x")}


# %%
# Every run has other noise. Its centre of pressure is measured in the same way as that of a person.
height = icmj.reaction(case.model).height  # of the centre of mass above the ground [m]
found: dict[str, tuple[list[icmj.measurement.Sway], list[icmj.experiments.IntersectionPoint]]] = {}
for plant in ("linear", "mujoco"):
    batch = icmj.simulate_many(case, plant=plant, seeds=SEEDS, keep=recorded, jobs=1)
    t = np.arange(batch["cop.x"].shape[1]) / RATE
    sways, points = [], []
    for angle, cop in zip(batch["force_angle"], batch["cop.x"], strict=True):
        sways.append(icmj.measure_sway(icmj.Series(t, 1e3 * cop[:, None], ("cop",), ("mm",))))
        plate = icmj.Series(t, np.column_stack([angle, cop]), ("force_angle", "cop"), ("rad", "m"))
        points.append(icmj.experiments.intersection_point(plate, height=height))
    found[plant] = sways, points


def numbers(sway: icmj.measurement.Sway) -> list[float]:
    """The six measures of a run."""
    c = sway.coordinates[0]
    assert c.diffusion.short is not None
    assert c.diffusion.long is not None
    return [c.rms, c.speed, c.frequencies.slope, c.frequencies.mean, c.diffusion.short.H, c.diffusion.long.H]


means = {plant: np.mean([numbers(sway) for sway in sways], axis=0) for plant, (sways, _) in found.items()}
for place, (name, (mean, spread)) in enumerate(measures.items()):
    linear, mujoco = (means[plant][place] for plant in ("linear", "mujoco"))
    print(f"{name:22} linear {linear:6.2f}   MuJoCo {mujoco:6.2f}   people {mean:6.2f} ± {spread:.2f}")
f, z, spread = people["intersection point (1) at Hz"]
for plant, (_, points) in found.items():
    ours = np.interp(f, points[0].frequency, np.mean([point.ratio for point in points], axis=0))
    print(f"intersection point, {plant}: {np.sqrt(np.mean((ours - z) ** 2)):.2f} RMSE with respect to people")

# %%
# The person in the first panel is one of the eight.
GREY, COLOUR, LINE = "#c9ccd1", {"linear": "#0072b2", "mujoco": "#d55e00"}, {"linear": "-", "mujoco": (0, (4, 1.5))}
WORDS = {"linear": "model, linear plant", "mujoco": "model, MuJoCo"}
person = icmj.read_series(examples / "standing.csv", columns=["ap"], rate=RATE).values[:, 0] * 10  # was in cm
size, size_spread = measures["RMS (mm)"]

with plt.rc_context({"font.size": 8.5, "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False}):
    figure = plt.figure(figsize=(8, 5.6), layout="constrained")
    grid = figure.add_gridspec(2, 3)
    path, *below = (figure.add_subplot(where) for where in (grid[0, :], grid[1, 0], grid[1, 1], grid[1, 2]))
    traces = [
        ("a person", "#222222", person - person.mean()),
        *((WORDS[plant], COLOUR[plant], found[plant][0][0].series.values[:, 0]) for plant in ("linear", "mujoco")),
    ]
    for row, (words, colour, trace) in enumerate(traces):
        for wide in (size + size_spread, size):
            path.axhspan(-30 * row - wide, -30 * row + wide, color=GREY, alpha=0.4, linewidth=0)
        path.plot(np.arange(len(trace)) / RATE, trace - trace.mean() - 30 * row, color=colour, linewidth=0.8)
        path.text(60, -30 * row + 14, words, color=colour, ha="right")
    path.set(xlim=(0, 60), ylim=(-76, 17), yticks=[-5, 5], yticklabels=["", "10 mm"], xlabel="time (s)")
    path.set_ylabel("centre of pressure, front to back")
    path.spines["left"].set_bounds(-5, 5)

    def band(axes: plt.Axes, name: str, log: bool) -> None:
        """Draw the mean of the people, and one standard deviation on either side of it."""
        at, mean, deviation = people[name]
        low, middle, high = (mean + k * deviation for k in (-1, 0, 1))
        if log:
            low, middle, high = 10**low, 10**middle, 10**high
        axes.fill_between(at, low, high, color=GREY, alpha=0.7, linewidth=0, label="young people")
        axes.plot(at, middle, color="#80848c", linewidth=1)

    band(below[0], "log10 spectrum (mm2/Hz) at Hz", log=True)
    band(below[1], "log10 square displacement (mm2) at s", log=True)
    band(below[2], "intersection point (1) at Hz", log=False)
    for plant, (sways, points) in found.items():
        drawn = {"color": COLOUR[plant], "linestyle": LINE[plant], "linewidth": 1.3, "label": WORDS[plant]}
        lines = sways[0].spectrum.frequency
        power = np.exp(np.mean([np.log(sway.spectrum.power[1:, 0]) for sway in sways], axis=0))
        below[0].plot(lines[1:], power, **drawn)
        lag = sways[0].coordinates[0].diffusion.lag
        moved = [np.log(sway.coordinates[0].diffusion.displacement) for sway in sways]
        below[1].plot(lag, np.exp(np.mean(moved, axis=0)), **drawn)
        below[2].plot(points[0].frequency, np.mean([point.ratio for point in points], axis=0), **drawn)
    below[0].set(xscale="log", yscale="log", xlim=(0.03, 5), ylim=(3e-4, 3e2), xlabel="frequency (Hz)")
    below[0].set_ylabel("spectrum (mm²/Hz)")
    below[1].set(xscale="log", yscale="log", xlim=(0.02, 10), ylim=(5e-3, 2e2), xlabel=r"$\Delta t$ (s)")
    below[1].set_ylabel(r"$\langle\Delta x^2\rangle$ (mm²)")
    below[2].set(xlim=(0.4, 8), ylim=(0, 3.3), xlabel="frequency (Hz)", ylabel="intersection point, $z/h$")
    below[2].axhline(1, color="#222222", linewidth=0.7, linestyle=(0, (1, 2)))
    below[2].legend(loc="upper right")
    plt.show()
