"""The shipped quiet-standing stands like young people, on both plants, whatever the noise it is given."""

import csv
from dataclasses import dataclass

import numpy as np
import pytest

import icmj
from icmj.engine.reaction import ground_force, reaction
from icmj.study.kind import sample_rows

SETTLE, RATE = 10.0, 100.0
CURVE = "intersection point (1) at Hz"
SPECTRUM = "log10 spectrum (mm2/Hz) at Hz"


@dataclass(frozen=True)
class People:
    """Measures by name with their deviation, the intersection point and the spectrum over frequency."""

    measures: dict[str, tuple[float, float]]
    frequency: np.ndarray
    point: np.ndarray
    spectrum: np.ndarray  # frequency, mean and deviation of the decadic logarithm in mm²/Hz


@pytest.fixture(scope="module")
def people(root):
    text = (root / "examples" / "young_people.csv").read_text(encoding="utf-8").splitlines()
    rows = list(csv.DictReader((line for line in text if not line.startswith("#")), delimiter=";"))
    curve = [(float(row["at"]), float(row["mean"])) for row in rows if row["quantity"] == CURVE]
    spectrum = [[float(row[key]) for key in ("at", "mean", "deviation")] for row in rows if row["quantity"] == SPECTRUM]
    measures = {row["quantity"]: (float(row["mean"]), float(row["deviation"])) for row in rows if not row["at"]}
    return People(measures, *np.array(curve).T, np.array(spectrum).T)


@pytest.fixture(scope="module")
def case(root):
    run = icmj.load_run(root / "runs" / "quiet-standing.toml")
    return icmj.prepare(run.with_(**{"simulation.duration": 60.0 + SETTLE}))


@pytest.mark.slow
@pytest.mark.parametrize(("plant", "seeds"), [("linear", 12), ("mujoco", 4)])
def test_it_stands_like_young_people(case, people, plant, seeds):
    """Room for other processors, on which events fall elsewhere: the mean of many trials lies within 0.7 deviations."""
    ground = reaction(case.model)

    def plate(run):
        if plant == "linear":
            signals = icmj.Series(run.t, run.x @ ground.C.T, ("force_angle", "cop.x"), ("rad", "m"))
        else:
            force = ground_force(case.model, run).chosen(["force.x", "force.z", "cop.x"])
            signals = icmj.experiments.force_angle(force, "force.x", "force.z").chosen(["force_angle", "cop.x"])
        even = sample_rows(signals, run, RATE, SETTLE)
        return {"values": even.values}

    batch = icmj.simulate_many(case, seeds, plant=plant, keep=plate, jobs=1)
    assert not any(kind == "fell" for kind in batch.outcome)
    measured, points, powers = [], [], []
    for values in batch["values"]:
        series = icmj.Series(np.arange(len(values)) / RATE, values, ("force_angle", "cop.x"), ("rad", "m"))
        sway = icmj.measure_sway(series, ["cop.x"])
        c = sway.coordinates[0]
        at, mean, _ = people.spectrum
        powers.append(np.interp(at, sway.spectrum.frequency[1:], np.log10(1e6 * sway.spectrum.power[1:, 0])) - mean)
        H = c.diffusion.short.H, c.diffusion.long.H
        measured.append((1e3 * c.rms, 1e3 * c.speed, c.frequencies.slope, c.frequencies.mean, *H))
        points.append(icmj.experiments.intersection_point(series, cop="cop.x", height=ground.height))
    z = np.array(
        [
            (np.array(values) - mean) / deviation
            for values, (mean, deviation) in zip(np.transpose(measured), people.measures.values(), strict=True)
        ]
    )
    means = dict(zip(people.measures, z.mean(axis=1), strict=True))
    assert means == pytest.approx(dict.fromkeys(people.measures, 0), abs=1)
    assert (np.abs(z) <= 1).mean() > 0.75  # of single trials; of people's own it is some two thirds
    curves = [np.interp(people.frequency, point.frequency, point.ratio) for point in points]
    assert np.sqrt(np.mean((np.mean(curves, axis=0) - people.point) ** 2)) < 0.15
    # docs/people.md: where the spectrum differs. Windows of half a minute give a minute five degrees of freedom, and
    # its logarithm a deviation of 0.7; three deviations of the mean of 12 are a factor of 1.8, and of 4 one of 2.9
    over, slow = 10 ** np.mean(powers, axis=0), people.spectrum[0]
    peak = over[(slow > 0.23) & (slow < 0.37)]
    room = {"linear": 1.8, "mujoco": 2.9}[plant]
    assert 2 / room < peak.min()
    assert 5 / room < peak.max() < 5 * room
    assert over[(slow > 0.55) & (slow < 0.8)].max() < room
