"""The estimate tells seconds from hours, what is too long is refused, and a run that gets nowhere ends."""

import re
import time
from pathlib import Path

import numpy as np
import pytest
from fault_cases import SHORT
from terminal_cases import told

from icmj import load_experiment, load_run, parse_run
from icmj.case.case import Case, PlantKind, prepare, simulate
from icmj.cli.main import main
from icmj.errors import StudyError
from icmj.simulation.ending import MOST_EVENTS, WINDOW, EventPace
from icmj.study.estimate import LONGEST, estimate, refuse_long, refuse_trials
from icmj.study.experiment import conditions_of


def case(root: Path, duration: float = 20.0, *more: str) -> Case:
    text = SHORT.format(name="short", model=root / "models" / "pendulum.xml", duration=duration, more="")
    text = text.replace("duration =", "\n".join((*more, "duration =")))
    return prepare(parse_run(text.replace("growth_points = 2", "growth_points = 0")))


@pytest.fixture(scope="module", autouse=True)
def compiled(root: Path) -> None:
    """What the runs here need is compiled before, so that the time of none depends on what a cache holds."""
    acting = {"kind": "noise", "size": 1e-3, "seed": 1, "bandwidth": 5.0}
    for name, place, delay in (("simple-0.8", "torque", 0.0), ("simple-0.8", "torque", 0.1),
                               ("rivals/one-link-delayed-pd", "ankle_torque", 0.2)):  # fmt: skip
        changes = {
            "assumed.delay": delay,
            "simulation.duration": 1.0,
            "simulation.disturbance": [acting | {"input": place}],
        }
        found = prepare(load_run(root / "runs" / f"{name}.toml").with_(**changes))
        for plant in ("linear", "mujoco"):
            simulate(found, plant)


def test_the_shipped_cases_and_experiments_are_quick(root: Path) -> None:
    for path in sorted((root / "runs").glob("*.toml")):
        found = prepare(load_run(path))
        assert max(estimate(found, plant, study=True) for plant in ("linear", "mujoco")) < LONGEST
    for path in sorted((root / "experiments").glob("*.toml")):
        refuse_trials(path, planned(path), 1, LONGEST)


@pytest.mark.slow
@pytest.mark.parametrize(("more", "duration", "plant"), [
    (("timestep = 1e-9",), 20.0, "mujoco"),
    (("record_interval = 1e4",), 1e9, "mujoco"),
    (("record_interval = 1e4",), 1e9, "linear"),
])  # fmt: skip
def test_hours_are_told_and_refused(root: Path, more: tuple[str, ...], duration: float, plant: str) -> None:
    """Half a day or longer: a processor ten times as fast tells the same."""
    found = case(root, duration, *more)
    seconds = estimate(found, plant)  # type: ignore[arg-type]
    assert seconds > 10 * LONGEST
    with pytest.raises(StudyError, match=r"would take about .*; shorten it .* or start it with --yes"):
        refuse_long(found, plant, seconds, LONGEST)  # type: ignore[arg-type]
    refuse_long(found, plant, seconds, None)  # type: ignore[arg-type]


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_the_steps_that_a_stiff_loop_takes_are_counted(root: Path, plant: str) -> None:
    """Of five seconds, each of which takes a day: they were 0 s of work, as they are without the muscles' haste."""
    seconds = {}
    for lag in (1e-2, 1e-12):
        run = load_run(root / "runs" / "rivals" / "one-link-delayed-pd.toml")
        muscles = {"actual.activation": {"order": 1, "time_constant": lag}, "simulation.duration": 5.0}
        trial, begin = prepare(run.with_(**muscles)), time.process_time()
        seconds[lag] = estimate(trial, plant)  # type: ignore[arg-type]
        assert time.process_time() - begin < 20
    assert seconds[1e-2] < LONGEST
    assert seconds[1e-12] > 1e4 * LONGEST
    with pytest.raises(StudyError, match=r"would take about .*; shorten it .* or start it with --yes"):
        refuse_long(trial, plant, seconds[1e-12], LONGEST)  # type: ignore[arg-type]


STANDING = """
[experiment]
name = "standing"
repetitions = {count}
[quiet_standing]
duration = {duration}
settle = 1.0
rate = {rate}
[[case]]
run = "quiet-standing"
"""


@pytest.mark.parametrize(("count", "duration", "rate", "words"), [
    (100_000, 3.0, 10.0, r"200000 trials, of up to 40 rows, would take about [0-9.]+ (min|hours|days);"),
    (5, 18.0, 1e5, r"10 trials, of up to 1.9e\+06 rows, would take about (.* and )?[0-9.]+ GB of memory"),
    (20_000, 60.0, 100.0, r"40000 trials, .* and 1[5-9] GB of memory;"),
])  # fmt: skip
def test_trials_that_take_hours_or_memory_are_refused(tmp_path, shell, count, duration, rate, words) -> None:
    """All of them began at once."""
    file = tmp_path / "standing.toml"
    file.write_text(STANDING.format(count=count, duration=duration, rate=rate))
    (line,) = told(shell.refuses(["experiment", str(file), "--out", str(tmp_path / "out"), "--jobs", "1"]))
    assert re.search(words, line)
    assert "or start it with --yes" in line
    assert not (tmp_path / "out").exists()


def test_stored_trials_take_no_more_time_and_yes_starts_any(tmp_path, monkeypatch, shell):
    file, out = tmp_path / "standing.toml", tmp_path / "out"
    file.write_text(STANDING.format(count=2, duration=3.0, rate=50.0))
    command = ["experiment", str(file), "--out", str(out), "--jobs", "1"]
    monkeypatch.setattr("icmj.study.estimate.LONGEST", 0.0)
    assert "4 trials, of up to 200 rows, would take about" in shell.refuses(command)
    assert main([*command, "--yes"]) == 0
    assert main(command) == 0


def planned(path: Path) -> list[tuple[Case, PlantKind, int]]:
    """All trials of an experiment file."""
    file = load_experiment(path)
    kind, count = file.settings, file.experiment.repetitions
    return [(prepare(kind.stimulate(one.run, 1)), one.plant, count) for one in conditions_of(file)]


def test_rows_that_take_too_much_memory_are_told(root: Path) -> None:
    """Of a million rows of the three-link person a log took 2.3 GB to write."""
    found = case(root, 1.0, "record_interval = 5e-7")
    words = r"would take about 2.1 GB of memory \(2e\+06 rows\); raise simulation.record_interval"
    with pytest.raises(StudyError, match=words):
        refuse_long(found, "linear", 1.0, LONGEST, study=True)
    refuse_long(found, "linear", 1.0, None, study=True)
    refuse_long(found, "linear", 1.0, LONGEST)  # without the same rows under continuous control
    refuse_long(case(root, 1.0, "record_interval = 1e-6"), "linear", 1.0, LONGEST, study=True)


NOISE = '{ kind = "noise", input = "torque", size = 0.1, seed = 1, terms = 2000, bandwidth = %s }'


def test_what_acts_counts_too(root: Path) -> None:
    """A run of a millisecond was at 10 % after 99 s."""
    found = case(root, 0.001, f"disturbance = [{NOISE % '1e12'}]")
    with pytest.raises(StudyError, match="would take about"):
        refuse_long(found, "linear", estimate(found, "linear"), LONGEST)


def test_what_begins_to_act_in_a_probe_is_not_waited_for(root: Path) -> None:
    """A probe came to 0.6 s, from where on there was noise of 10¹¹ Hz, and did not end."""
    noise = (NOISE % "1e11").replace("}", ", start = 0.6 }")
    found, begin = case(root, 5.0, f"disturbance = [{noise}]"), time.process_time()
    assert estimate(found, "linear") > 1e3 * LONGEST
    assert time.process_time() - begin < 20


def test_a_run_that_falls_says_nothing_of_those_by_the_clock(root: Path) -> None:
    """The run was over at once, and growth, which begins near rest, took for ever without having been asked for."""
    text = SHORT.format(name="short", model=root / "models" / "pendulum.xml", duration=2.0, more="")
    found = prepare(parse_run(text.replace("hinge = 0.02", "hinge = 1e6") + f"[[simulation.disturbance]]\n{FAST}"))
    assert estimate(found, "linear", study=True) > 10 * LONGEST
    assert estimate(found, "linear") < LONGEST


FAST = 'kind = "noise"\ninput = "torque"\nsize = 0.1\nseed = 1\nbandwidth = 1e10\n'


def test_a_delay_longer_than_a_probe_is_no_reason_to_know_nothing(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Probes begin with a length at which a delayed run cannot start; the estimate was 0."""
    monkeypatch.setattr("icmj.study.estimate.SERIES", 0.0)
    more = "record_interval = 0.5", 'disturbance = [{ kind = "step", input = "torque", size = 0.01 }]'
    found = case(root, 20.0, *more)
    delayed = prepare(found.run.with_(**{"assumed.delay": 0.3}))
    assert estimate(delayed, "linear") > 0.1 * estimate(found, "linear")


def test_the_estimate_is_about_right(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("icmj.study.estimate.STEPS", 1e4)
    found = case(root, 300.0, "timestep = 1e-3", "record_interval = 1")
    simulate(found, "mujoco", duration=1.0)  # compiled
    begin = time.process_time()
    simulate(found, "mujoco")
    took = time.process_time() - begin
    assert 0.2 * took < estimate(found, "mujoco") < 5 * took


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_events_without_end_end_the_run(root: Path, plant: str) -> None:
    text = SHORT.format(name="zeno", model=root / "models" / "pendulum.xml", duration=40, more="")
    text = text.replace("q_t = 0.01", "q_t = 1e-14").replace("delta_min = 0.01", "delta_min = 0")
    simulation = simulate(prepare(parse_run(text)), plant)  # type: ignore[arg-type]
    assert simulation.outcome.kind == "stalled"
    assert "5000 events in the last" in simulation.outcome.message
    assert WINDOW <= len(simulation.events) <= 2 * WINDOW
    assert (np.diff(simulation.events.t) > 0).all()


def test_pace_is_of_the_last_window() -> None:
    pace = EventPace(10.0)
    slow = 2 * 10.0 / MOST_EVENTS
    assert pace.stalled(*(slow * np.arange(3 * WINDOW))) is None
    fast = slow * 3 * WINDOW + slow / 100 * np.arange(WINDOW)
    assert pace.stalled(*fast) == pytest.approx(slow / 100 * (WINDOW - 1))


@pytest.mark.slow
def test_the_command_line_asks_for_yes(root, tmp_path, monkeypatch, shell):
    monkeypatch.chdir(tmp_path)
    text = SHORT.format(name="slow", model=root / "models" / "pendulum.xml", duration=40, more="")
    (tmp_path / "slow.toml").write_text(text.replace("duration =", "timestep = 1e-9\nduration ="))
    for command in ("run", "study"):
        (line,) = told(shell.refuses([command, "slow.toml", "--out", "out"]))
        assert "slow (mujoco) would take about" in line
        assert "(4e+10 steps of 1e-09 s)" in line
        assert "--yes" in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("duration", "more", "words"), [
    (0.001, "delay = 0.1", "case.toml: the delay of 0.1 s is not shorter than the run of 0.001 s"),
    (1e-15, "", "case.toml: simulation.duration: must be at least 1e-06, got 1e-15"),
])  # fmt: skip
@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_a_run_that_cannot_start_is_refused_before_anything_is_written(
    root, tmp_path, shell, duration, more, words, plant
) -> None:
    text = SHORT.format(name="short", model=root / "models" / "pendulum.xml", duration=duration, more="")
    (tmp_path / "case.toml").write_text(text.replace("[actual]", f"[actual]\n{more}"), encoding="utf-8")
    command = ["run", str(tmp_path / "case.toml"), "--plant", plant, "--out", str(tmp_path / "out")]
    assert words in shell.refuses(command)
    assert not (tmp_path / "out").exists()
