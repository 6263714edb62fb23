"""The whole study, once, in its own folder: logs, report and summary, and what they say of every case."""

import json
import re
import shutil

import numpy as np
import pytest
from kernel_cases import computed, kernels

from icmj import build_report, compare, load_run, parse_run, prepare, read_log, simulate, write_log
from icmj.controller.controller import continuous_limit
from icmj.errors import ModelError, RunFileError
from icmj.study.run_files import find_runs
from icmj.study.study import run_case, run_study

DELAYED = ("three-link-0.9-delay", "three-link-1.1-delay")
PREDICTED, MEASURED = ("delta_crit", "period", "gamma", "amplitude"), ("interval", "period", "amplitude", "gamma")
CYCLES = ("simple-0.8", "simple-1.2", "three-link-0.9", "three-link-1.1", "neglected-0.1", "neglected-0.5", *DELAYED)


@pytest.fixture(scope="module")
def folder(root, tmp_path_factory, pytestconfig):
    """The gate's own study, by the README's command, where there is one."""
    if (made := pytestconfig.getoption("--study")) is not None:
        return made
    return run_study(find_runs([root / "runs"]), tmp_path_factory.mktemp("study")).report.parent


@pytest.fixture(scope="module")
def summary(folder):
    records = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    return {(r["case"], r["plant"]): r for r in records}


@pytest.mark.slow
def test_every_case_is_there_on_both_plants_and_nothing_half_made(folder, summary):
    assert len(summary) == 22
    logs = {f"{case}.{plant}.rrd" for case, plant in summary}
    assert {path.name for path in folder.iterdir()} == logs | {"report.html", "report_figures", "summary.json"}
    assert sum((folder / log).stat().st_size for log in logs) / len(logs) < 100e6 / 16


@pytest.mark.slow
def test_summary_is_the_contract(summary):
    for record in summary.values():
        assert {"interval", "period", "amplitude", "converged"} <= record["measured"].keys()
        assert {"period", "amplitude"} <= record["relative_error"].keys()
        assert {"delta_crit", "eigenvalue", "cycle", "period", "gamma", "amplitude"} <= record["predicted"].keys()


# the records of its summary.json, without what is no part of them: logs, growth, attractors, amplitude law and report
RECORDS = """
import json
from pathlib import Path
from icmj.case.comparison import compare, to_json
from icmj.study.run_files import find_runs
from icmj.study.study import PLANTS, run_case
runs = find_runs([Path(name) for name in {names!r}])
print(json.dumps([to_json(compare(run_case(run, plant))) for run in runs for plant in PLANTS]))
"""


@pytest.mark.slow
def test_the_summary_agrees_on_another_processor(summary):
    """To nine digits where the motion settled; what did not, or is driven by noise, is equal in law and left out."""
    names = sorted({name for name, _ in summary} - {"quiet-standing"})
    other = {(r["case"], r["plant"]): r for r in json.loads(computed(RECORDS.format(names=names), kernels()[0]))}
    assert other.keys() == {key for key in summary if key[0] in names}
    compared = [key for key, record in summary.items() if key in other and record["measured"]["converged"]]
    assert {*compared} >= {(name, plant) for name in CYCLES for plant in ("linear", "mujoco")}
    for key in compared:
        for part, quantities in (("predicted", PREDICTED), ("measured", MEASURED)):
            here, there = summary[key][part], other[key][part]
            assert [here[name] is None for name in quantities] == [there[name] is None for name in quantities]
            for name in (name for name in quantities if here[name] is not None):
                np.testing.assert_allclose(there[name], here[name], rtol=1e-9, err_msg=f"{key} {part} {name}")
        assert other[key]["predicted"]["verdict"] == summary[key]["predicted"]["verdict"]
        assert other[key]["measured"]["kind"] == summary[key]["measured"]["kind"]


@pytest.mark.slow
@pytest.mark.parametrize("name", CYCLES)
def test_linear_plant_agrees_to_1e_9(summary, name):
    record = summary[name, "linear"]
    assert record["measured"]["converged"] is True
    for key in ("interval", "period", "gamma"):
        assert abs(record["relative_error"][key]) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", CYCLES)
def test_mujoco_agrees_to_1e_3_at_the_shipped_threshold(summary, name):
    record = summary[name, "mujoco"]
    assert record["measured"]["converged"] is True
    assert abs(record["relative_error"]["interval"]) < 1e-3


@pytest.mark.slow
def test_three_link_in_mujoco_agrees_to_1e_6_at_the_smallest_threshold(folder):
    for name in ("three-link-0.9", "three-link-1.1"):
        law = read_log(folder / f"{name}.mujoco.rrd").law
        assert law.q_t[-1] == 1e-4
        assert law.interval_error[-1] < 1e-6


@pytest.mark.slow
def test_the_delayed_loop_errs_with_the_square_of_the_threshold(folder):
    for name in DELAYED:
        assert read_log(folder / f"{name}.mujoco.rrd").law.interval_slope == pytest.approx(2.0, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_quiet_standing_sways_as_people_do_and_is_told_by_statistics(summary, folder, plant):
    record = summary["quiet-standing", plant]
    assert record["measured"]["kind"] == "noisy"
    assert record["words"].startswith("The motion is driven by noise")
    assert "mean interval" in record["words"]
    result = read_log(folder / f"quiet-standing.{plant}.rrd")
    told, late = result.statistics, result.simulation.t > 6
    assert told.least == 0.12
    assert 0.2 < told.binding.value < 0.8
    assert 0.13 < told.interval.value < 0.25
    # centre of pressure in front of the ankle: torque over weight; people: RMS 4.7 ± 1.6 mm (Santos and Duarte 2016)
    pressure = result.simulation.x[late, 6] / (77.68 * 9.81)  # the ankle's activation
    assert 2.3e-3 < pressure.std() < 6.7e-3
    # that of the ground's force, which knows inertia and damping, too
    assert result.sway["cop.x.rms"] == pytest.approx(pressure.std(), rel=0.2)
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert f">{1e3 * result.sway['cop.x.rms']:.2f}<" in page
    assert ">4.74 ± 1.6<" in page.replace("\N{NO-BREAK SPACE}", " ")


@pytest.mark.slow
@pytest.mark.parametrize("plant", ["linear", "mujoco"])
@pytest.mark.parametrize(("name", "words"), [("simple-1.7", "repelling"), ("simple-exact", "No cycle predicted")])
def test_cases_without_the_predicted_cycle_are_reported_so_in_words(summary, name, words, plant):
    record = summary[name, plant]
    assert record["measured"]["converged"] is False
    assert record["predicted"]["cycle"] is False
    assert words in record["words"]


@pytest.mark.slow
def test_summary_comes_from_the_logs(folder, summary):
    again = compare(read_log(folder / "simple-0.8.linear.rrd"))
    record = summary["simple-0.8", "linear"]
    assert record["measured"]["interval"] == again.measured.interval
    assert record["words"] == again.words


@pytest.mark.slow
def test_progress_rises_to_its_end(root, tmp_path):
    without = ["simulation.duration=4", "study.growth_points=0", "study.attractor_starts=0", "study.law_q_t=[]"]
    told = []
    runs = find_runs([root / "runs" / "simple-0.8.toml"], without)
    outputs = run_study(runs, tmp_path / "out", jobs=1, progress=lambda label, done: told.append(done))
    assert told == sorted(told)
    assert told[-1] == 1.0
    assert [log.name for log in outputs.logs] == [f"simple-0.8.{plant}.rrd" for plant in ("linear", "mujoco")]
    assert all(path.exists() for path in (*outputs.logs, outputs.report, outputs.summary))


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
@pytest.mark.parametrize("timestep", [None, 0.003])
def test_continuous_control_is_kept_at_the_multiples_alone(root, plant, timestep):
    """With a delay it is a clock of 5 ms, whose rows and states were half of a log."""
    without = {"study.growth_points": 0, "study.attractor_starts": 0, "study.law_q_t": [], "simulation.duration": 1.5}
    run = load_run(root / "runs" / "three-link-0.9-delay.toml").with_(**without, **{"simulation.timestep": timestep})
    kept, case = run_case(run, plant, study=True).continuous, prepare(run)
    ticks = continuous_limit(case.controller)
    whole = simulate(case, plant, trigger=ticks)
    assert len(whole.events) == 300
    assert len(kept.events) == 0
    behind = kept.t - 0.008 * np.arange(len(kept.t))
    assert len(kept.t) == 189  # and the end
    assert behind[:-1].min() > -1e-9
    assert behind[:-1].max() < (1e-9 if timestep is None or plant == "linear" else timestep)
    assert kept.t[-1] == whole.t[-1]
    rows = np.searchsorted(whole.t, kept.t)
    for name in ("t", "x", "y", "u", "x_o", "x_h", "E", "qpos", "applied"):
        there = getattr(whole, name)
        np.testing.assert_array_equal(getattr(kept, name), there[rows] if len(there) else there)


def test_two_runs_of_one_name_are_refused(root, tmp_path):
    for name in ("a.toml", "b.toml"):
        shutil.copy(root / "runs" / "simple-0.8.toml", tmp_path / name)
    with pytest.raises(RunFileError, match="is taken by"):
        find_runs([tmp_path])


def test_bad_case_stops_the_study_before_anything_is_written(root, tmp_path):
    shutil.copy(root / "runs" / "simple-0.8.toml", tmp_path)  # its models are not beside it here
    with pytest.raises(ModelError, match="no such model file"):
        run_study(find_runs([tmp_path]), tmp_path / "out", jobs=1)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_an_interrupted_run_keeps_what_was_simulated(root, plant):
    path = root / "runs" / "simple-0.8.toml"
    text = path.read_text(encoding="utf-8").replace("duration = 40.0", "duration = 100000.0")
    text = text.replace("record_interval = 0.01", "record_interval = 0.5")
    calls = []

    def interrupt(done):
        calls.append(done)
        if len(calls) == 4:
            raise KeyboardInterrupt

    result = run_case(parse_run(text, path), plant, interrupt, study=True)
    outcome = result.simulation.outcome
    assert outcome.kind == "interrupted"
    assert 0 < outcome.t < 100000
    assert result.simulation.t[-1] <= outcome.t
    assert result.growth is None
    assert result.continuous is not None
    assert f"was interrupted at {outcome.t:.6g} s" in outcome.message


ADDED = ("continuous", "growth", "law", "attractors")
BRIEF = {"simulation.duration": 12.0, "study.law_q_t": [1e-2, 1e-3]}
BRIEF |= {"study.growth_points": 2, "study.attractor_starts": 2}


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_a_run_is_the_run_and_the_study_adds_to_it(root, tmp_path, plant):
    """The same bits with and without; what only one of them has is not missed by log, report or summary."""
    run = load_run(root / "runs" / "simple-0.8.toml").with_(**BRIEF)
    alone, whole = (run_case(run, plant, study=study) for study in (False, True))
    here = ("continuous", "growth", "attractors" if plant == "linear" else "law")
    assert [name for name in ADDED if getattr(alone, name)] == []
    assert [name for name in ADDED if getattr(whole, name)] == [name for name in ADDED if name in here]
    for name in ("t", "x", "y", "u", "x_h"):
        np.testing.assert_array_equal(getattr(alone.simulation, name), getattr(whole.simulation, name))
    assert compare(alone).words == compare(whole).words
    pages = {}
    for name, result in (("alone", alone), ("whole", whole)):
        write_log(result, tmp_path / f"{name}.rrd")
        back = read_log(tmp_path / f"{name}.rrd")
        assert [each for each in ADDED if getattr(back, each)] == [each for each in ADDED if getattr(result, each)]
        build_report([back], tmp_path / name / "report.html")
        pages[name] = (tmp_path / name / "report.html").read_text(encoding="utf-8")
    more = 'id="attractors"' if plant == "linear" else 'id="law"'
    for words in (more, "under continuous control", "growth measured in clock-driven simulations"):
        assert words in pages["whole"], words
        assert words not in pages["alone"], words
    for words in ('id="figures"', "Outputs? under intermittent control on each plant; dotted: events"):
        assert re.search(words, pages["alone"]), words


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_a_run_that_fell_is_logged_and_said_so(root, tmp_path, plant):
    path = root / "runs" / "simple-0.8.toml"
    text = path.read_text(encoding="utf-8").replace("limit = 1.0", "limit = 0.021")
    text = text.replace("{ hinge = 0.02 }", "{ hinge = 0.02, hinge_rate = 0.1 }")
    result = run_case(parse_run(text.replace("growth_points = 9", "growth_points = 0"), path), plant)
    write_log(result, tmp_path / "fell.rrd")
    back = read_log(tmp_path / "fell.rrd")
    assert back.simulation.outcome.kind == "fell"
    assert "hinge departed further than its limit of 0.021" in back.simulation.outcome.message
    assert "the run fell" in compare(back).words
