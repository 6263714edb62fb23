"""Files and results that a release wrote are read by every later version, and say what they said."""

import json
import lzma
import tempfile
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

import icmj
from icmj.log.branch import read_branch_log
from icmj.runfile.sweep_tables import load_sweep

ARCHIVE = Path(__file__).resolve().parent / "archive"
RELEASES = sorted(path for path in ARCHIVE.iterdir() if path.is_dir() and not path.name.startswith("__"))


def describe(release: Path) -> dict[str, Any]:
    """What stands in the folder of a release, as plain data: values that are read back are written with all digits."""
    said: dict[str, Any] = {"runs": {}, "logs": {}, "branches": {}}
    for name in ("three-link", "matrices"):
        run = icmj.load_run(release / f"{name}.toml")
        prediction = icmj.prepare(run).prediction
        said["runs"][name] = {
            "title": run.title,
            "duration": run.simulation.duration,
            "actual gain": run.actual.gain,
            "delta_crit": prediction.delta_crit,
        }
    with tempfile.TemporaryDirectory() as folder:
        for packed in sorted(release.rglob("*.rrd.xz")):
            path = Path(folder) / packed.stem
            path.write_bytes(lzma.decompress(packed.read_bytes()))
            if packed.parent.name == "branch":
                said["branches"][packed.stem] = describe_branch(read_branch_log(path))
                continue
            result = icmj.read_log(path)
            simulation = result.simulation
            said["logs"][packed.stem] = {
                "title": result.run.title,
                "changes": dict(result.run.changes),
                "delta_crit": result.prediction.delta_crit,
                "events": simulation.events.t.tolist(),
                "last": simulation.x[-1].tolist(),
                "outputs": list(result.actual.outputs),
                "measurement": result.measurement.words,
            }
    for path in sorted(release.glob("branch/*.parquet")):
        said["branches"][path.name] = describe_branch(icmj.read_branch(path))
    said["sweep"] = {
        "name": load_sweep(release / "sweep.toml").sweep.name,
        "points": icmj.read_sweep(release / "sweep").table.to_pylist(),
    }
    said["experiment"] = {
        "names": list(icmj.load_experiment(release / "experiment.toml").names),
        "results": pq.read_table(release / "experiment" / "results.parquet").to_pylist(),
        "trials": {
            path.name: [*series.names, len(series.t), *series.values[-1].tolist()]
            for path in sorted(release.glob("experiment/trials/*[0-9].parquet"))
            for series in [icmj.read_series(path)]
        },
    }
    return json.loads(json.dumps(said))


def describe_branch(branch: icmj.cycle.branch.Branch) -> dict[str, Any]:
    """The numbers of a branch of cycles."""
    return {"value": branch.value.tolist(), "interval": branch.interval.tolist(), "largest": branch.largest.tolist()}


@pytest.mark.parametrize("release", RELEASES, ids=lambda path: path.name)
def test_what_a_release_wrote_is_read(release: Path) -> None:
    expected = json.loads((release / "expected.json").read_text(encoding="utf-8"))
    found = describe(release)
    # computed anew from the run file, where all else is read
    for name, run in expected["runs"].items():
        assert found["runs"][name].pop("delta_crit") == pytest.approx(run.pop("delta_crit"), rel=1e-9)
    assert found == expected


def test_this_version_has_its_folder() -> None:
    assert (ARCHIVE / icmj.__version__ / "expected.json").is_file()


def test_a_log_that_knows_one_side_of_actions_and_edges_is_exported_as_before(tmp_path: Path) -> None:
    """Of 0.1.0: torque, hold, event function and push just before actions at 0.4527 and 0.6316 s, and before edges."""
    packed = ARCHIVE / "0.1.0" / "logs" / "three-link.mujoco.rrd.xz"
    (tmp_path / "run.rrd").write_bytes(lzma.decompress(packed.read_bytes()))
    result = icmj.read_log(tmp_path / "run.rrd")
    assert result.simulation.leads.size == 0
    series, rows = result.to_series(311.0), [140, 196, 248, 264]
    for name, expected in (
        ("u.ankle_torque", [-23.7037390895367, 1.7499926860865305, 21.71992395359356, 16.616520739352445]),
        ("x_h.ankle", [0.02022779401549793, 0.0115649117533637, -0.0030611311393242604, -0.0038633865646613276]),
        ("E", [0.00015016781577723153, 0.00016593438103406936, -6.91313248498208e-05, 0.00013748416389457386]),
        ("push.ankle_torque", [0.0, 0.0, 0.0, 20.0]),
    ):
        assert series[name][rows] == pytest.approx(expected, rel=1e-9), name
