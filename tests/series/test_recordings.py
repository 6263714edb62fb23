"""Recordings of a movement laboratory: OpenSim's tables and C3D, written here by hand and by ezc3d's own writer."""

import contextlib

import numpy as np
import pytest

from icmj import Series, read_series, write_series
from icmj.errors import DataError
from icmj.series import formats

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


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Two points at 100 Hz, and one force plate at 1000 Hz whose x is the laboratory's and whose z points down."""
    ezc3d = pytest.importorskip("ezc3d")
    file, rng, N = ezc3d.c3d(), np.random.default_rng(0), 400
    points = np.ones((4, 2, N))
    points[:3] = rng.normal(size=(3, 2, N))
    parameters = file["parameters"]
    parameters["POINT"]["RATE"]["value"] = [100]
    parameters["POINT"]["LABELS"]["value"] = ("C7", "LASI")
    parameters["POINT"]["UNITS"]["value"] = ["mm"]
    parameters["ANALOG"]["RATE"]["value"] = [1000]
    parameters["ANALOG"]["LABELS"]["value"] = ("Fx1", "Fy1", "Fz1", "Mx1", "My1", "Mz1")
    parameters["ANALOG"]["UNITS"]["value"] = ("N", "N", "N", "Nmm", "Nmm", "Nmm")
    centre = rng.normal(size=(2, 10 * N)) * [[5.0], [3.0]]  # mm, in the plate
    weight = 700 + rng.normal(size=10 * N)
    none = np.zeros(10 * N)
    forces = np.array([none, none, weight, centre[1] * weight, -centre[0] * weight, none])
    file.add_parameter("FORCE_PLATFORM", "USED", 1)
    for name, numbers, shape in (("TYPE", [2], [1]), ("ZERO", [1, 0], [2]), ("CHANNEL", range(1, 7), [6, 1])):
        whole = ezc3d.ezc3d.Parameter(name, "")  # add_parameter makes lists of floats
        whole.set(ezc3d.ezc3d.VecInt(numbers), shape)
        file["parameters"].add_parameter("FORCE_PLATFORM", whole)
    corners = np.array([[300, -200, 0], [-300, -200, 0], [-300, 200, 0], [300, 200, 0]], float)
    file.add_parameter("FORCE_PLATFORM", "CORNERS", corners.T[:, :, None])
    file.add_parameter("FORCE_PLATFORM", "ORIGIN", np.zeros((3, 1)))
    file["data"]["points"], file["data"]["analogs"] = points, forces[None]
    path = tmp_path_factory.mktemp("c3d") / "standing.c3d"
    file.write(str(path))
    return path, points, forces, centre


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
    monkeypatch.setattr(formats, "_READER", program)
    program.write_text("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    with pytest.raises(DataError, match="reading it ended the reader"):
        read_series(recording[0])
    program.write_text("import time; time.sleep(30)")
    with pytest.raises(DataError, match=r"takes more than 0.2 s"):
        formats.groups_of(recording[0], longest=0.2)


def test_the_reader_has_one_thread_of_blas(recording, tmp_path, monkeypatch):
    """On a machine of sixty processors their threads take more addresses than the reader may use."""
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "64")
    monkeypatch.setattr(formats, "_READER", tmp_path / "reader.py")
    program = "import os, sys; sys.stderr.write(os.environ['OPENBLAS_NUM_THREADS'] + ' thread'); sys.exit(3)"
    formats._READER.write_text(program)
    with pytest.raises(DataError, match="1 thread"):
        formats.groups_of(recording[0])


def test_without_ezc3d_one_line_says_so(tmp_path, monkeypatch):
    (tmp_path / "a.c3d").write_bytes(b"\0")
    monkeypatch.setattr(formats.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(DataError, match="ezc3d, which reads C3D, is not installed; `pip install ezc3d`"):
        read_series(tmp_path / "a.c3d")
