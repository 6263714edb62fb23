"""A branch in a recording: the same to the last bit, with the body on every cycle of it."""

from pathlib import Path

import numpy as np
import pytest
from cycle_cases import branch

from icmj.errors import LogError
from icmj.log.branch import read_branch_log, write_branch_log
from icmj.log.reader import read_summary


def test_it_comes_back_to_the_last_bit_and_the_body_is_on_every_cycle(tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    kept = branch("simple-1.7", "b", 1.5, plant="linear", points=8)
    path = tmp_path / "b.rrd"
    write_branch_log(kept, path)
    back = read_branch_log(path)
    for name in ("value", "intervals", "states", "multipliers", "t", "x", "qpos"):
        np.testing.assert_array_equal(getattr(back, name), getattr(kept, name))
    assert [special.words for special in back.specials] == [special.words for special in kept.specials]
    assert back.run.text == kept.run.text
    shown = RrdReader(path).store().summary()
    assert "/scene/true/rod" in shown
    assert "/diagram/here" in shown
    # every cycle plays for a second and a half at least
    assert read_summary(path)["outcome"]["time"] > 1.5 * len(kept)
    assert [p.name for p in tmp_path.iterdir()] == ["b.rrd"]


def test_another_recording_is_refused_in_a_line(tmp_path: Path) -> None:
    import rerun as rr

    recording = rr.RecordingStream("other")
    recording.save(tmp_path / "other.rrd")
    recording.log("a", rr.Scalars([1.0]), static=True)
    recording.disconnect()
    with pytest.raises(LogError, match="not of a branch"):
        read_branch_log(tmp_path / "other.rrd")
    with pytest.raises(LogError, match="no such log"):
        read_branch_log(tmp_path / "none.rrd")
