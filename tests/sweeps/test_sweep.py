"""A sweep's rows are the same bit for bit, whoever computes them, however often it is killed; what fails is a row."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from patience import PATIENCE
from sweep_cases import GRID, THRESHOLDS, computed, contents, sweep_file

import icmj
from icmj.case.sweep_table import SweepTable
from icmj.errors import SweepError
from icmj.report.map_grid import label
from icmj.runfile.sweep_tables import load_sweep
from icmj.study.chunk import ChunkResult, compute
from icmj.study.plan import Plan
from icmj.study.sweep import carry_out, make_plan, try_plan
from icmj.study.sweep_folder import read_table, resume_sweep

KILLS = 3


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("swept")
    file = sweep_file(folder, GRID.format(count=5) + THRESHOLDS, ask='motion = ["linear", "mujoco"]', chunk=3)
    carry_out(make_plan(file), folder / "two", jobs=2)
    return folder


@pytest.mark.slow
def test_one_process_gives_the_bytes_that_two_give(swept: Path) -> None:
    assert computed(make_plan(swept / "sweep.toml")) == contents(swept / "two")


def test_a_folder_of_before_every_orbit_had_its_columns_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = make_plan(sweep_file(tmp_path, GRID.format(count=2), ask=""))
    with monkeypatch.context() as patched:
        patched.setattr("icmj.study.chunk.ORBITS", {})
        patched.setattr("icmj.study.chunk.GAPS", {})
        with resume_sweep(tmp_path / "old", plan) as (dataset, _):
            dataset.write(0, compute(plan, plan.range(0)))
    names = read_table(tmp_path / "old").column_names
    assert "predicted_verdict" in names
    assert not [name for name in names if name.startswith(("predicted_orbit", "predicted_unresolved"))]


def test_rows_are_what_a_case_alone_gives(swept: Path) -> None:
    run = icmj.load_run(make_plan(swept / "sweep.toml").file.base.path)
    rows = read_table(swept / "two").to_pylist()
    for row in rows:
        case = icmj.prepare(run.with_(**{"actual.gain": row["b"], "controller.q_t": row["q_t"]}))
        assert row["status"] == "ok"
        assert row["predicted_delta_crit"] == case.prediction.delta_crit
        assert row["predicted_verdict"] == case.prediction.verdict
        orbits = case.prediction.orbits
        assert row["predicted_unresolved"] is False
        assert row["predicted_orbit_delta"] == [one.orbit.delta for one in orbits]
        assert row["predicted_orbit_eigenvalue"] == [one.orbit.sign for one in orbits]
        assert row["predicted_orbit_verdict"] == [one.verdict for one in orbits]
        assert row["predicted_orbit_multiplier"] == pytest.approx([one.multiplier for one in orbits], rel=1e-9)
        if case.prediction.cycle:
            assert row["predicted_peak_angle"] == pytest.approx(case.prediction.amplitude[0], rel=1e-12)
        if row["point"] % 4 == 0:
            motion = icmj.measure(icmj.simulate(case, "linear"), T_hat=case.system.T_hat)
            assert (row["linear_kind"], row["linear_interval"]) == (motion.kind, motion.interval)
    # the pendulum's departure falls with the square of the threshold (docs/simulation.md)
    error = {(row["b"], row["q_t"]): row["mujoco_error"] for row in rows if row["mujoco_error"] is not None}
    ratios = [error[b, 0.01] / error[b, 0.001] for b, q_t in error if q_t == 0.01]
    assert ratios == pytest.approx([100.0] * 4, rel=0.1)  # the next order adds 6 % where the first is small


def test_other_readers_open_the_dataset(swept: Path) -> None:
    import pyarrow.dataset as ds

    found = ds.dataset(swept / "two" / "points")
    assert found.count_rows() == 10
    some = found.to_table(columns=["b"], filter=ds.field("q_t") < 0.005)["b"].to_pylist()
    assert some == pytest.approx(list(np.linspace(0.7, 1.3, 5)))
    metadata = found.schema.metadata
    assert metadata[b"icmj.sweep"].decode() == (swept / "sweep.toml").read_text()
    assert b"mujoco" in metadata[b"icmj.versions"]
    assert metadata[b"icmj.run"].startswith(b"# The second-order system of the paper")


def test_a_point_that_fails_or_falls_is_a_row(tmp_path: Path) -> None:
    # a model without gain cannot be balanced by anyone
    vary = '[[vary]]\nfield = "actual.gain"\nvalues = [0.8, 0.0]'
    file = sweep_file(tmp_path, vary, ask='motion = ["mujoco"]')
    table = icmj.sweep(file, jobs=1)
    assert table["status"].to_pylist() == ["ok", "ok"]
    assert table["mujoco_outcome"].to_pylist() == ["completed", "fell"]
    vary = '[[vary]]\nfield = "controller.Q_t"\nvalues = ["output", [0.0, 0.0]]'
    plan = make_plan(sweep_file(tmp_path, vary, name="bad.toml"))
    rows = pq.read_table(pa.BufferReader(compute(plan, range(2)).content)).to_pylist()
    assert [row["status"] for row in rows] == ["ok", "failed"]
    assert "Q_t is zero" in rows[1]["words"]
    assert [row["Q_t"] for row in rows] == ["output", "[0.0, 0.0]"]


class _Crew:
    """Processes of which some die: on whole chunks always, on the points in ``deadly`` every time."""

    def __init__(self, deadly: set[int], mortal: set[int]) -> None:
        self.deadly, self.mortal = deadly, mortal

    def compute(self, plan, ranges):
        for points in ranges:
            if self.deadly & set(points) or self.mortal & set(points) or (-1 in self.deadly and not points):
                self.mortal -= set(points)
                yield points, None, "signal 9"
            else:
                yield points, compute(plan, points), ""


@pytest.mark.slow
def test_a_point_that_takes_its_process_with_it_is_a_row_and_its_neighbours_are_as_ever(tmp_path, monkeypatch):
    from contextlib import nullcontext

    from icmj.study import sweep

    plan = make_plan(sweep_file(tmp_path, GRID.format(count=20)))
    carry_out(plan, tmp_path / "sound", jobs=1)
    monkeypatch.setattr(sweep, "_crew", lambda *_: nullcontext(_Crew({9}, {3, 15})))
    carry_out(plan, tmp_path / "deadly")
    sound, found = read_table(tmp_path / "sound").to_pylist(), read_table(tmp_path / "deadly").to_pylist()
    assert found[9]["status"] == "died"
    assert "signal 9" in found[9]["words"]
    assert [row for row in found if row["point"] != 9] == [row for row in sound if row["point"] != 9]
    monkeypatch.setattr(sweep, "_crew", lambda *_: nullcontext(_Crew(set(range(-1, 20)), set())))
    with pytest.raises(SweepError, match=r"processes die even without a point to compute .*signal 9"):
        carry_out(plan, tmp_path / "none")


def test_two_sweeps_do_not_share_a_folder(tmp_path: Path) -> None:
    one = make_plan(sweep_file(tmp_path, GRID.format(count=4)))
    two = make_plan(sweep_file(tmp_path, GRID.format(count=5), name="two.toml"))
    with resume_sweep(tmp_path / "out", one) as (dataset, _):
        with pytest.raises(SweepError, match=rf"another sweep \(process {os.getpid()}\) is writing there"):
            carry_out(one, tmp_path / "out", jobs=1)
        dataset.write(0, compute(one, range(2)))
    with pytest.raises(SweepError, match="holds another sweep"):
        carry_out(two, tmp_path / "out", jobs=1)
    assert len(contents(tmp_path / "out")) == 1
    # a folder that is not the sweep's, and one that cannot be written to
    (tmp_path / "file").write_text("")
    with pytest.raises(SweepError, match="cannot be written to"):
        carry_out(one, tmp_path / "file", jobs=1)


def test_a_disk_that_is_full_leaves_what_is_finished(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = make_plan(sweep_file(tmp_path, GRID.format(count=4), chunk=1))

    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    with resume_sweep(tmp_path / "out", plan) as (dataset, _):
        dataset.write(0, ChunkResult(b"whole", 1, 0, 0.0, 0.0))
        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(SweepError, match=r"No space left on device\); what is finished is kept"):
            dataset.write(1, ChunkResult(b"not", 1, 0, 0.0, 0.0))
    assert contents(tmp_path / "out") == {"00000000.parquet": b"whole"}


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="kills a process group")
def test_killed_again_and_again_the_rows_are_the_same(tmp_path: Path, pytestconfig: pytest.Config) -> None:
    file = sweep_file(tmp_path, GRID.format(count=64), chunk=1)
    plan = make_plan(file)
    whole = computed(plan)
    seed = pytestconfig.getoption("--seed") or random.randrange(10**6)
    dice, out = random.Random(seed), tmp_path / "out"
    print(f"seed {seed}")
    command = [sys.executable, "-m", "icmj.cli", "sweep", str(file), "--out", str(out), "--jobs"]

    def finished() -> int:
        return len(list((out / "points").glob("*.parquet"))) if out.exists() else 0

    done = [0]
    for kill in range(KILLS):
        process = subprocess.Popen([*command, "12"[kill % 2]], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        # every fourth at any moment, loading or trying; the others while rows are written
        deadline = time.monotonic() + (dice.uniform(0.1, 1.5) if kill % 4 == 0 else PATIENCE)
        while time.monotonic() < deadline and finished() == done[-1] and process.poll() is None:
            time.sleep(0.002)
        time.sleep(dice.uniform(0, 0.03))  # about as long as a chunk takes
        assert process.poll() is None, "it ended before it was killed: give it more points"
        process.send_signal(signal.SIGKILL)
        process.wait()
        done.append(finished())
    assert done == sorted(done)
    assert len(set(done)) > KILLS // 2
    subprocess.run([*command, "2"], check=True, capture_output=True)
    assert contents(out) == whole
    # what was finished before the last start was not computed again: the note of times has each chunk once
    noted = [line.partition(",")[0] for line in (out / "timing.csv").read_text().split()]
    assert len(noted) == len(set(noted))
    assert {path.name for path in out.iterdir()} == {"points", "sweep.json", "timing.csv", ".lock", "SHA256SUMS"}


def test_died_and_computed_have_the_same_columns(tmp_path: Path) -> None:
    from icmj.study.chunk import report_death

    plan = make_plan(sweep_file(tmp_path, GRID.format(count=2)))
    rows = pq.read_table(pa.BufferReader(compute(plan, range(2)).content))
    assert report_death(plan, 1, "signal 9").schema == rows.schema


@pytest.mark.parametrize(("name", "units"), [
    ("basins", {"angle": "rad", "rate": "rad/s"}),
    ("validity", {"q_t": "rad", "shank": "rad", "thigh": "rad", "trunk": "rad"}),
])  # fmt: skip
def test_axes_of_maps_have_the_units_of_what_varies(name: str, units: dict[str, str]) -> None:
    """Axes were called angle and rate, without a unit."""
    plan = try_plan(Plan.of(load_sweep(name)))
    assert plan.units == units
    swept = SweepTable(name, name, (), 0, pa.table({}), plan.units)
    assert next(label(each, swept) for each in units) in ("angle (rad)", "$q_{t}$ (rad)")
    assert label("b", swept) == "$b$"
