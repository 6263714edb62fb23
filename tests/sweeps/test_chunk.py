"""What is asked for at a point is what its own functions give: exact cycles, attractors, statistics under noise."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from sweep_cases import sweep_file

import icmj
from icmj.study.chunk import compute
from icmj.study.sweep import make_plan

B = '[[vary]]\nfield = "actual.gain"\nvalues = {}\n'


def rows(file: Path) -> list[dict]:
    plan = make_plan(file)
    return pq.read_table(pa.BufferReader(compute(plan, range(len(plan))).content)).to_pylist()


def test_an_exact_cycle_is_found_where_it_repels_and_said_to_be_none_where_there_is_none(tmp_path: Path) -> None:
    found = rows(sweep_file(tmp_path, B.format([0.8, 1.0, 1.7]), ask='cycle = ["linear"]'))
    assert [row["linear_cycle_found"] for row in found] == [True, False, True]
    assert [row["linear_cycle_attracting"] for row in found] == [True, None, False]
    assert abs(found[0]["linear_cycle_error"]) < 1e-9
    # the linear plant's own cycle has the multiplier that theory gives the predicted orbit
    for row in (found[0], found[2]):
        assert row["linear_cycle_multiplier"] == pytest.approx(row["predicted_multiplier"], rel=1e-5)
    assert found[1]["linear_cycle_words"]


def test_attractors_are_those_of_the_search(tmp_path: Path) -> None:
    (row,) = rows(sweep_file(tmp_path, B.format([0.8]), ask="attractors = 3"))
    case = icmj.prepare(icmj.load_run("simple-0.8"))
    found = icmj.experiments.attractors(
        case.actual.linearisation.plant, case.controller, case.settings, starts=3, seed=case.run.study.seed
    )
    assert row["attractors"] == len(found)
    assert row["attractor_interval"] == [each.measurement.interval for each in found]
    assert row["attractor_share"] == [each.share for each in found]


def test_under_noise_there_are_statistics_which_the_seed_changes(tmp_path: Path) -> None:
    torque = "kind = 'noise'\ninput = 'hinge_torque'"
    noise = f"[[set.simulation.disturbance]]\n{torque}\nsize = 0.001\nbandwidth = 3\nseed = 1"
    vary = '[[vary]]\nfield = "simulation.disturbance[0].seed"\nvalues = [1, 2, 1]\n'
    case = icmj.load_run("simple-0.8")
    torque = icmj.prepare(case).actual.linearisation.plant.inputs[0]
    file = sweep_file(tmp_path, vary, ask=f'motion = ["linear"]\n{noise.replace("hinge_torque", torque)}')
    one, two, again = rows(file)
    assert one["linear_kind"] == "noisy"
    assert 0 < one["linear_interval_error"] < one["linear_interval"]
    assert one["linear_rms_angle"] > 0
    assert one["linear_interval"] != two["linear_interval"]
    assert {k: v for k, v in one.items() if k != "point"} == {k: v for k, v in again.items() if k != "point"}
