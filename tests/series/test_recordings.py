"""Recordings of a movement laboratory: OpenSim's tables and C3D, written here by hand and by ezc3d's own writer."""

import contextlib

import numpy as np
import pytest

from icmj import Series, read_series, write_series
from icmj.errors import DataError
from icmj.series.formats import c3d

T = np.arange(0, 4, 0.01)


def table(title: str, columns: dict[str, np.ndarray], degrees: str = "yes", rows: int | None = None) -> str:
    """A file as OpenSim writes it."""
    count = len(T) if rows is None else rows
    header = f"{title}\nversion=1\nnRows={count}\nnColumns={1 + len(columns)}\ninDegrees={degrees}\n\nendheader\n"
    lines = ["\t".join(("time", *columns))]
    lines += ["\t".join(f"{value:16.8f}" for value in row) for row in zip(T, *columns.values(), strict=True)]
    return header + "\n".join(lines) + "\n"


@pytest.mark.parametrize(("degrees", "angle"), [("yes", "deg"), ("no", "rad")])
def test_coordinates_of_opensim_have_their_units(tmp_path, degrees, angle):
    columns = {"pelvis_tx": np.sin(T), "ankle_angle_r": np.cos(T), "/jointset/hip/hip_flexion_r/speed": T}
    (tmp_path / "ik.mot").write_text(table("Coordinates", columns, degrees))
    series = read_series(tmp_path / "ik.mot")
    assert series.names == tuple(columns)
    assert series.units == ("m", angle, f"{angle}/s")
    np.testing.assert_allclose(series.t, T, atol=1e-8)
    np.testing.assert_allclose(series["ankle_angle_r"], np.cos(T), atol=1e-8)
    assert read_series(tmp_path / "ik.mot", columns=["ankle_angle_r"]).units == (angle,)


def test_a_slider_by_any_name_is_not_in_degrees(tmp_path):
    columns = {"box_transX": T, "tx": T, "knee_angle_r_beta": T, "pelvis_tilt": T, "gear": T}
    (tmp_path / "ik.mot").write_text(table("Coordinates", columns, "yes"))
    assert read_series(tmp_path / "ik.mot").units == ("", "", "deg", "deg", "")


def test_ground_reactions_and_moments_of_opensim_have_their_units(tmp_path):
    names = "ground_force_vx 1_ground_force_px ground_torque_y hip_r_moment pelvis_tx_force soleus".split()  # noqa: SIM905
    (tmp_path / "forces.sto").write_text(table("forces", dict.fromkeys(names, np.ones(len(T)))))
    assert read_series(tmp_path / "forces.sto").units == ("N", "m", "N m", "N m", "N", "")


@pytest.mark.parametrize(("text", "words"), [
    (table("Coordinates", {"a": T}, rows=500), "400 rows where its header says 500; was it cut short"),
    (table("Coordinates", {"a": T}, rows=4_000_000_000), "400 rows where its header says 4000000000"),
    (table("Coordinates", {"a": T}, rows=-400), "nRows=-400 in its header; expected a number of rows"),
    (table("Coordinates", {"a": T}).replace("nRows=400", "nRows=4e2"), "nRows=4e2 in its header"),
    (table("Coordinates", {"a": T}).replace("nRows=400", "nRows=" + "9" * 5000), "nRows=999.* in its header"),
    (table("Coordinates", {"a": T}, "maybe"), "inDegrees=maybe in its header; expected yes or no"),
    (table("Coordinates", {"a": T}, ""), "inDegrees= in its header; expected yes or no"),
    ("time\ta\n" + "0\t1\n1\t2\n", "no line 'endheader'"),
    ("x\n" * 500, "no line 'endheader'"),
    ("Marker\nDataType=Vec3\nendheader\ntime\tC7\n0\t1,2,3\n1\t1,2,3\n", "a table of vec3"),
    ("\nendheader\n", "no rows of numbers"),
    ("", "no line 'endheader'"),
])  # fmt: skip
def test_a_table_that_is_none_is_refused_in_one_line(tmp_path, text, words):
    (tmp_path / "wrong.sto").write_text(text)
    with pytest.raises(DataError, match=words):
        read_series(tmp_path / "wrong.sto")


def test_an_angle_whose_unit_a_header_does_not_say_has_none(tmp_path):
    text = table("Coordinates", {"ankle_angle_r": T, "pelvis_tx": T}).replace("inDegrees=yes\n", "")
    (tmp_path / "ik.mot").write_text(text)
    assert read_series(tmp_path / "ik.mot").units == ("", "m")
    (tmp_path / "ik.mot").write_text(table("Coordinates", {"ankle_angle_r": T}, "Yes"))
    assert read_series(tmp_path / "ik.mot").units == ("deg",)


@pytest.mark.parametrize("kind", ["mot", "sto", "csv", "parquet", "npz"])
def test_what_was_recorded_before_0_is_measured(tmp_path, shell, kind):
    """A recording often begins before the trigger that is its 0: without that half, of mean 2, the rest has mean 1."""
    t = np.arange(-200, 200) / 100
    x = np.where(t < 0, 2.0, 1.0) + 1e-3 * np.sin(9 * t)
    path = tmp_path / f"early.{kind}"
    if kind in ("mot", "sto"):
        path.write_text(table("forces", {"ap": x}).split("endheader")[0] + "endheader\ntime\tap\n")
        with path.open("a") as file:
            file.writelines(f"{a:.2f}\t{b:.8f}\n" for a, b in zip(t, x, strict=True))
    else:
        write_series(Series(t, x[:, None], ("ap",), ("mm",)), path)
    found = shell.answers(["measure", str(path), "--json"])
    assert found["duration"] == pytest.approx(4.0)
    assert found["coordinates"][0]["mean"] == pytest.approx(1.5, abs=1e-3)
    found = shell.answers(["measure", str(path), "--since", "0", "--json"])
    assert found["duration"] == pytest.approx(2.0)
    assert found["coordinates"][0]["mean"] == pytest.approx(1.0, abs=1e-3)


def write_plates(path, loads=(700.0,), *, point="mm", moment="Nmm", size=1.0, kind=2, order=(0, 1, 2, 3)):
    """Two points at 100 Hz, and force plates at 1000 Hz whose x is the laboratory's and whose z points down.

    Args:
        loads: mean load of each plate [N], the next one 700 mm further on; what stands on one with 0 N weighs nothing.
        point, moment: units; "" for none.
        size: of one N mm in the unit of moments.
        kind: type of the last plate.
        order: in which the corners stand, of which 0, 1, 2, 3 go around the plate.

    Returns:
        Points, channels, and centres of pressure in the plates, shape (plates, 2, 4000) [mm].
    """
    ezc3d = pytest.importorskip("ezc3d")
    file, rng, N, M = ezc3d.c3d(), np.random.default_rng(0), 400, len(loads)
    points = np.ones((4, 2, N))
    points[:3] = rng.normal(size=(3, 2, N))
    parameters = file["parameters"]
    parameters["POINT"]["RATE"]["value"] = [100]
    parameters["POINT"]["LABELS"]["value"] = ("C7", "LASI")
    if point:
        parameters["POINT"]["UNITS"]["value"] = [point]
    parameters["ANALOG"]["RATE"]["value"] = [1000]
    names = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
    parameters["ANALOG"]["LABELS"]["value"] = tuple(f"{name}{i + 1}" for i in range(M) for name in names)
    parameters["ANALOG"]["UNITS"]["value"] = ("N", "N", "N", moment, moment, moment) * M
    centres = rng.normal(size=(M, 2, 10 * N)) * [[5.0], [3.0]]  # mm, in the plate
    none, forces = np.zeros(10 * N), []
    for load, centre in zip(loads, centres, strict=True):
        weight = load + (rng.normal(size=10 * N) if np.ndim(load) == 0 and load else none)
        forces += [none, none, weight, size * centre[1] * weight, -size * centre[0] * weight, none]
    file.add_parameter("FORCE_PLATFORM", "USED", M)
    for name, numbers, shape in (
        ("TYPE", [*[2] * (M - 1), kind], [M]), ("ZERO", [1, 0], [2]), ("CHANNEL", range(1, 6 * M + 1), [6, M]),
    ):  # fmt: skip
        whole = ezc3d.ezc3d.Parameter(name, "")  # add_parameter makes lists of floats
        whole.set(ezc3d.ezc3d.VecInt(list(numbers)), shape)
        file["parameters"].add_parameter("FORCE_PLATFORM", whole)
    corners = np.array([[300, -200, 0], [-300, -200, 0], [-300, 200, 0], [300, 200, 0]], float)
    corners = corners[list(order)]
    file.add_parameter(
        "FORCE_PLATFORM", "CORNERS", np.stack([np.add(corners.T, [[700 * i], [0], [0]]) for i in range(M)], -1)
    )
    file.add_parameter("FORCE_PLATFORM", "ORIGIN", np.zeros((3, M)))
    file["data"]["points"], file["data"]["analogs"] = points, np.array(forces)[None]
    file.write(str(path))
    return points, np.array(forces), centres


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("c3d") / "standing.c3d"
    points, forces, (centre,) = write_plates(path)
    return path, points, forces, centre


@pytest.mark.parametrize(("point", "moment", "size"), [("mm", "Nm", 1e-3), ("mm", "N.m", 1e-3), ("m", "Nmm", 1.0)])
def test_moments_in_another_unit_than_the_points_give_the_same_centre_of_pressure(tmp_path, point, moment, size):
    """The library takes moments for those in the unit of force times the points' unit, whatever the file says."""
    _, forces, (centre,) = write_plates(tmp_path / "a.c3d", point=point, moment=moment, size=size)
    series, scale = read_series(tmp_path / "a.c3d"), {"mm": 1.0, "m": 1e-3}[point]
    assert series.units == (point, point)
    # corners are in the points' unit, too: the middle of this plate is at 0 in any
    np.testing.assert_allclose(series.values, scale * (centre * [[1], [-1]]).T, atol=1e-3 * scale)
    np.testing.assert_allclose(read_series(tmp_path / "a.c3d", columns=["My1"])["My1"], forces[4], rtol=1e-6)


@pytest.mark.parametrize("units", [(), ("N",) * 2, ("V",) * 6, ("kN",) * 3 + ("kNmm",) * 3])
def test_whatever_units_channels_state_a_loaded_plate_has_a_centre_of_pressure(recording, tmp_path, units):
    """None, some, those of amplifiers: forces are taken for newtons; and 0.7 kN are a load, with moments in kN mm."""
    ezc3d = pytest.importorskip("ezc3d")
    path, _, _, centre = recording
    file = ezc3d.c3d(str(path))
    file["parameters"]["ANALOG"]["UNITS"]["value"] = units
    if "kN" in units:
        file["data"]["analogs"] = 1e-3 * file["data"]["analogs"]
    file.write(str(tmp_path / "a.c3d"))
    series = read_series(tmp_path / "a.c3d")
    np.testing.assert_allclose(series.values, (centre * [[1], [-1]]).T, atol=1e-3)
    force = read_series(tmp_path / "a.c3d", columns=["plate1.force.z"])
    assert force.units == ("kN" if "kN" in units else "N",)
    assert np.abs(force["force.z"]).mean() == pytest.approx(0.7 if "kN" in units else 700.0, rel=1e-3)


def test_points_without_a_unit_have_none(tmp_path, shell):
    write_plates(tmp_path / "a.c3d", point="")
    assert read_series(tmp_path / "a.c3d").units == ("", "")
    assert read_series(tmp_path / "a.c3d", columns=["C7.x"]).units == ("",)
    told = shell.answers(["measure", str(tmp_path / "a.c3d"), "--unit", "mm", "--json"])
    assert told["coordinates"][0]["unit"] == "mm"


def test_two_feet_on_two_plates_have_one_centre_of_pressure_and_a_plate_without_load_has_none(tmp_path):
    loads = (400.0, 300.0, 0.0)
    _, forces, centres = write_plates(tmp_path / "a.c3d", loads)
    series = read_series(tmp_path / "a.c3d")
    assert series.names == ("cop.x", "cop.y")
    weights = forces[2::6]
    # the ground's forces on both plates have no moment about it
    middle = np.array([[700.0 * i, 0.0] for i in range(3)])[:, :, None] + centres * [[1], [-1]]
    expected = (weights[:, None] * middle).sum(axis=0) / weights.sum(axis=0)
    np.testing.assert_allclose(series.values, expected.T, atol=0.1)
    each = read_series(tmp_path / "a.c3d", columns=["plate2.cop.x", "plate3.cop.x"])
    np.testing.assert_allclose(each["plate2.cop.x"], middle[1, 0], atol=0.1)
    assert np.isnan(each["plate3.cop.x"]).all()


def test_before_somebody_steps_on_a_plate_there_is_no_centre_of_pressure(tmp_path, shell):
    load = np.where(np.arange(4000) < 2000, 5.0, 700.0)  # N: what an empty plate drifts to, and a person
    write_plates(tmp_path / "a.c3d", (load,))
    series = read_series(tmp_path / "a.c3d")
    assert np.isnan(series.values[:2000]).all()
    assert np.isfinite(series.values[2000:]).all()
    assert "missing" in shell.refuses(["measure", str(tmp_path / "a.c3d")])
    told = shell.answers(["measure", str(tmp_path / "a.c3d"), "--since", "2", "--json"])
    assert told["coordinates"][0]["rms"] == pytest.approx(5.0, rel=0.05)


def test_plates_that_cannot_be_read_are_told_and_no_marker_is_measured_in_their_place(tmp_path, shell):
    write_plates(tmp_path / "a.c3d", (400.0, 300.0), kind=6)
    with pytest.raises(
        DataError, match=r"its force plates cannot be read .*; name what to read instead, such as C7\.x"
    ):
        read_series(tmp_path / "a.c3d")
    assert read_series(tmp_path / "a.c3d", columns=["C7.x"]).names == ("C7.x",)
    assert "its force plates cannot be read" in shell.refuses(["measure", str(tmp_path / "a.c3d")])


@pytest.mark.parametrize("order", [(0, 2, 1, 3), (0, 1, 3, 2), (1, 0, 2, 3)])
def test_corners_that_do_not_go_around_their_plate_are_a_fault(order, tmp_path):
    """The axes of a plate follow from its corners: what sways front to back was somewhere between."""
    write_plates(tmp_path / "a.c3d", order=order)
    with pytest.raises(DataError, match=r"cannot be read \(the corners of plate 1 are not in their order around it\)"):
        read_series(tmp_path / "a.c3d")
    for around in (np.roll(range(4), 1), np.arange(4)[::-1]):
        write_plates(tmp_path / "a.c3d", order=around)
        assert read_series(tmp_path / "a.c3d").names == ("plate1.cop.x", "plate1.cop.y")


def test_a_centre_of_pressure_beside_its_plate_is_told(tmp_path, shell):
    write_plates(tmp_path / "a.c3d", size=100.0)
    (note,) = shell.answers(["measure", str(tmp_path / "a.c3d"), "--json"])["notices"][:1]
    assert "plate 1: the centre of pressure is beside it in" in note
    write_plates(tmp_path / "a.c3d")
    assert shell.answers(["measure", str(tmp_path / "a.c3d"), "--json"])["notices"] == []


def test_points_and_analog_channels_of_c3d_are_read_with_rates_and_units(recording):
    path, points, forces, _ = recording
    series = read_series(path, columns=["C7.x", "LASI.z"])
    assert series.units == ("mm", "mm")
    np.testing.assert_allclose(series.values, points[[0, 2], [0, 1]].T, rtol=1e-6)
    assert np.diff(series.t) == pytest.approx(0.01)
    series = read_series(path, columns=["Mx1", "Fz1"])
    assert series.units == ("Nmm", "N")
    np.testing.assert_allclose(series.values, forces[[3, 2]].T, rtol=1e-6)
    assert np.diff(series.t) == pytest.approx(0.001)
    with pytest.raises(DataError, match="columns at 100 and 1000 Hz, which have no rows in common"):
        read_series(path, columns=["C7.x", "Fz1"])
    with pytest.raises(DataError, match=r"no column 'C8.x'; expected one of plate1.cop.x"):
        read_series(path, columns=["C8.x"])


def test_the_centre_of_pressure_of_c3d_is_that_of_the_moments(recording, shell):
    path, _, _, centre = recording
    series = read_series(path)
    assert series.names == ("plate1.cop.x", "plate1.cop.y")
    assert series.units == ("mm", "mm")
    # the plate's y is opposite to the laboratory's
    np.testing.assert_allclose(series.values, (centre * [[1], [-1]]).T, atol=1e-3)
    told = shell.answers(["measure", str(path), "--json"])
    assert told["coordinates"][0]["rms"] == pytest.approx(centre[0].std(), rel=1e-4)
    assert told["plane"] is not None
    mixed = read_series(path, columns=["cop.x", "force.z", "Fz1"])
    assert mixed.names == ("plate1.cop.x", "plate1.force.z", "Fz1")


@pytest.mark.parametrize("seed", range(4))
def test_a_damaged_c3d_is_read_or_refused_in_one_line(recording, tmp_path, seed):
    raw, rng = bytearray(recording[0].read_bytes()), np.random.default_rng(seed)
    for at in rng.integers(0, 2500, 20):
        raw[at] = rng.integers(256)
    (tmp_path / "damaged.c3d").write_bytes(raw[: rng.integers(len(raw))])
    with contextlib.suppress(DataError):
        read_series(tmp_path / "damaged.c3d")


@pytest.mark.parametrize("share", [0.1, 0.5, 0.99])
def test_a_c3d_that_was_cut_short_is_refused(recording, tmp_path, share):
    """Its reader takes the frames that it finds, and makes its header say that these are all."""
    raw = recording[0].read_bytes()
    (tmp_path / "cut.c3d").write_bytes(raw[: int(share * len(raw))])
    with pytest.raises(DataError, match=r"\d+ frames where its header says 400; was it cut short\?"):
        read_series(tmp_path / "cut.c3d")


@pytest.mark.parametrize("told", [False, True])
def test_a_c3d_with_more_frames_than_its_reader_counts_is_refused(tmp_path, told):
    """A header counts to 65535; what has more says so in the group TRIAL, or has more data than that."""
    ezc3d = pytest.importorskip("ezc3d")
    file, N = ezc3d.c3d(), 70_000
    file["parameters"]["POINT"]["RATE"]["value"] = [1000]
    file["parameters"]["POINT"]["LABELS"]["value"] = ("C7",)
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["data"]["points"] = np.ones((4, 1, N))
    if told:
        for end, frame in ("START", 1), ("END", N):
            field = ezc3d.ezc3d.Parameter(f"ACTUAL_{end}_FIELD", "")
            field.set(ezc3d.ezc3d.VecInt([frame % 65536, frame // 65536]), [2])
            file["parameters"].add_parameter("TRIAL", field)
    file.write(str(tmp_path / "long.c3d"))
    frames = "70000" if told else r"699\d\d"  # what fills up the last block may be taken for none
    with pytest.raises(DataError, match=rf"{frames} frames or more, of which ezc3d reads 65535; cut it into parts"):
        read_series(tmp_path / "long.c3d")


def test_a_reader_that_dies_or_takes_too_long_is_told(recording, tmp_path, monkeypatch):
    program = tmp_path / "reader.py"
    monkeypatch.setattr(c3d, "_READER", program)
    program.write_text("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    with pytest.raises(DataError, match="reading it ended the reader"):
        read_series(recording[0])
    program.write_text("import time; time.sleep(30)")
    with pytest.raises(DataError, match=r"takes more than 0.2 s"):
        c3d.read_groups(recording[0], longest=0.2)


def test_the_reader_has_one_thread_of_blas(recording, tmp_path, monkeypatch):
    """On a machine of sixty processors their threads take more addresses than the reader may use."""
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "64")
    monkeypatch.setattr(c3d, "_READER", tmp_path / "reader.py")
    program = "import os, sys; sys.stderr.write(os.environ['OPENBLAS_NUM_THREADS'] + ' thread'); sys.exit(3)"
    c3d._READER.write_text(program)
    with pytest.raises(DataError, match="1 thread"):
        c3d.read_groups(recording[0])


def test_without_ezc3d_one_line_says_so(tmp_path, monkeypatch):
    (tmp_path / "a.c3d").write_bytes(b"\0")
    monkeypatch.setattr(c3d.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(DataError, match="ezc3d, which reads C3D, is not installed; `pip install ezc3d`"):
        read_series(tmp_path / "a.c3d")
