"""Every key of every kind of experiment on recordings: another value gives another result, or is refused by name."""

from typing import Any

import numpy as np
import pytest

import icmj
from icmj.controller.step_pairs import double_steps
from icmj.errors import DataError, IcmjError, RunFileError
from icmj.experiments.stance_channels import StanceChannels
from icmj.series.series import Series
from icmj.simulation.ternary import make_ternary_lines
from icmj.study.experiment_file import ExperimentFile
from icmj.study.kinds import KINDS

OF_THE_STIMULUS = {
    "intersection_point": set(),
    "quiet_standing": set(),
    "multisine": {"input", "setpoint", "amplitude"},
    "perturbed_stance": {"size", "axis_height", "vertical", "vertical_rate", "output"},
    "double_step": {"output", "combination", "unit", "size", "isi", "repetitions", "directions", "recovery"},
}
"""Keys that say how a stimulus is simulated; a recording has its own."""
SINES = (0.5, 1.0, 1.5)  # Hz


def wander(seed: int, rows: int, columns: int) -> np.ndarray:
    """Slow random motions about 0, which wander farther at first."""
    draw = np.random.default_rng(seed)
    steps = draw.standard_normal((rows, columns)) * (1 + 3 * np.exp(-np.arange(rows) / 300))[:, None]
    moved = np.cumsum(steps, axis=0)
    return 1e-3 * (moved - np.linspace(moved[0], moved[-1], rows))


def forces() -> Series:
    rows = 100 * 40
    values = wander(1, rows, 8)
    values[:, [1, 4]] += 700
    names = ("force.x", "force.z", "cop.x", "force.y", "other.z", "cop.y", "lean", "other.x")
    return Series(np.arange(rows) / 100, values, names, ("N", "N", "m", "N", "N", "m", "rad", "N"))


def sway() -> Series:
    return Series(np.arange(4000) / 100, 0.1 * wander(2, 4000, 2), ("ap", "ml"), ("m", "m"))


def answered(period: float, lines: np.ndarray, response: np.ndarray, periods: int, units: tuple[str, str]) -> Series:
    """A stimulus, another one, and two responses to both, with noise and a transient that dies out at the start."""
    t = np.arange(round(100 * period) * periods) / 100
    turns, draw = np.exp(2j * np.pi * np.outer(t, lines)), np.random.default_rng(3)
    values = np.column_stack([(turns @ a).real for a in (np.ones(len(lines)), 2 * np.ones(len(lines)), response)])
    values = np.column_stack([values, 2 * values[:, 2]])
    values[:, 2:] += 0.05 * values[:, 2:].std(axis=0) * draw.standard_normal((len(t), 2))
    values[:, 2:] += values[:, 2:].std(axis=0) * 3 * np.exp(-t / period)[:, None]
    return Series(t, 0.01 * values, ("stimulus", "stimulus2", "body", "body2"), (*units[:1] * 2, *units[1:] * 2))


def sines() -> Series:
    return answered(2.0, np.array(SINES), np.array([1.0, 0.8j, -0.5]), 12, ("N m", "rad"))


def tilts() -> Series:
    """Lines of the sequence up to 1 Hz, to which all up to 0.9 Hz are answered as by channels."""
    lines = make_ternary_lines(0.0175, 0.05, 1.0)[:, 1] / (2 * np.pi)
    body = StanceChannels(60.0, 588.6, 100.0, 4.0, 800.0, 250.0, 0.15, 0.6)
    return answered(242 * 0.05, lines, body.response(lines), 6, ("rad", "rad"))


def steps() -> Series:
    """Pairs of steps that jumps answer late by what is left of a refractory duration; later in a second control."""
    pairs = double_steps((0.15, 0.25, 0.35, 0.5), 3, recovery=(2.0, 2.5), seed=1)
    t = 0.01 * np.arange(round(100 * pairs.end))
    target = (t[:, None] >= pairs.t.ravel() - 1e-9) @ pairs.sizes.ravel()
    draw, controls = np.random.default_rng(5), []
    for late in (0.14, 0.2):
        seconds = late + np.column_stack([0 * pairs.isi, np.maximum(0, 0.35 - pairs.isi)])
        since = t[:, None] - (pairs.t + seconds).ravel()
        answer = np.where(since >= 0, 1 + 1.4 * np.exp(-28 * np.maximum(since, 0)), 0) @ pairs.sizes.ravel()
        controls.append(answer + 0.02 * draw.standard_normal(len(t)))
    values = np.column_stack([target, *controls, np.roll(target, 3)])
    return Series(t, values, ("target", "control", "control2", "target2"), ("rad", "N m", "N m", "rad"))


BASES: dict[str, tuple[Any, dict[str, Any]]] = {
    "intersection_point": (forces, {"settle": 5.0, "duration": 30.0}),
    "quiet_standing": (sway, {"settle": 5.0, "duration": 30.0}),
    "multisine": (
        sines, {
            "input": "u", "amplitude": 1.0, "period": 2.0, "lines": list(SINES), "periods": 6, "settle": 2,
            "response": "body",
        },
    ),
    "perturbed_stance": (
        tilts, {
            "size": 0.0175, "interval": 0.05, "highest": 1.0, "periods": 3, "settle": 1, "inertia": 60.0,
            "toppling": 588.6, "stiffness": 100.0, "damping": 4.0,
        },
    ),
    "double_step": (steps, {"output": "angle", "size": 1.0, "isi": [0.15, 0.25, 0.35, 0.5], "recovery": [2.0, 2.5]}),
}  # fmt: skip
OTHER: dict[str, dict[str, Any]] = {
    "intersection_point": {
        "duration": 25.0, "settle": 8.0, "rate": 50.0, "window": 4.0, "low": 0.8, "high": 6.0, "axis": "y",
        "height": 0.9, "angle": "lean", "force": ["other.x", "force.z"], "cop": "cop.y",
    },
    "quiet_standing": {"duration": 25.0, "settle": 8.0, "rate": 50.0, "low_pass": 5.0, "columns": ["ml"],
        "measures": ["nothing"],
    },
    "multisine": {
        "period": 1.0, "lines": [0.5, 1.0], "periods": 5, "settle": 4, "rate": 50.0, "response": "body2",
        "stimulus": "stimulus2",
    },
    "perturbed_stance": {
        "interval": 0.06, "highest": 0.8, "periods": 4, "settle": 2, "rate": 50.0, "inertia": 70.0, "toppling": 500.0,
        "stiffness": 200.0, "damping": 0.0, "stimulus": "stimulus2", "response": "body2",
    },
    "double_step": {"rate": 50.0, "latest": 0.25, "shortest": 0.2, "control": "control2", "target": "target2"},
}  # fmt: skip
REFUSED = {
    ("quiet_standing", "measures"): "no measure 'nothing'",
    ("multisine", "period"): "lines: 0.5 Hz is no whole multiple of 1 / period",
    ("multisine", "lines"): "off the lines",
    ("perturbed_stance", "interval"): "off the lines",
    ("perturbed_stance", "highest"): "off the lines",
    ("double_step", "rate"): "rate = 50 in the file",
}
"""What is not analysed otherwise; a stimulus, for one, has no other period than its own."""


def analyse(kind: str, table: dict[str, Any], path) -> dict[str, np.ndarray]:
    """The curves and numbers of a recording by a file with this table."""
    data = {"experiment": {"name": "keys"}, kind: table, "case": [{"run": "simple-0.8"}]}
    file = ExperimentFile.validated(data, path.with_name("keys.toml"))
    (told,) = icmj.analyse_recordings(file, [path]).found
    assert told.finding is not None
    numbers = {name: np.array([value]) for name, value in told.finding.numbers.items()}
    return {**told.finding.curves, **numbers}


def alike(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> bool:
    if one.keys() != other.keys() or any(np.shape(one[name]) != np.shape(other[name]) for name in one):
        return False
    return all(np.allclose(one[name], other[name], rtol=1e-9, atol=0, equal_nan=True) for name in one)


@pytest.fixture(scope="module", params=sorted(KINDS.names))
def base(request, tmp_path_factory):
    kind = request.param
    make, table = BASES[kind]
    path = tmp_path_factory.mktemp(kind) / "recording.csv"
    icmj.write_series(make(), path)
    return kind, path, table, analyse(kind, table, path)


def test_another_value_of_a_key_gives_another_result_or_is_refused(base):
    """settle, duration, periods and rate of all kinds, and the axis of the intersection point, had no effect."""
    kind, path, table, first = base
    assert alike(first, analyse(kind, table, path))
    without, refused = [], {}
    for key, value in OTHER[kind].items():
        try:
            found = analyse(kind, {**table, key: value}, path)
        except (DataError, RunFileError) as error:
            refused[key] = str(error)
            continue
        if alike(first, found):
            without.append(key)
    assert refused.keys() == {key for of, key in REFUSED if of == kind}
    assert all(REFUSED[kind, key] in said for key, said in refused.items())
    assert not without, f"without effect in [{kind}]: {', '.join(without)}"


@pytest.mark.parametrize("kind", sorted(KINDS.names))
def test_every_key_is_one_of_the_stimulus_or_is_tried(kind):
    table = ExperimentFile.model_fields[kind].annotation.__args__[0]
    keys = set(table.model_fields)
    assert keys == OF_THE_STIMULUS[kind] | set(OTHER[kind])
    assert not OF_THE_STIMULUS[kind] & set(OTHER[kind])


def test_keys_that_are_left_out_leave_nothing_out_and_the_part_is_told(tmp_path, shell):
    icmj.write_series(sway(), tmp_path / "sway.csv")
    (tmp_path / "keys.toml").write_text('[experiment]\nname = "k"\n[quiet_standing]\n[[case]]\nrun = "simple-0.8"\n')
    words = ["experiment", str(tmp_path / "keys.toml"), "--recording", str(tmp_path / "sway.csv")]
    whole = icmj.quiet_standing([icmj.experiments.Recording(sway())], low_pass=10.0)
    told = shell.answers([*words, "--json", "--out", str(tmp_path / "whole")])
    assert told["notes"] == []
    assert told["found"][0]["numbers"]["ap, RMS (m)"] == pytest.approx(whole.numbers["ap, RMS (m)"], rel=1e-9)
    (tmp_path / "keys.toml").write_text(
        '[experiment]\nname = "k"\n[quiet_standing]\nsettle = 5.0\nduration = 30.0\nrate = 50.0\n'
        '[[case]]\nrun = "simple-0.8"\n'
    )
    told = shell.answers([*words, "--json", "--out", str(tmp_path / "part")])
    assert told["notes"] == [
        "sway.csv: analysed from 5 to 35 s",
        "sway.csv: resampled by a cubic spline at 50 Hz, below 20 Hz",
    ]
    page = (tmp_path / "part" / "report.html").read_text(encoding="utf-8").replace("\xa0", " ")
    assert "sway.csv: analysed from 5 to 35 s." in page
    said = shell.refuses([*words, "--since", "20", "--out", str(tmp_path / "short")])
    assert "20 s of record; settle and duration ask for 35 s" in said
    assert not (tmp_path / "short").exists()


def test_a_start_transient_is_left_out_as_settle_says(tmp_path):
    """The remnant of a recording with a transient was 53 % whatever settle said."""
    icmj.write_series(sines(), tmp_path / "sines.csv")
    base = {"input": "u", "amplitude": 1.0, "period": 2.0, "lines": list(SINES), "response": "body"}
    remnant = {
        settle: analyse("multisine", {**base, "settle": settle}, tmp_path / "sines.csv")["remnant, share of power"]
        for settle in (0, 8)
    }
    assert remnant[0] > 0.1
    # noise of 0.05 over the response, less what of it is at the lines and the last of the transient, e^-8
    assert remnant[8] == pytest.approx(0.05**2, rel=0.2)


def test_forces_that_a_person_lacks_before_settle_are_not_missed(tmp_path):
    """Somebody steps on the plate at 2 s: the vertical force is 0 before, and nothing is told of that part."""
    standing = forces()
    values = standing.values.copy()
    values[:200, 1] = 0.0
    icmj.write_series(Series(standing.t, values, standing.names, standing.units), tmp_path / "plate.csv")
    assert analyse("intersection_point", {"settle": 2.5}, tmp_path / "plate.csv")["z (m)"].size
    with pytest.raises(IcmjError, match="not positive throughout"):
        analyse("intersection_point", {}, tmp_path / "plate.csv")


def test_options_of_recordings_are_refused_without_one(shell):
    for option in ("rate", "since", "until"):
        said = shell.refuses(["experiment", "standing", f"--{option}", "10"])
        assert f"--{option} is of recordings; give --recording" in said
