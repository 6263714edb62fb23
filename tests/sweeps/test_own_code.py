"""Sweeps of a case whose code is the user's own: run if asked, by every process from the same source."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

import icmj
from icmj.cli.main import main
from icmj.errors import SweepError
from icmj.study.chunk import compute
from icmj.study.sweep import carry_out, make_plan

RULES = """
import numpy as np
import icmj

class Own(icmj.BoxTrigger):
    pass

def spread(simulation):
    return {"spread [s]": np.ptp(simulation.events.interval)}
"""
RUN = """
[case]
name = "own"
title = "Own"
[assumed]
model = "{model}"
keyframe = "upright"
[actual]
gain = 0.8
[design]
R_c = 0.1
R_o = 0.01
[controller]
{rule}
delta_min = 0.02
[simulation]
duration = 6.0
initial = {{ hinge = 0.02 }}
[study]
measures = ["rules:spread"]
"""
BOX = 'rule = "box"\nthreshold = 0.01'
SWEEP = """
[sweep]
name = "own"
run = "own.toml"
chunk = 2
[[vary]]
field = "actual.gain"
name = "b"
values = [0.7, 0.8, 0.9, 0.95]
[ask]
motion = ["linear"]
"""


@pytest.fixture
def folder(tmp_path: Path, root: Path) -> Path:
    (tmp_path / "rules.py").write_text(RULES, encoding="utf-8")
    model = (root / "models" / "pendulum.xml").as_posix()
    for name, rule in (("own", 'rule = "rules:Own"\nparameters = { threshold = 0.01 }'), ("box", BOX)):
        (tmp_path / f"{name}.toml").write_text(RUN.format(model=model, rule=rule), encoding="utf-8")
        (tmp_path / f"{name}-sweep.toml").write_text(SWEEP.replace("own.toml", f"{name}.toml"), encoding="utf-8")
    return tmp_path


@pytest.mark.slow
def test_two_processes_run_the_code_of_a_file(folder: Path) -> None:
    """A class that is the box in another file gives the rows of the box, and its measure what the runs say."""
    out = folder / "out"
    assert main(["sweep", str(folder / "own-sweep.toml"), "--out", str(out), "--jobs", "2", "--allow-code"]) == 0
    rows = icmj.read_sweep(out).table.to_pylist()
    box = icmj.sweep(folder / "box-sweep.toml", jobs=1, allow_code=True).to_pylist()
    assert rows == box
    assert [row["status"] for row in rows] == ["ok"] * 4
    run = icmj.load_run(folder / "own.toml", allow_code=True)
    alone = icmj.simulate(icmj.prepare(run), "linear")
    assert rows[1]["linear_measure_spread [s]"] == np.ptp(alone.events.interval)
    told = json.loads((out / "sweep.json").read_text(encoding="utf-8"))
    digest = hashlib.sha256((folder / "rules.py").read_bytes()).hexdigest()
    assert told["code"] == {"rules:Own": digest, "rules:spread": digest}
    assert "linear_measure_spread [s]" in told["columns"]


@pytest.mark.slow
def test_another_source_is_another_sweep(folder: Path) -> None:
    out, file = folder / "out", folder / "own-sweep.toml"
    plan = make_plan(file, allow_code=True)
    carry_out(plan, out, jobs=1)
    (folder / "rules.py").write_text(RULES + "\n# changed\n", encoding="utf-8")
    with pytest.raises(SweepError, match=r"rules:\w+: its source is not the one with which the sweep began"):
        compute(plan, range(1))
    with pytest.raises(SweepError, match="another sweep file, run file, model or code"):
        carry_out(make_plan(file, allow_code=True), out, jobs=1)


def test_code_is_not_run_unasked(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sweep", str(folder / "own-sweep.toml"), "--out", str(folder / "out")]) == 2
    assert "rules:Own names Python code, which is not run unasked" in capsys.readouterr().err
    assert main(["sweep", str(folder / "box-sweep.toml"), "--out", str(folder / "out")]) == 2
    assert "rules:spread names Python code, which is not run unasked" in capsys.readouterr().err
    assert not (folder / "out").exists()
