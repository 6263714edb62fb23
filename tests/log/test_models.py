"""A log carries the models that its analysis needs: copied elsewhere, it is identified as where it was made."""

import json
import shutil

import numpy as np
import pytest

import icmj
from icmj.errors import RunFileError
from icmj.log import archive
from icmj.log.reader import read_log
from icmj.runfile.schema import BundledFiles

RUN = """
case = { name = "rod", title = "A rod" }
assumed = { model = "MODEL", keyframe = "upright" }
actual = { gain = 0.9 }
design = { R_c = 0.01, R_o = 0.01 }
controller = { q_t = 0.001 }
simulation = { duration = 12.0, initial = { ankle = 0.002 } }
study = { growth_points = 0 }
"""
MODEL = """<mujoco><include file="parts/inertia.xml"/>
<option integrator="RK4"/>
<actuator><motor name="torque" joint="ankle"/></actuator>
<keyframe><key name="upright" qpos="0"/></keyframe></mujoco>"""
PART = """<mujoco><worldbody><body><joint name="ankle" axis="0 1 0"/>
<inertial pos="0 0 0.9" mass="70" diaginertia="6 6 1"/></body></worldbody></mujoco>"""


@pytest.fixture(scope="module", params=["relative", "absolute"])
def copied(request, tmp_path_factory):
    """A log whose folder is gone, in a folder of its own."""
    home = tmp_path_factory.mktemp("home")
    (home / "models" / "parts").mkdir(parents=True)
    (home / "runs").mkdir()
    (home / "models" / "rod.xml").write_text(MODEL)
    (home / "models" / "parts" / "inertia.xml").write_text(PART)
    model = "../models/rod.xml" if request.param == "relative" else str(home / "models" / "rod.xml")
    (home / "runs" / "rod.toml").write_text(RUN.replace("MODEL", model))
    result = icmj.run_case(icmj.load_run(home / "runs" / "rod.toml"), "linear")
    path = tmp_path_factory.mktemp("elsewhere") / "rod.linear.rrd"
    icmj.write_log(result, path)
    shutil.rmtree(home)
    return path, result


@pytest.mark.parametrize("copied", ["absolute"], indirect=True)
def test_a_log_copied_elsewhere_is_identified(copied, shell):
    (told,) = shell.answers(["identify", str(copied[0]), "--low", "0.8", "--high", "1.0", "--json"])
    assert told["value"] == pytest.approx(0.9, abs=1e-6)


def test_a_log_copied_elsewhere_makes_the_same_case(copied):
    path, result = copied
    again = read_log(path)
    assert again.run.text == result.run.text
    with again.run.at_hand() as run:
        assert icmj.prepare(run).prediction.delta_crit == pytest.approx(result.prediction.delta_crit, rel=1e-12)
        assert run.assumed_path.is_file()
        place = run.assumed_path
    assert not place.exists()


def test_a_log_that_is_written_again_elsewhere_keeps_them(copied, tmp_path):
    icmj.write_log(read_log(copied[0]), tmp_path / "again.rrd")
    files = read_log(tmp_path / "again.rrd").run.kept.files
    assert {name.rpartition("/")[2]: text.decode() for name, text in files.items()} == {
        "rod.xml": MODEL,
        "inertia.xml": PART,
    }


def test_a_log_without_models_is_read_as_before(copied):
    tree, arrays = archive.pack(read_log(copied[0]))
    old = json.loads(tree)
    assert old["run"].pop("files")
    old["run"].pop("kept")
    result = archive.unpack(json.dumps(old), arrays)
    assert not result.run.kept.files
    with result.run.at_hand() as run:
        assert run is result.run


def test_more_than_a_log_should_carry_is_left_out(root, monkeypatch):
    run = icmj.load_run(root / "runs" / "three-link-0.9.toml")
    assert list(archive.keep_files(run).files) == ["models/three_link.xml"]
    monkeypatch.setattr(archive, "MOST_BYTES", 100)
    assert not archive.keep_files(run).files


@pytest.mark.parametrize("name", ["../a.xml", "/a.xml", "a/../../b", "", "c:\\a.xml", "a\\b", "."])
def test_no_file_of_a_log_is_written_out_of_its_folder(tmp_path, name):
    with pytest.raises(RunFileError, match="leads out of a folder"):
        BundledFiles(files={name: b"x"}).write(tmp_path / "in")
    assert not list(tmp_path.rglob("*.xml"))
    with pytest.raises(RunFileError, match="leads out of a folder"):
        BundledFiles(place=name).write(tmp_path / "in")


def test_changes_keep_the_models(copied):
    run = read_log(copied[0]).run
    assert run.with_(**{"actual.gain": 0.8}).kept is run.kept
    assert np.frombuffer(b"".join(run.kept.files.values()), np.uint8).size == len(MODEL) + len(PART)
