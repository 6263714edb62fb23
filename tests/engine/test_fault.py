"""Models that end MuJoCo, stall its compiler, or make it talk: one line, and the process goes on."""

import os
import subprocess
import sys
import time
from pathlib import Path

import mujoco
import numpy as np
import pytest
from engine_cases import MODELS, controller, plant
from model_cases import CROWDED
from patience import PATIENCE
from terminal_cases import told

from icmj import Continuous, Deviation, Settings, load_plant
from icmj.engine import rehearsal
from icmj.engine.faults import EngineFault, guard
from icmj.engine.isolation import isolate_engine
from icmj.engine.run import simulate
from icmj.engine.safety import examine
from icmj.errors import ModelError

PENDULUM = (MODELS / "pendulum.xml").read_text(encoding="utf-8")


def written(folder: Path, text: str) -> Path:
    path = folder / "model.xml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_run_in_which_mujoco_gives_up_keeps_what_was_before(tmp_path: Path) -> None:
    actual = load_plant(written(tmp_path, CROWDED.format(memory="60K")), Deviation(gain=0.0), "upright")
    loose = controller("pendulum").triggered_by(Continuous())
    settings = Settings(duration=2.0, initial={"hinge": 0.5}, limit=9.0, record_interval=0.05)
    run = simulate(actual, loose, settings)
    assert run.outcome.kind == "diverged"
    assert "MuJoCo gave up: mj_stackAlloc: out of memory" in run.outcome.message
    assert run.t[-1] > 0.3
    assert np.isfinite(run.t).all()
    # and this process can still simulate
    assert simulate(plant("pendulum"), loose, Settings(duration=1.0)).outcome.kind == "completed"


def test_a_fatal_error_in_compiled_code_is_caught() -> None:
    import ctypes

    library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco*"))))
    for _ in range(3):
        with pytest.raises(EngineFault, match="MuJoCo gave up: out of stack"):
            guard(lambda: library.mju_error(b"out of stack"))
    assert guard(lambda: 7) == 7
    with pytest.raises(ZeroDivisionError):
        guard(lambda: 1 // 0)


def test_mujoco_says_nothing_where_it_is_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    settings = Settings(duration=1.0, initial={"hinge_rate": 1e11}, limit=1e12)
    assert simulate(plant("pendulum"), controller("pendulum"), settings).outcome.kind == "diverged"
    with isolate_engine(), isolate_engine():
        mujoco.mju_writeLog  # noqa: B018
    assert capfd.readouterr() == ("", "")
    assert list(tmp_path.iterdir()) == []
    config = mujoco.MjLogConfig.get()
    assert config.logto_console
    assert config.logto_file


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        pytest.param("<worldbody>", '<size nkey="2000000000"/><worldbody>', "nkey|GB", marks=pytest.mark.slow),
        ("<worldbody>", '<size nuser_body="2000000000"/><worldbody>', "nuser|GB"),
        ("<worldbody>", '<size memory="900G"/><worldbody>', "GB|usable"),
        pytest.param(
            '<body name="rod">',
            '<replicate count="1000000000"><body name="x"/></replicate><body name="rod">',
            "3 s or 4",
            marks=pytest.mark.slow,
        ),
        (
            '<jointpos name="angle" joint="hinge"/>',
            '<jointpos name="angle" joint="hinge"/><user name="u" dim="100000"/>',
            "100001 sensor entries; icmj takes at most 1000",
        ),
        ("<worldbody>", '<option timestep="nan"/><worldbody>', "option timestep is nan s; give a positive number"),
        ("<worldbody>", '<include file="pipe"/><worldbody>', "pipe, which is not a file"),
        ('name="torque"', 'name="icmj_controller"', "'icmj_controller', which icmj adds itself"),
        ("<sensor>", '<custom><numeric name="icmj_controller" data="1"/></custom><sensor>', "rename it"),
    ],
)
def test_what_asks_for_too_much_is_refused_in_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, old: str, new: str, words: str
) -> None:
    monkeypatch.setattr(rehearsal, "SECONDS", 3)  # of processor time, so that the test ends sooner
    os.mkfifo(tmp_path / "pipe")
    begin = time.monotonic()
    with pytest.raises(ModelError, match=words) as caught:
        load_plant(written(tmp_path, PENDULUM.replace(old, new, 1)), keyframe="upright")
    assert "\n" not in str(caught.value)
    assert time.monotonic() - begin < PATIENCE  # a limit on a hang, not a measure of speed


@pytest.mark.parametrize("name", ["", "a" * 5000, "a\0b", "pipe"])
def test_what_is_no_model_file_is_said(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ModelError, match=r"no such model file|not a file"):
        load_plant(f"{tmp_path}/{name}")


@pytest.mark.parametrize(
    ("old", "new"), [(b'name="bob"', b'name="b\xf6b"'), (b"<mujoco", b"<!--\n\n--><!-- \xe9 --><\xff")]
)
def test_bytes_that_are_no_text_are_refused_by_their_line(tmp_path: Path, old: bytes, new: bytes) -> None:
    path, whole = tmp_path / "model.xml", PENDULUM.encode()
    path.write_bytes(whole.replace(old, new, 1))
    line = path.read_bytes().split(new)[0].count(b"\n") + new.count(b"\n") + 1
    with pytest.raises(ModelError, match=rf"line {line} is not UTF-8 \(byte 0xf[6f]\); save the file as UTF-8"):
        load_plant(path, keyframe="upright")


def test_text_in_any_language_is_taken_and_comments_may_be_anything(tmp_path: Path) -> None:
    path = tmp_path / "model.xml"
    text = PENDULUM.replace('name="bob"', 'name="Gewicht, größer: 重り"').encode()
    path.write_bytes(text.replace(b"<worldbody>", b"<!-- gr\xf6\xdfer -->\n<worldbody>", 1))
    assert "Gewicht, größer: 重り" in load_plant(path, keyframe="upright").xml


CHILD = """<mujoco model="{name}"><asset><model name="me" file="{other}"/></asset><worldbody><body name="b">
<joint name="hinge" type="hinge" axis="0 1 0"/><geom size=".1" mass="1"/><attach model="me" prefix="x_"/>
</body></worldbody><sensor><jointpos joint="hinge"/></sensor></mujoco>"""


def circular(folder: Path, way: str) -> Path:
    """A model that attaches itself: directly, over another model, or as what it includes."""
    (folder / "inner").mkdir()
    (folder / "self.xml").write_text(CHILD.format(name="self", other="self.xml"))
    (folder / "one.xml").write_text(CHILD.format(name="one", other="other.xml"))
    (folder / "other.xml").write_text(CHILD.format(name="other", other="one.xml"))
    (folder / "included.xml").write_text('<mujoco><include file="inner/text.xml"/></mujoco>')
    (folder / "inner" / "text.xml").write_text(CHILD.format(name="text", other="included.xml"))
    return folder / f"{way}.xml"


@pytest.mark.slow
@pytest.mark.parametrize("way", ["self", "one", "included"])
@pytest.mark.parametrize("command", [["linearise"], ["new"], ["person", "--height", "1.8", "--mass", "80"]])
def test_a_model_that_attaches_itself_ends_no_more_than_its_rehearsal(
    tmp_path: Path, way: str, command: list[str]
) -> None:
    model = circular(tmp_path, way)
    words = [command[0], str(model), *command[1:], *(["--out", "out.xml"] if len(command) > 1 else [])]
    done = subprocess.run(
        [sys.executable, "-m", "icmj.cli", *words], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    assert done.returncode == 2
    (line,) = told(done.stderr)
    assert f"{way}.xml: MuJoCo's compiler breaks down on this model" in line
    assert "neither attaches nor includes itself" in line
    assert {path.name for path in tmp_path.iterdir()} == {
        "inner", "self.xml", "one.xml", "other.xml", "included.xml"
    }  # fmt: skip


def test_a_model_is_rehearsed_once_for_each_state_of_its_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Path] = []
    monkeypatch.setattr("icmj.engine.safety.rehearse", seen.append)
    for model in MODELS.glob("*.xml"):
        examine(model)
    assert seen == [], "a shipped model changed: put its new SHA-256 into icmj/engine/safety.py"
    copy = written(tmp_path, PENDULUM)
    examine(copy)
    assert seen == []
    # what it includes or attaches, and what these refer to, is part of it
    (tmp_path / "child.xml").write_text('<mujoco><asset><mesh file="a.stl"/></asset></mujoco>')
    (tmp_path / "a.stl").write_bytes(b"1")
    for tag in ("include", "asset><model"):
        written(tmp_path, PENDULUM.replace("<worldbody>", f'<{tag} file="child.xml"/><worldbody>'))
        for change in (
            None,
            ("child.xml", b"<mujoco/>"),
            ("a.stl", b"22"),
            ("model.xml", f"<mujoco/><!--{tag}-->".encode()),
        ):
            (tmp_path / "child.xml").write_text('<mujoco><asset><mesh file="a.stl"/></asset></mujoco>')
            if change is not None:
                before = (tmp_path / change[0]).read_bytes()
                (tmp_path / change[0]).write_bytes(change[1])
            count = len(seen)
            examine(copy)
            examine(copy)
            assert len(seen) == count + 1, (tag, change)
            if change is not None:
                (tmp_path / change[0]).write_bytes(before)


def test_what_is_refused_in_order_is_told_as_ever(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"not a usable MJCF model: .*XML"):
        load_plant(written(tmp_path, "<mujoco><"))
    with pytest.raises(ModelError, match="not a usable MJCF model"):
        load_plant(written(tmp_path, PENDULUM.replace('joint="hinge"', 'joint="nobody"')))
