"""Reading back: bit-exact, and every kind of broken file refused in one line."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from log_cases import assert_same, awkward, made_up, standing, with_scene
from patience import PATIENCE

from icmj.case.comparison import compare, to_json
from icmj.errors import LogError
from icmj.log import program, reader
from icmj.log.reader import read_log, read_summary
from icmj.log.writer import write_log


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "case.rrd"
    write_log(with_scene(*made_up(duration=3.0)), path)
    return path


def refused(path: Path) -> str:
    with pytest.raises(LogError, match=re.escape(str(path))) as caught:
        read_log(path)
    return str(caught.value)


def test_a_result_comes_back_bit_for_bit(tmp_path: Path) -> None:
    result = awkward()
    write_log(result, tmp_path / "x.rrd")
    assert_same(result, read_log(tmp_path / "x.rrd"))


def test_the_summary_holds_the_numbers_in_full(log: Path) -> None:
    result, facts = read_log(log), read_summary(log)
    assert facts["predicted"]["delta_crit"] == result.prediction.delta_crit
    assert facts["predicted"]["gamma"] == result.prediction.gamma
    assert facts["measured"]["interval"] == result.measurement.interval
    assert facts["measured"]["amplitude_angle"] == result.measurement.amplitude[0]
    simulation = result.simulation
    counted = {"rows": len(simulation.t), "events": len(simulation.events)}
    assert facts["case"] | {"name": "made-up", "plant": "linear", **counted} == facts["case"]
    assert facts["outcome"]["kind"] == "completed"
    assert facts["precision"]["event_tolerance"] == 1e-13
    assert facts["provenance"] == {"icmj": "0.1.0", "git": "0123abc"}
    assert facts["run_file"] == {"path": "runs/made-up.toml", "text": result.run.text}


def test_a_log_cut_anywhere_is_refused(log: Path, tmp_path: Path) -> None:
    whole, cut = log.read_bytes(), tmp_path / "cut.rrd"
    for part in (0.001, 0.1, 0.5, 0.9, 0.999):
        cut.write_bytes(whole[: int(part * len(whole))])
        assert "not a complete rerun recording" in refused(cut)
    cut.write_bytes(whole[:-1])
    assert "not a complete rerun recording" in refused(cut)


def test_files_that_are_no_recording_are_refused(tmp_path: Path) -> None:
    for name, content in (("empty", b""), ("text", b"no recording\n" * 100), ("stub", b"RRF2")):
        path = tmp_path / name
        path.write_bytes(content)
        refused(path)
    assert "no such log" in refused(tmp_path / "nowhere.rrd")
    assert "no such log" in refused(tmp_path)


def test_a_recording_of_something_else_is_refused(tmp_path: Path) -> None:
    import rerun as rr

    path = tmp_path / "other.rrd"
    recording = rr.RecordingStream("other")
    recording.save(path)
    recording.log("a", rr.TextDocument("b"), static=True)
    recording.flush()
    recording.disconnect()
    assert "not a log of icmj" in refused(path)
    with pytest.raises(LogError, match="not a log of icmj"):
        read_summary(path)


def test_a_flipped_bit_is_seen_or_harmless(log: Path, tmp_path: Path) -> None:
    """Wherever it falls: the numbers read are the numbers written, or there are none."""
    whole, flipped = bytearray(log.read_bytes()), tmp_path / "flipped.rrd"
    result, rng, seen = read_log(log), np.random.default_rng(3), 0
    for place in rng.integers(0, len(whole), 40):
        bit = 1 << int(rng.integers(8))
        whole[place] ^= bit
        flipped.write_bytes(whole)
        whole[place] ^= bit
        try:
            assert_same(result, read_log(flipped))
        except LogError:
            seen += 1
    assert seen > 5


def test_a_zero_byte_in_a_name_ends_nothing(log: Path, tmp_path: Path) -> None:
    """rerun's own check passes such a file, and its reader aborts the process; so another one reads here."""
    whole = log.read_bytes()
    places = [at for at in range(len(whole)) if whole.startswith(b"icmj:", at)]
    for i, at in enumerate(places):
        (tmp_path / f"{i}.rrd").write_bytes(whole[: at + 5] + b"\0" + whole[at + 6 :])
    script = """
import sys
from icmj.errors import LogError
from icmj.log.reader import read_log
for path in sys.argv[1:]:
    try:
        read_log(path)
    except LogError as error:
        print(error)
"""
    command = [sys.executable, "-c", script, *(str(tmp_path / f"{i}.rrd") for i in range(len(places)))]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr[-500:]
    assert "a name in it has a zero byte" in done.stdout


def test_the_archive_knows_when_it_has_changed(log: Path, tmp_path: Path) -> None:
    content, changed = bytearray(log.read_bytes()), tmp_path / "changed.rrd"
    numbers = read_log(log).simulation.x.tobytes()
    places = [content.find(numbers[i : i + 24]) for i in range(0, 4000, 8)]  # stored as they are, where LZ4 sees no use
    content[min(place for place in places if place > 0)] ^= 1  # the archive comes before the series
    changed.write_bytes(content)
    assert "SHA-256" in refused(changed)


def test_a_newer_format_is_named(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("icmj.log.reader.FORMAT", 0)
    assert "log format 1, this version of icmj reads 0" in refused(log)


def test_the_summary_tells_of_the_ground_s_reaction(tmp_path: Path) -> None:
    result = standing()
    pressure = result.simulation.pressure
    assert pressure is not None
    write_log(result, tmp_path / "x.rrd")
    facts = read_summary(tmp_path / "x.rrd")["pressure"]
    assert facts == dict(pressure.facts)
    assert facts["unloading"] == 1.0
    assert facts["x_least"] == -0.07
    assert pressure.words == (
        f"centre of pressure, x: -70 to {1e3 * pressure.centre[:, 0].max():.3g} mm, at rest 55 mm",
        "what stands on the ground (heel, toe) lifts for a moment",
    )
    assert to_json(compare(result))["pressure"] == facts
    assert "pressure" not in to_json(compare(made_up(duration=20.0)[0]))


def test_a_log_that_is_replaced_while_it_is_read_is_read_again(log, tmp_path, monkeypatch):
    """Two studies in one folder: one read what the other had just replaced, and called it damaged."""
    path, other = tmp_path / "log.rrd", tmp_path / "other.rrd"
    for copy in (path, other):
        copy.write_bytes(log.read_bytes())
    calls, real = [], program.verify

    def replaced(there):
        calls.append(there)
        if len(calls) == 1:
            other.replace(path)
            return "half of another"
        return real(there)

    monkeypatch.setattr(reader, "verify", replaced)
    assert reader.read_summary(path)["case"]
    monkeypatch.setattr(reader, "verify", lambda there: "half of another")
    with pytest.raises(LogError, match="not a complete rerun recording"):
        reader.read_summary(path)


def test_a_part_of_a_log_is_refused_and_a_compacted_one_is_whole(log, tmp_path):
    """Its archive is whole, so that half a run was measured as all of it."""

    def rrd(*words):
        subprocess.run([program.find_program(), "rrd", *map(str, words)], check=True, capture_output=True)

    rows = len(read_log(log).simulation.t)
    (tmp_path / "parts").mkdir()
    rrd("split", "--output-dir", tmp_path / "parts", "--timeline", "time", "--num-parts", 3, log)
    parts = sorted((tmp_path / "parts").glob("*.rrd"))
    assert len(parts) == 3
    told = [
        re.search(r"has (\d+) of the (\d+) rows of its run, as what `rerun rrd split` makes", refused(p)) for p in parts
    ]
    assert all(int(one[1]) < int(one[2]) == rows for one in told)
    rrd("optimize", "-o", tmp_path / "small.rrd", log)
    assert_same(read_log(log), read_log(tmp_path / "small.rrd"))
