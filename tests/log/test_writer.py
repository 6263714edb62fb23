"""What is in the file, read with rerun's and Arrow's own means, and that it is there whole or not at all."""

import functools
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pyarrow as pa
import pytest
import rerun as rr
from log_cases import MODELS, assert_same, made_up, with_scene
from rerun.chunk import RrdReader

from icmj import ClockTrigger, Continuous, Result, Settings, error_system, load_plant, measure, predict, write_log
from icmj.base.files import whole
from icmj.case.comparison import Comparison, compare
from icmj.engine.run import simulate
from icmj.errors import LogError
from icmj.log.figure import place_eye
from icmj.log.reader import read_log, read_summary
from icmj.simulation.scene import FRAME, Geom
from icmj.simulation.simulation import Events


@pytest.fixture(scope="module")
def three_link() -> Result:
    return with_scene(*made_up("three_link", 0.9, 0.7594, 12.0))


@pytest.fixture(scope="module")
def log(three_link: Result, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "case.rrd"
    write_log(three_link, path)
    return path


def tables(path: Path, entity: str, *, static: bool = False) -> list[pa.RecordBatch]:
    """Every chunk of an entity as an Arrow table."""
    chunks = RrdReader(path).store().stream().filter(content=entity, is_static=static)
    return [chunk.to_record_batch() for chunk in chunks]


def column(path: Path, entity: str, component: str, *, static: bool = False) -> np.ndarray:
    """One component, all rows after each other."""
    batches = tables(path, entity, static=static)
    parts = [batch.column(component).flatten() for batch in batches if component in batch.schema.names]
    while pa.types.is_list(parts[0].type) or pa.types.is_fixed_size_list(parts[0].type):
        parts = [part.flatten() for part in parts]
    return np.concatenate([part.to_numpy(zero_copy_only=False) for part in parts])


def times(path: Path, entity: str) -> np.ndarray:
    return np.concatenate([b.column("time").cast(pa.int64()).to_numpy() for b in tables(path, entity)])


@pytest.mark.parametrize(
    ("entity", "name"), [("/outputs/run", "y"), ("/states/plant", "x"), ("/states/observer", "x_o")]
)
def test_a_series_is_there_in_full_precision_at_its_times(entity, name, log, three_link):
    values = getattr(three_link.simulation, name)
    np.testing.assert_array_equal(column(log, entity, "Scalars:scalars").reshape(values.shape), values)
    np.testing.assert_allclose(times(log, entity), three_link.simulation.t * 1e9, atol=0.51)


def test_the_legend_has_names_events_are_marks_and_there_is_one_timeline(log: Path, three_link: Result) -> None:
    (names,) = (b.column("SeriesLines:names").to_pylist()[0] for b in tables(log, "/outputs/run", static=True))
    assert tuple(names) == three_link.actual.outputs
    events = three_link.simulation.events
    np.testing.assert_array_equal(column(log, "/interval/events", "Scalars:scalars"), events.interval)
    np.testing.assert_allclose(times(log, "/interval/events"), events.t * 1e9, atol=0.51)
    lines = {name for chunk in RrdReader(log).store().stream() for name in chunk.timeline_names}
    assert lines == {"time"}


def test_bodies_move_as_the_poses_say(log: Path, three_link: Result) -> None:
    scene, t = three_link.scene, three_link.simulation.t
    assert scene is not None
    index = scene.bodies.index("trunk")
    poses = {"true": (scene.xpos, scene.xquat), "magnified": (scene.magnified_xpos, scene.magnified_xquat)}
    for figure, (xpos, xquat) in poses.items():
        entity = f"/scene/{figure}/trunk"
        at = times(log, entity) * 1e-9
        rows = np.abs(t[:, None] - at).argmin(axis=0)
        assert np.diff(at).max() < 1.5 * FRAME
        place = column(log, entity, "Transform3D:translation").reshape(-1, 3)
        turn = column(log, entity, "Transform3D:quaternion").reshape(-1, 4)
        np.testing.assert_allclose(place, xpos[rows, index], atol=1e-6)
        np.testing.assert_allclose(turn[:, [3, 0, 1, 2]], xquat[rows, index], atol=1e-6)
    x = [column(log, f"/scene/{f}", "Transform3D:translation", static=True)[0] for f in ("true", "magnified")]
    assert x[1] - x[0] > 0.5, "the magnified figure stands beside the true one"
    (batch,) = tables(log, "/scene/magnified/label", static=True)
    assert batch.column("Points3D:labels").to_pylist()[0][0] == "sway × 10"


def test_capsules_end_where_they_end_in_mujoco(log: Path, three_link: Result) -> None:
    """rerun's capsule begins at its origin and runs along its z axis; MuJoCo's is centred."""
    scene = three_link.scene
    assert scene is not None
    capsules: list[Geom] = [g for g in scene.geoms if g.type == "capsule" and scene.bodies[g.body] == "trunk"]
    entity = "/scene/true/trunk/capsule"
    start = column(log, entity, "Capsules3D:translations", static=True).reshape(-1, 3)
    length = column(log, entity, "Capsules3D:lengths", static=True)
    turn = column(log, entity, "Capsules3D:quaternions", static=True).reshape(-1, 4)[:, [3, 0, 1, 2]].astype(float)
    radii = column(log, entity, "Capsules3D:radii", static=True)
    np.testing.assert_allclose(radii, [g.size[0] for g in capsules], rtol=1e-6)
    for i, geom in enumerate(capsules):
        ours, theirs = np.zeros(3), np.zeros(3)
        mujoco.mju_rotVecQuat(ours, np.array([0, 0, float(length[i])]), turn[i])
        mujoco.mju_rotVecQuat(theirs, np.array([0, 0, geom.size[1]]), geom.quat)
        np.testing.assert_allclose(start[i], geom.pos - theirs, atol=1e-6)
        np.testing.assert_allclose(start[i] + ours, geom.pos + theirs, atol=1e-6)


def test_the_centre_of_mass_covers_its_place_from_the_opening_eye(log: Path, three_link: Result) -> None:
    """It is drawn in front of the body: on the straight line from where it is to the eye, and clear of the arms."""
    scene = three_link.scene
    assert scene is not None
    position = place_eye(scene)[0]
    for figure, com in (("true", scene.com), ("magnified", scene.magnified_com)):
        root = column(log, f"/scene/{figure}", "Transform3D:translation", static=True)
        entity = f"/scene/{figure}/centre_of_mass"
        moved = column(log, entity, "Transform3D:translation", static=True)
        shrunk = column(log, entity, "Transform3D:scale", static=True)
        stored = column(log, f"{entity}/point", "Points3D:positions").reshape(-1, 3)
        np.testing.assert_allclose(stored[0], com[0], atol=1e-6)
        is_at, drawn_at = root + stored, root + moved + shrunk * stored
        np.testing.assert_allclose(np.cross(is_at - position, drawn_at - position), 0, atol=1e-5)
        assert (drawn_at[:, 1] < -0.26).all()


def test_a_plant_with_more_states_than_its_model_is_logged(tmp_path: Path) -> None:
    """The neglected actuator, simulated in MuJoCo: n = 4, n̂ = 2."""
    plant = load_plant(MODELS / "pendulum_neglected.xml", keyframe="upright")
    base, _ = made_up(duration=3.0)
    controller, actual = base.controller, plant.linearisation.plant
    system = error_system(actual, controller.design)
    settings = Settings(duration=8.0, initial={"hinge": 0.05})
    simulation = simulate(plant, controller, settings)
    result = replace(
        base,
        actual=actual,
        prediction=predict(system, controller.trigger, delta_max=4.0),
        simulation=simulation,
        continuous=simulate(plant, controller.triggered_by(Continuous()), settings),
        measurement=measure(simulation, T_hat=system.T_hat),
    )
    write_log(with_scene(result, plant), tmp_path / "x.rrd")
    assert_same(result, read_log(tmp_path / "x.rrd"))
    chi = column(tmp_path / "x.rrd", "/modes/critical", "Scalars:scalars")
    assert len(chi) == len(simulation.t)
    assert np.isfinite(chi).all()


def test_a_minute_of_the_three_link_fits_in_ten_megabytes(tmp_path: Path) -> None:
    result = with_scene(*made_up("three_link", 0.9, 0.7594, 60.0))
    write_log(result, tmp_path / "minute.rrd")
    assert (tmp_path / "minute.rrd").stat().st_size < 10e6


OTHER_KINDS = (
    "no events", "one row", "diverged", "diverged, with figures", "no prediction", "clock", "continuous", "no growth",
)  # fmt: skip


@functools.cache
def other_kinds() -> dict[str, Result]:
    """Results that lack what the usual one has."""
    result, plant = made_up(duration=3.0)
    simulation = result.simulation
    never = Events(np.zeros(0), *(np.zeros((0, 2)),) * 3, *(np.zeros((0, 1)),) * 2)
    numbers = ("delta_crit", "eigenvalue", "period", "gamma", "amplitude", "orbit", "multipliers", "V_inv")
    nothing = dict.fromkeys(numbers)
    one = {f: getattr(simulation, f)[:1] for f in ("t", "x", "y", "u", "x_o", "x_h", "E")}
    late = simulation.t[:, None] > 2
    nan = {f: np.where(late, np.nan, getattr(simulation, f)) for f in ("x", "y", "u", "x_o", "x_h")}
    no_E = np.full_like(simulation.E, np.nan)
    none = {"p": None, "interval": None, "intervals": np.zeros(0), "period": None, "residual": np.nan}
    quiet = replace(result.measurement, kind="no events", **none)
    clocked, continuous = (
        replace(result, controller=result.controller.triggered_by(rule)) for rule in (ClockTrigger(0.5), Continuous())
    )
    return {
        "no events": replace(result, simulation=replace(simulation, events=never), measurement=quiet),
        "one row": replace(result, simulation=replace(simulation, **one, events=never), measurement=quiet),
        "diverged": replace(result, simulation=replace(simulation, **nan)),
        "diverged, with figures": with_scene(replace(result, simulation=replace(simulation, **nan)), plant),
        "no prediction": replace(result, prediction=replace(result.prediction, cycle=False, **nothing)),
        "clock": replace(clocked, simulation=replace(simulation, control="clock", E=no_E)),
        "continuous": replace(
            continuous, simulation=replace(simulation, control="continuous", E=no_E, events=never), measurement=quiet
        ),
        "no growth": replace(result, growth=None, law=None),
    }


@pytest.mark.parametrize("kind", OTHER_KINDS)
def test_every_kind_of_result_is_logged(kind: str, tmp_path: Path) -> None:
    result = other_kinds()[kind]
    write_log(result, tmp_path / "x.rrd")
    assert_same(replace(result, scene=None), read_log(tmp_path / "x.rrd"))


def test_a_run_is_compared_with_its_prediction_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compared: list[Result] = []

    def counting(result: Result) -> Comparison:
        compared.append(result)
        return compare(result)

    monkeypatch.setattr("icmj.log.writer.compare", counting)
    result, _ = made_up(duration=3.0)
    write_log(result, tmp_path / "x.rrd")
    assert compared == [result]
    assert read_summary(tmp_path / "x.rrd")["outcome"]["verdict"] == compare(result).words


def test_one_content_has_one_identity(tmp_path: Path) -> None:
    """Two versions of a case open as two recordings, a copy as one."""
    first, _ = made_up(duration=3.0)
    second = replace(first, provenance={"git": "another"})
    identity = []
    for i, result in enumerate((first, first, second)):
        write_log(result, tmp_path / f"{i}.rrd")
        identity.append(RrdReader(tmp_path / f"{i}.rrd").recordings()[0].recording_id)
    assert identity[0] == identity[1] != identity[2]


def test_a_failure_leaves_the_old_log_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.rrd"
    result, _ = made_up(duration=3.0)
    write_log(result, path)
    before = path.read_bytes()

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    for where in ("icmj.log.writer.write_phase_plane", "icmj.log.writer._verify", "os.replace"):
        with monkeypatch.context() as patch:
            patch.setattr(where, fail)
            with pytest.raises(LogError, match=r"x\.rrd: the log cannot be written .*No space left"):
                write_log(result, path)
        assert [file.name for file in tmp_path.iterdir()] == ["x.rrd"]
        assert path.read_bytes() == before
        assert not rr.strict_mode()


def test_a_full_disk_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """rerun itself is silent about it until the file is read back."""
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full on this system")

    @contextmanager
    def on_a_full_disk(target: Path) -> Iterator[Path]:
        with whole(target) as part:
            part.symlink_to("/dev/full")
            yield part

    monkeypatch.setattr("icmj.log.writer.whole", on_a_full_disk)
    with pytest.raises(LogError, match="cannot be written"):
        write_log(made_up(duration=3.0)[0], tmp_path / "x.rrd")
    assert list(tmp_path.iterdir()) == []


def test_recording_switched_off_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RERUN", "off")
    with pytest.raises(LogError, match="RERUN"):
        write_log(made_up(duration=3.0)[0], tmp_path / "x.rrd")
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.rrd").mkdir()
    result, _ = made_up(duration=3.0)
    for place in (tmp_path / "file" / "x.rrd", tmp_path / "folder.rrd"):
        with pytest.raises(LogError, match=str(place)):
            write_log(result, place)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["file", "folder.rrd"]
