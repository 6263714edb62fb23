"""Every way to the same run gives the same bits, or refuses in one line: no way leaves out a part of the run file."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

import icmj
from icmj import Simulation, load_run, read_log, run_case
from icmj.case.case import revise
from icmj.case.plants import linear_plant
from icmj.controller import Channel
from icmj.cycle.family import ReturnMaps
from icmj.cycle.parameter import find_parameter
from icmj.errors import CycleError, IcmjError, RunFileError
from icmj.experiments import attractors, measure_growth, measure_law, rounds
from icmj.runfile.schema import RunFile, overridden
from icmj.runfile.sweep_tables import SweepFile
from icmj.simulation.settings import reseed
from icmj.study.chunk import compute
from icmj.study.experiment import Condition, trial
from icmj.study.experiment_file import ExperimentFile
from icmj.study.plan import Plan
from icmj.study.sweep import try_plan

Plant = Literal["linear", "mujoco"]
SIGNALS = ("t", "x", "y", "u", "x_o", "x_h", "E", "applied", "pushed")
OWN = '''
"""Noise of somebody's own, and a number of all bits of a run."""
import hashlib
import numpy as np

def swaying(size, duration):
    return [[size, 3.0, 0.2, 0.1 * duration, 0.9 * duration], [size, 7.0, 0.0, 0.0, duration]]

def digest(run):
    total = hashlib.sha256()
    for name in ("t", "x", "y", "u", "x_o", "x_h", "E", "applied", "pushed"):
        total.update(np.ascontiguousarray(getattr(run, name)).tobytes())
    total.update(run.events.t.tobytes() + run.outcome.kind.encode())
    return {"digest": int(total.hexdigest()[:13], 16)}
'''
NO_DELAY = {"assumed.delay": None}
TORQUE = {"input": "ankle_torque"}
FEATURES: dict[str, dict[str, Any]] = {
    "nothing": {},
    "no delay": NO_DELAY,
    "another actual delay": {"actual.delay": 0.25},
    "least interval below the delay": {"controller.delta_min": 0.05},
    "sampling delay": {"controller.sampling_delay": 0.03},
    "zero-order hold": {"controller.hold": "zero-order"},
    "box rule": {"controller": {"rule": "box", "threshold": [0.002, 0.004], "delta_min": 0.1}},
    "continuous predictor": {"controller": {"kind": "predictor"}},
    "switching": {
        "controller": {"kind": "switching", "position": "lean", "rate": "lean_rate", "P": 150, "D": 10, "share": 0.7}
    },
    "delayed PD": {
        "controller": {"kind": "delayed-pid", "position": "lean", "rate": "lean_rate", "P": 240.0, "D": 80.0},
        "assumed.delay": 0.05,
    },
    "set-point step": {"setpoint": [{"kind": "step", "output": "lean", "size": 0.02, "start": 0.4}]},
    "set-point from the start": {"setpoint": [{"kind": "step", "output": "lean", "size": 0.02}], **NO_DELAY},
    "set-point sequence": {"setpoint": [{"kind": "ternary", "output": "lean", "size": 0.02, "interval": 0.13}]},
    "set-point of a file": {"setpoint": [{"kind": "file", "output": "lean", "file": "moved.csv", "column": "target"}]},
    "predictor with a set-point": {
        "controller": {"kind": "predictor"},
        "setpoint": [{"kind": "pulse", "output": "lean", "size": 0.02, "start": 0.4, "duration": 0.7}],
    },
    "impulse": {"simulation.disturbance": [{"kind": "impulse", "size": 3.0, "start": 0.5, **TORQUE}]},
    "push of the body": {
        "simulation.disturbance": [{"kind": "step", "body": "body", "force": [2.0, 0, 0], "start": 0.5}]
    },
    "bias": {"simulation.disturbance": [{"kind": "bias", "output": "lean", "size": 0.004, "start": 0.5}]},
    "noise": {
        "simulation.disturbance": [
            {"kind": "noise", "size": 2.0, "bandwidth": 3.0, "seed": 3, **TORQUE},
            {"kind": "noise", "size": 1e-3, "corner": 1.0, "terms": 20, "seed": 4, "output": "lean"},
        ]
    },
    "gaussian noise": {"simulation.disturbance": [{"kind": "gaussian", "size": 2.0, "seed": 3, **TORQUE}]},
    "share of the command": {
        "simulation.disturbance": [{"kind": "gaussian", "share": 0.2, "interval": 0.05, "seed": 3, **TORQUE}]
    },
    "tilt": {
        "simulation.disturbance": [{"kind": "ternary", "surface": "tilt", "size": 0.01, "vertical": {"lean": 0.3}}]
    },
    "own noise": {"simulation.disturbance": [{"kind": "own:swaying", "parameters": {"size": 1.0}, **TORQUE}]},
    "disturbance of a file": {
        "simulation.disturbance": [{"kind": "file", "file": "moved.csv", "column": "target", "size": 90.0, **TORQUE}]
    },
    "another mass": {"actual.change": [{"what": "mass", "of": "body", "factor": 1.05}], "actual.rho": 0.5},
    "muscles": {"assumed.activation": {"order": 1, "time_constant": 0.05}, **NO_DELAY},
    "start of the observer": {"simulation.observer": {"ankle": 0.01}, "simulation.initial": {"ankle_rate": 0.05}},
    "a fall": {"simulation.limit": 0.0101},
    "timestep": {"simulation.timestep": 0.004},
    "integrator": {"simulation.integrator": "implicitfast"},
    "tolerance": {"simulation.tolerance": 1e-6},
    "rows": {"simulation.record_interval": 0.037},
    "all at once": {
        "setpoint": [{"kind": "step", "output": "lean", "size": 0.01, "start": 0.3}],
        "simulation.disturbance": [
            {"kind": "file", "file": "moved.csv", "column": "target", "size": 50.0, **TORQUE},
            {"kind": "noise", "size": 1.0, "bandwidth": 3.0, "seed": 3, **TORQUE},
            {"kind": "bias", "output": "lean", "size": 0.001},
        ],
        "controller.sampling_delay": 0.02,
    },
}  # fmt: skip


@pytest.fixture(scope="module")
def base(root: Path, tmp_path_factory: pytest.TempPathFactory) -> RunFile:
    folder = tmp_path_factory.mktemp("routes")
    (folder / "own.py").write_text(OWN, encoding="utf-8")
    rows = "".join(f"{0.1 * i:.1f},{0.01 * np.sin(i):.6f}\n" for i in range(60))
    (folder / "moved.csv").write_text(f"t [s],target [rad]\n{rows}", encoding="utf-8")
    text = (root / "runs" / "rivals" / "one-link-event.toml").read_text(encoding="utf-8")
    (folder / "base.toml").write_text(text.replace("../../models", str(root / "models")), encoding="utf-8")
    run = load_run(folder / "base.toml", allow_code=True)
    return run.with_(**{"simulation.duration": 2.5, "study.measures": ["own:digest"], "study.growth_points": 0})


@pytest.fixture(scope="module")
def reference(base: RunFile) -> Callable[[str, Plant], tuple[RunFile, Simulation]]:
    @cache
    def of(feature: str, plant: Plant) -> tuple[RunFile, Simulation]:
        run = base.with_(**FEATURES[feature])
        return run, simulated(run, plant)

    return of


def simulated(run: RunFile, plant: Plant, seed: int | None = None) -> Simulation:
    """The run in the plainest way: prepared, and simulated."""
    case = prepared(run)
    if seed is not None:
        case = replace(case, settings=reseed(case.settings, seed))
    return icmj.simulate(case, plant)


def prepared(run: RunFile) -> Any:
    return icmj.prepare(run)


def same(one: Simulation, other: Simulation) -> None:
    for name in SIGNALS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    np.testing.assert_array_equal(one.events.t, other.events.t)
    np.testing.assert_array_equal(one.r, other.r)
    assert one.outcome.kind == other.outcome.kind


def by_parts(run: RunFile, plant: Plant) -> Simulation:
    """Plant, controller and settings of a case, put together by hand."""
    case = prepared(run)
    there = linear_plant(case.actual, case.settings) if plant == "linear" else case.actual
    law = case.controller
    return icmj.simulate_plant(there, law, case.settings, match="position")


def by_start(run: RunFile, plant: Plant) -> Simulation:
    """The states at t = 0 given as vectors."""
    case = icmj.prepare(run)
    started = icmj.simulate(case, plant)
    bare = replace(case, settings=replace(case.settings, initial={}, observer={}))
    if not run.has_events:
        return icmj.simulate(bare, plant, start=(started.x[0],))
    x_h = case.controller.trigger.holds and case.controller.delay
    start = (started.x[0], started.x_o[0], *([started.x_h[0]] if x_h else []))
    return icmj.simulate(bare, plant, start=start)


def by_duration(run: RunFile, plant: Plant) -> Simulation:
    """The duration given to the function, longer than in the run file."""
    short = icmj.prepare(run.with_(**{"simulation.duration": 1.3}))
    return icmj.simulate(short, plant, duration=run.simulation.duration)


def by_revision(run: RunFile, plant: Plant) -> Simulation:
    """From a case with another threshold, duration and set-point."""
    if not run.has_events:
        other = icmj.prepare(run.with_(**{"simulation.duration": 1.3, "setpoint": None}))
        same(icmj.simulate(revise(other, run), plant), found := icmj.simulate(icmj.prepare(run, like=other), plant))
        return found
    key = "controller.threshold" if run.intermittent.rule == "box" else "controller.q_t"
    changes = {} if run.intermittent.rule == "box" else {key: 0.003}
    other = icmj.prepare(run.with_(**{**changes, "simulation": {"duration": 1.3}, "setpoint": None}))
    return icmj.simulate(revise(other, run), plant)


def by_override(run: RunFile, plant: Plant) -> Simulation:
    """As ``--set`` on the command line changes it."""
    other = run.with_(**{"simulation.duration": 1.3})
    return simulated(overridden(other, ["simulation.duration=2.5"]), plant)


def by_text(run: RunFile, plant: Plant) -> Simulation:
    """Its text written and read."""
    path = run.path.parent / "written.toml"
    path.write_text(run.text, encoding="utf-8")
    return simulated(load_run(path, allow_code=True), plant)


def by_drawn(run: RunFile, plant: Plant) -> Simulation:
    """With the numbers that a log keeps of code and files."""
    return simulated(run.resolve(), plant)


def by_log(run: RunFile, plant: Plant) -> Simulation:
    """The complete run; it logged; and the run file taken from the log."""
    result = run_case(prepared(run), plant)
    path = run.path.parent / "a.rrd"
    icmj.write_log(result, path)
    back = read_log(path)
    same(back.simulation, result.simulation)
    with back.run.at_hand() as again:
        same(simulated(again, plant), result.simulation)
    return result.simulation


def by_many(run: RunFile, plant: Plant) -> Simulation:
    case = prepared(run)
    found: list[Simulation] = []

    def keep(one: Simulation) -> dict[str, Any]:
        found.append(one)
        return {}

    batch = icmj.simulate_many(case, 1, plant=plant, seeds=[3], keep=keep, jobs=1)
    again = batch.case(0)
    same(found[0], icmj.simulate(again, plant))
    same(found[0], simulated(run, plant, 3))
    kept = icmj.simulate_many(case, 1, plant=plant, seeds=[3], keep=("events", "y"), jobs=1)
    np.testing.assert_array_equal(kept["events"][0], found[0].events.t)
    return simulated(run, plant)


def by_sweep(run: RunFile, plant: Plant) -> Simulation:
    """One point of a sweep over the duration, whose own measure is a number of all bits."""
    path = run.path.parent / "sweep.toml"
    data = {
        "sweep": {"name": "a", "run": "base.toml"},
        "vary": [{"field": "simulation.duration", "values": [1.3, run.simulation.duration]}],
        "ask": {"motion": [plant]},
    }
    file = SweepFile.validated(data, path, base=run, allow_code=True)
    plan = try_plan(Plan.of(file))
    import io

    import pyarrow.parquet as pq

    row = pq.read_table(io.BytesIO(compute(plan, range(2)).content)).to_pylist()[1]
    if row["status"] != "ok":
        raise IcmjError(row["words"])
    alone = simulated(run, plant)
    own: dict[str, Any] = {}
    exec(OWN, own)
    assert row[f"{plant}_measure_digest"] == own["digest"](alone)["digest"]
    return alone


def by_experiment(run: RunFile, plant: Plant) -> Simulation:
    """The second of two trials; their stimulus is the duration, and their noise has seeds of its own."""
    data = {
        "experiment": {"name": "a", "plants": [plant]},
        "case": [{"run": "base.toml"}],
        "quiet_standing": {"duration": 1.5, "settle": 0.5, "columns": ["y.lean"], "low_pass": None},
    }
    file = ExperimentFile.validated(data, run.path.parent / "experiment.toml", allow_code=True)
    kind = file.settings
    one = Condition("a", "a", plant, file.case[0], run)
    other = replace(one, run=run.with_(setpoint=None))
    trial(kind, other, 8)
    found = trial(kind, one, 7)
    stimulated = kind.stimulate(run, 7)
    alone = simulated(stimulated, plant, 7)
    np.testing.assert_array_equal(found.series.values, kind.record(prepared(stimulated), alone).values)
    t, settle = alone.events.t, kind.begin  # a trial begins where the run has settled
    np.testing.assert_array_equal(found.events, t[t >= settle - 1e-9] - settle)
    return simulated(run, plant)


def by_intervals(run: RunFile, plant: Plant) -> Simulation:
    """From event to event, by the open-loop interval as a function."""
    case = prepared(run)
    alone = simulated(run, plant)
    fly = icmj.open_loop(case, plant)
    x, x_o, x_h = alone.x[0], alone.x_o[0], alone.x_h[0]
    t, times = 0.0, []
    while len(times) < len(alone.events):
        flight = fly(x, x_o, x_h, t)
        assert flight.outcome is None
        t += flight.length
        times.append(t)
        x, x_o, x_h = flight.x, flight.x_o, flight.x_h if case.controller.delay else flight.x_o
    # cut otherwise into steps: of the linear plant rounding, in MuJoCo the error of the integration
    np.testing.assert_allclose(times, alone.events.t, atol=1e-9 if plant == "linear" else 1e-4)
    return alone


def by_composition(run: RunFile, plant: Plant) -> Simulation:
    """Plant, controller and settings composed into a run file of matrices."""
    if not run.has_events:
        law = icmj.prepare(run).controller
        icmj.compose_run(law.plant, law, name="composed")  # type: ignore[arg-type]
    case = icmj.prepare(run)
    actual = linear_plant(case.actual, case.settings)
    return simulated(icmj.compose_run(actual, case.controller, case.settings, name="composed"), "linear")


ROUTES: dict[str, Callable[[RunFile, Plant], Simulation]] = {
    route.__name__: route
    for route in (
        by_parts, by_start, by_duration, by_revision, by_override, by_text, by_drawn, by_log, by_many,
        by_sweep, by_experiment, by_intervals, by_composition,
    )
}  # fmt: skip
NO_INTERVAL, NO_RULE = "an interval is no function of the state", "open_loop needs an event rule"
LONGER = "is known for a run of 1.3 s, not of 2.5 s; set simulation.duration"
REFUSED = {
    **{("by_intervals", feature): NO_INTERVAL for feature in FEATURES if "setpoint" in FEATURES[feature]},
    **{("by_composition", feature): "has a set-point" for feature in FEATURES if "setpoint" in FEATURES[feature]},
    ("by_composition", "push of the body"): "names 'body', which the model lacks",
    ("by_composition", "tilt"): "a linear plant knows no bodies",
    ("by_duration", "set-point sequence"): LONGER,
    ("by_duration", "set-point of a file"): LONGER,
    ("by_duration", "own noise"): LONGER,
    ("by_duration", "disturbance of a file"): LONGER,
    ("by_duration", "all at once"): LONGER,
}
for _feature in ("continuous predictor", "switching", "delayed PD", "predictor with a set-point"):
    REFUSED |= {("by_intervals", _feature): NO_RULE, ("by_composition", _feature): "takes a Controller, got"}


QUICK = ("nothing", "set-point step", "predictor with a set-point", "disturbance of a file", "all at once")
# what acts in the engine alone or in another way there; a route knows of no plant, so that the others run on one
ENGINE = (
    "nothing", "push of the body", "tilt", "another mass", "muscles", "share of the command", "delayed PD", "timestep",
    "integrator", "tolerance", "all at once",
)  # fmt: skip
EACH = [
    *(pytest.param(one, "linear", marks=() if one in QUICK else pytest.mark.slow) for one in FEATURES),
    *(pytest.param(one, "mujoco", marks=pytest.mark.slow) for one in ENGINE),
]


@pytest.mark.parametrize(("feature", "plant"), EACH)
def test_every_way_to_the_same_run_gives_the_same_bits(
    feature: str, plant: Plant, base: RunFile, reference: Callable[[str, Plant], tuple[RunFile, Simulation]]
) -> None:
    run, alone = reference(feature, plant)
    if feature != "nothing":
        plain = reference("nothing", plant)[1]
        ignored = plant == "linear" and feature in ("timestep", "integrator", "tolerance")
        equal = len(plain.t) == len(alone.t) and np.array_equal(plain.y, alone.y)
        assert equal == ignored, "the feature does nothing"
    wrong = []
    for name, route in ROUTES.items():
        words = REFUSED.get((name, feature))
        if plant == "mujoco" and name == "by_composition":  # matrices are of the linear plant
            continue
        try:
            found = route(run, plant)
            same(found, alone)
            if words is not None:
                wrong.append(f"{name}: not refused, though expected to be: {words}")
        except IcmjError as error:
            if words is None or words not in str(error) or "\n" in str(error):
                wrong.append(f"{name}: {type(error).__name__}: {error}")
        except AssertionError as error:
            wrong.append(f"{name}: another run: {' '.join(str(error).split())[:200]}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.slow
def test_processes_follow_a_set_point(base: RunFile) -> None:
    run = base.with_(**FEATURES["all at once"])
    case = icmj.prepare(run)
    kept = icmj.simulate_many(case, 17, keep=("events",), jobs=2)
    alone = simulated(run, "linear", 1)
    np.testing.assert_array_equal(kept["events"][1][: len(alone.events)], alone.events.t)


def test_trials_of_one_process_have_each_their_own_set_point(base: RunFile) -> None:
    """Of a predictor, too, whose set-point was that of the first trial: in each, the pairs are in another order."""
    steps = {"output": "lean", "size": 0.01, "isi": [0.1, 0.2, 0.4], "repetitions": 1, "recovery": [1.0, 2.0]}
    data = {
        "experiment": {"name": "a", "plants": ["linear"]},
        "case": [{"run": "base.toml"}],
        "double_step": steps,
    }
    file = ExperimentFile.validated(data, base.path.parent / "experiment.toml", allow_code=True)
    kind = file.settings
    for changes in ({}, FEATURES["continuous predictor"]):
        one = Condition("a", "a", "linear", file.case[0], base.with_(**changes))
        for seed in (3, 4):
            found = trial(kind, one, seed).series
            run = kind.stimulate(one.run, seed)
            np.testing.assert_array_equal(found.values, kind.record(prepared(run), simulated(run, "linear")).values)


def test_what_theory_is_of_knows_neither_set_point_nor_disturbance(base: RunFile) -> None:
    """Growth under a clock is that of the loop itself, and agrees with the eigenvalues of φ as without them."""
    quiet = base.with_(**FEATURES["no delay"])
    driven = quiet.with_(**{"setpoint": FEATURES["all at once"]["setpoint"], **FEATURES["noise"]})
    plants: tuple[Plant, ...] = ("linear", "mujoco")
    for plant in plants:
        alone, beside = (measure_growth(icmj.prepare(run), plant, 3) for run in (quiet, driven))
        assert alone is not None
        assert beside is not None
        np.testing.assert_array_equal(alone.measured, beside.measured)
        np.testing.assert_allclose(beside.measured, beside.predicted, rtol=1e-4)


def test_a_branch_of_cycles_refuses_a_disturbance_of_a_file(base: RunFile) -> None:
    """Before it was read it was nothing, and the cycles were those without it."""
    for feature in ("disturbance of a file", "own noise", "noise"):
        family = ReturnMaps(base.with_(**FEATURES["no delay"], **FEATURES[feature]), find_parameter("b"), "linear")
        with pytest.raises(CycleError, match="computed only for a loop that does not vary with time"):
            family.at(0.9)


def test_a_sweep_asks_for_no_cycle_beside_a_set_point(base: RunFile) -> None:
    data = {
        "sweep": {"name": "a", "run": "base.toml"},
        "vary": [{"field": "actual.gain", "values": [0.9]}],
        "ask": {"cycle": ["linear"]},
    }
    run = base.with_(**FEATURES["set-point step"])
    with pytest.raises(RunFileError, match="a cycle is that of r = 0; take setpoint out"):
        SweepFile.validated(data, base.path.parent / "sweep.toml", base=run, allow_code=True)


def test_what_is_of_another_class_is_refused_in_one_line(base: RunFile) -> None:
    case: Any = icmj.prepare(base)
    trial: Any = icmj.prepare(base.with_(**FEATURES["switching"]))
    plant, model, law = case.actual.linearisation.plant, case.actual, case.controller
    design, lean = law.design, icmj.Target({"lean": 1.0}, np.array([[0.01, 0, 0, 0, 0]]))
    instead = "is a MujocoPlant; expected a LinearPlant; give its linearisation.plant"
    asked: list[tuple[Callable[[], object], str]] = [
        (lambda: icmj.simulate(law), "simulate takes a Case, got Controller"),
        (lambda: icmj.simulate(trial, trigger=icmj.Continuous()), "another trigger needs an event rule, and the"),
        (lambda: icmj.open_loop(trial), "open_loop needs an event rule, and the controller is of kind 'switching'"),
        (lambda: icmj.find_cycle(trial), "find_cycle needs an event rule, and the controller is of kind 'switching'"),
        (lambda: measure_growth(trial, "linear", 2), "growth under a clock needs an event rule, and the"),
        (lambda: measure_law(trial, [0.1, 0.2]), "the amplitude law needs an event rule, and the controller is"),
        (lambda: icmj.run_case(law, "linear"), "run_case takes a Case, got Controller"),
        (lambda: icmj.to_iosystem(plant, trial.controller), "to_iosystem takes a Controller, got SwitchingPD"),
        (lambda: icmj.to_iosystem(case), "the plant is a Case; expected a LinearPlant"),
        (lambda: attractors(plant, trial.controller, case.settings), "takes a Controller, got SwitchingPD"),
        (lambda: icmj.simulate_plant(plant, case, case.settings), "simulate_plant takes a Law, got Case"),
        (lambda: rounds(plant, law), "takes a SwitchingPD, got Controller"),
        (lambda: icmj.theory.predictor_loop(plant, law), "takes a PredictorController, got Controller"),
        (lambda: icmj.Design(model, design.k, design.L), instead),
        (lambda: icmj.setpoint(model, [lean]), instead),
        (lambda: icmj.SwitchingPD(model, "lean", "lean_rate", 1.0, 1.0, 0.2), instead),
        (lambda: icmj.SwitchingChannels(model, (Channel("lean", "lean_rate", 1.0, 1.0),), 0.2), instead),
        (lambda: icmj.DelayedPID(model, "lean", "lean_rate", 1.0, 1.0, delay=0.2), instead),
        (lambda: rounds(model, trial.controller), instead),
        (lambda: icmj.compose_run(model, law, name="a"), instead),
    ]
    for ask, words in asked:
        with pytest.raises(IcmjError) as told:
            ask()
        assert words in str(told.value)
