"""What a result depends on: each file that a run file reaches changes the fingerprints, and nothing beside it does."""

import os
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

from icmj import load_experiment, load_run
from icmj.case.references import digests
from icmj.engine.model_files import list_files
from icmj.errors import ModelError, RunFileError
from icmj.fits.family import Family, Prior
from icmj.fits.family_file import load_family_file
from icmj.runfile.sweep_tables import load_sweep
from icmj.study.experiment import fingerprint
from icmj.study.plan import Plan

# folders are named in one file and used in another; a name has a letter that XML writes in another way
BODY = """<mujoco><compiler meshdir="meshes"/><include file="parts.xml"/><include file="colours.xml"/>
<worldbody><geom type="mesh" mesh="a"/></worldbody></mujoco>"""
PARTS = """<mujoco><asset><mesh name="a" file="a&amp;b.stl"/><hfield name="h" file="h.png"/><skin file='skin.skn'/>
<model name="other" file="other.xml"/><!-- <mesh file="unused.stl"/> --></asset></mujoco>"""
COLOURS = """<mujoco><compiler texturedir="pictures" strippath="true"/>
<asset><texture name="t" fileright="elsewhere/t.png"/></asset></mujoco>"""
RUN = """
[case]
name = "a"
title = "A"
[assumed]
matrices = "plant.json"
[actual]
model = "body.xml"
[design]
R_c = 0.1
R_o = 0.01
[controller]
rule = "own:Rule"
[simulation]
duration = 5.0
[[simulation.disturbance]]
kind = "file"
file = "push.csv"
column = "push"
input = "u"
"""
SETPOINT = '[[setpoint]]\nkind = "file"\nfile = "target.csv"\ncolumn = "r"\noutput = "y"\n'
SWEEP = """
[sweep]
name = "s"
run = "run.toml"
[[vary]]
field = "actual.model"
values = ["body.xml", "body2.xml"]
"""
EXPERIMENT = """
[experiment]
name = "e"
[quiet_standing]
duration = 30.0
[[case]]
run = "run.toml"
name = "one"
"""
FAMILY = """
[family]
name = "f"
run = "still.toml"
[pressure]
weight = 1.0
torque = { x = 1.0 }
[[parameter]]
name = "R_c"
keys = { "design.R_c" = 1.0 }
prior = { kind = "uniform", low = 0.1, high = 1.0 }
source = "ours"
"""
FILES = {
    "body.xml": BODY, "parts.xml": PARTS, "colours.xml": COLOURS, "meshes/a&b.stl": "a", "meshes/h.png": "h",
    "skin.skn": "s", "other.xml": '<mujoco><asset><mesh file="deep.obj"/></asset></mujoco>', "meshes/deep.obj": "d",
    "pictures/t.png": "t", "plant.json": "{}", "push.csv": "t,push\n0,1\n1,2\n",
    "own.py": "from helpers.gains import K\nimport numpy\n\ndef f():\n    from . import late\n",
    "helpers/__init__.py": "", "helpers/gains.py": "from ..base import A\nfrom .more import B\nK = 1\n",
    "helpers/more.py": "B = 2\n", "late.py": "", "base.py": "A = 3\n",
}  # fmt: skip
ONLY_SWEEP, ONLY_SETPOINT, UNUSED = "body2.xml", "target.csv", ("unused.py", "meshes/unused.stl", "notes.txt")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    every = FILES | {
        "run.toml": RUN + SETPOINT, "still.toml": RUN, "sweep.toml": SWEEP, "experiment.toml": EXPERIMENT,
        "family.toml": FAMILY, ONLY_SWEEP: "<mujoco/>", ONLY_SETPOINT: "t,r\n0,1\n1,2\n", **dict.fromkeys(UNUSED, ""),
    }  # fmt: skip
    for name, text in every.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def of_family(folder: Path) -> str:
    file = load_family_file(folder / "family.toml", allow_code=True)
    return Family(file, Prior(tuple(file.parameter))).fingerprint


MARKS: dict[str, Callable[[Path], str]] = {
    "sweep": lambda folder: Plan.of(load_sweep(folder / "sweep.toml", allow_code=True)).fingerprint,
    "experiment": lambda folder: fingerprint(load_experiment(folder / "experiment.toml", allow_code=True)),
    "family": of_family,
}


@pytest.mark.parametrize("what", MARKS)
def test_every_file_that_a_run_file_reaches_changes_the_fingerprint(what: str, folder: Path) -> None:
    before = MARKS[what](folder)
    assert MARKS[what](folder) == before
    used = [*FILES, *([] if what == "family" else [ONLY_SETPOINT]), *([ONLY_SWEEP] if what == "sweep" else [])]
    seen = {before}
    for name in used:
        with (folder / name).open("a", encoding="utf-8") as file:
            file.write("\n")
        mark = MARKS[what](folder)
        assert mark not in seen, name
        seen.add(mark)
    for name in UNUSED:
        (folder / name).write_text("other", encoding="utf-8")
        assert MARKS[what](folder) == mark, name


def test_a_fingerprint_is_the_same_in_another_place(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    other = tmp_path_factory.mktemp("elsewhere") / "deeper"
    for path in folder.rglob("*"):
        if path.is_file():
            there = other / path.relative_to(folder)
            there.parent.mkdir(parents=True, exist_ok=True)
            there.write_bytes(path.read_bytes())
    for what in MARKS:
        assert MARKS[what](folder) == MARKS[what](other), what
    assert digests(load_run(folder / "run.toml")).keys() == {
        name for name in (*FILES, ONLY_SETPOINT) if not name.endswith(".py")
    }  # without leave, no code is run, and none counts


def test_what_cannot_be_read_is_one_line(folder: Path) -> None:
    (folder / "push.csv").unlink()
    os.mkfifo(folder / "push.csv")
    with pytest.raises(RunFileError, match=r"push\.csv is a pipe, not a file"):
        digests(load_run(folder / "run.toml"))
    (folder / "parts.xml").unlink()
    os.mkfifo(folder / "parts.xml")
    with pytest.raises(ModelError, match=r"parts\.xml, which is not a file"):
        digests(load_run(folder / "run.toml"))


def test_the_compiler_finds_the_files_where_they_are_looked_for(tmp_path: Path) -> None:
    """A model whose mesh is named in an included file, in a folder that another included file names, compiles."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    obj = "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    texts = {
        "body.xml": '<mujoco><include file="mesh.xml"/><include file="where.xml"/>'
        '<worldbody><geom type="mesh" mesh="a"/></worldbody></mujoco>',
        "mesh.xml": '<mujoco><asset><mesh name="a" file="sub/a.obj"/></asset></mujoco>',
        "where.xml": '<mujoco><compiler meshdir="meshes" strippath="true"/></mujoco>',
        "meshes/a.obj": obj,
    }
    (tmp_path / "meshes").mkdir()
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "body.xml")).nmesh == 1
    assert {path.relative_to(tmp_path).as_posix() for path in list_files(tmp_path / "body.xml")} == set(texts)
