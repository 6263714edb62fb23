"""Every key of sweep files and of family files: another value gives another result, or is refused by name."""

import json
from copy import deepcopy
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from sweep_cases import PENDULUM

from icmj.errors import IcmjError, RunFileError
from icmj.fits.family import Family, Prior
from icmj.fits.family_file import FamilyFile
from icmj.runfile.sweep_tables import SweepFile
from icmj.study.chunk import compute
from icmj.study.sweep import make_plan

SHIPPED = PENDULUM.parents[1]
WORDS = {"name", "title", "unit", "source"}
"""Keys that say what something is called."""

SWEEP: dict[str, Any] = {
    "sweep": {"name": "keys", "run": str(PENDULUM), "samples": 2, "method": "sobol", "seed": 1},
    "vary": [
        {"field": "actual.gain", "low": 0.75, "high": 0.85},
        {"field": "controller.q_t", "low": 0.01, "high": 0.04, "count": 3, "spacing": "linear"},
        {"change": {"what": "mass", "of": "rod", "by": "factor"}, "values": [1.01]},
    ],
    "set": {"design": {"R_o": 0.02}},
}
OF_SWEEPS: dict[str, list[Any]] = {
    "sweep.run": [str(PENDULUM.with_name("neglected-0.1.toml"))],
    "sweep.samples": [4],
    "sweep.method": ["random"],
    "sweep.seed": [2],
    "sweep.chunk": [],
    "vary.0.field": ["controller.q_t2", "design.R_c"],
    "vary.0.low": [0.8],
    "vary.0.high": [0.9],
    "vary.0.spacing": ["log"],
    "vary.1.count": [4],
    "vary.1.spacing": ["log"],
    "vary.2.values": [[1.02]],
    "vary.2.change.what": ["inertia"],
    "vary.2.change.of": ["nothing", None],
    "vary.2.change.by": ["value"],
    "ask.motion": [["linear"]],
    "ask.cycle": [["linear"]],
    "ask.attractors": [2],
    "set": [{"design": {"R_o": 0.03}}, {"controller": {"q_t": 0.02}}, {"actual": {"gain": 0.9}}],
}
"""Other values of each key; of one with none, that it says how the work is cut into parts."""
FAMILY = "event"
OF_FAMILIES: dict[str, list[Any]] = {
    "family.run": ["runs/standing-switching.toml"],
    "family.set": [
        {"controller": {"order": 1}}, {"simulation": {"limit": 0.2}}, {"controller": {"q_t": 0.001}},
        {"simulation": {"duration": 20.0}}, {"simulation": {"record_interval": 0.02}},
    ],
    "pressure.weight": [700.0],
    "pressure.torque": [{"ankle_torque_act": 1.0, "lean": -770.0}],
    "parameter.0.keys": [{"assumed.A[1][0]": 0.011, "actual.A[1][0]": 0.011}],
    "parameter.0.prior.kind": ["log-uniform", "normal"],
    "parameter.0.prior.low": [40.0],
    "parameter.0.prior.high": [400.0],
    "parameter.0.prior.median": [100.0],
    "parameter.0.prior.deviation": [10.0],
    "parameter.1.prior": [{"kind": "log-normal", "median": 1e-5, "deviation": 1.0}],
}  # fmt: skip


def replaced(data: dict[str, Any], key: str, value: Any) -> dict[str, Any]:
    """The data with another value at this dotted place; without it for ``None``."""
    made: Any = deepcopy(data)
    *way, last = key.split(".")
    at = made
    for part in way:
        at = at[int(part)] if part.isdecimal() else at.setdefault(part, {})
    if value is None:
        at.pop(last)
    else:
        at[last] = value
    return made


def swept(data: dict[str, Any], path: Path) -> Any:
    """What comes out, by column, but for what tells how far off a motion is to the last bits."""
    plan = make_plan(SweepFile.validated(data, path))
    tables = [pq.read_table(BytesIO(compute(plan, plan.range(i)).content)) for i in range(plan.chunks)]
    return [table.to_pydict() for table in tables]


def explained(data: dict[str, Any], path: Path) -> Any:
    """The members in some places of the prior, with what makes a centre of pressure of their states."""
    file = FamilyFile.validated(data, path)
    family = Family(file, Prior(tuple(file.parameter)))
    theta = family.prior.from_normal(np.array([[-1.0], [0.3], [1.0]]) * np.ones(len(family.prior)))
    members = [family.member(each) for each in theta]
    told = [(one.run.model_dump(mode="json", exclude={"case"}), one.weights.tolist()) for one in members]
    return json.loads(json.dumps([theta.tolist(), told]))


def without_effect(result: Any, data: dict[str, Any], others: dict[str, list[Any]], path: Path) -> tuple[set[str], Any]:
    """Keys whose other values change nothing, and what was said of those that were refused."""
    first, none, refused = result(data, path), set(), {}
    assert repr(first) == repr(result(data, path))
    for key, values in others.items():
        for value in values:
            try:
                found = result(replaced(data, key, value), path)
            except (IcmjError, RunFileError) as error:
                refused[f"{key} = {value}"] = str(error)
                continue
            if repr(found) == repr(first):
                none.add(f"{key} = {value}")
    return none, refused


@pytest.mark.slow
def test_another_value_of_a_key_of_a_sweep_gives_other_points_or_is_refused(tmp_path):
    """``spacing`` beside values, a seed where nothing is drawn, and [set] of a field that varies had no effect."""
    none, refused = without_effect(swept, SWEEP, OF_SWEEPS, tmp_path / "sweep.toml")
    assert not none, f"without effect: {', '.join(sorted(none))}"
    assert any("set: actual.gain has no effect, as [[vary]] gives its values" in said for said in refused.values())


def test_what_a_sweep_does_not_use_is_refused(tmp_path):
    listed = replaced({**SWEEP, "sweep": {"name": "keys", "run": str(PENDULUM)}}, "vary.0.count", 2)
    for key, value, words in (
        ("sweep.seed", 2, "sweep.seed: nothing is drawn"),
        ("sweep.method", "random", "sweep.method: nothing is drawn"),
        ("vary.2.spacing", "log", "values have no spacing"),
        (
            "set",
            {"actual": {"gain": 0.9}},
            r"set: actual.gain has no effect, as \[\[vary\]\] gives its values; leave it out",
        ),
    ):
        with pytest.raises(RunFileError, match=words):
            SweepFile.validated(replaced(listed, key, value), tmp_path / "sweep.toml")


def test_another_value_of_a_key_of_a_family_gives_other_members_or_is_refused():
    """``family.set`` of a key that a parameter sets, and of the duration and the rows of trials, had no effect."""
    from icmj.runfile.reading import parse_toml

    path = SHIPPED / "families" / f"{FAMILY}.toml"
    data = parse_toml(path.read_text(encoding="utf-8"), path)
    none, refused = without_effect(explained, data, OF_FAMILIES, path.with_name("keys.toml"))  # beside its run file
    assert not none, f"without effect: {', '.join(sorted(none))}"
    for key, words in (
        ("'q_t'", "controller.q_t has no effect, as the parameter q_t sets it; leave it out"),
        ("'duration'", "simulation.duration has no effect, as trials have their own"),
        ("'record_interval'", "simulation.record_interval has no effect, as trials have their own"),
        ("prior.median", "a uniform prior has no median"),
        ("prior.deviation", "a uniform prior has no deviation"),
    ):
        assert any(key in given and words in said for given, said in refused.items()), (key, refused)


def test_every_key_is_a_word_or_is_tried():
    for kind, tried in ((SweepFile, OF_SWEEPS), (FamilyFile, OF_FAMILIES)):
        last = {part for key in tried for part in key.split(".") if not part.isdecimal()}
        assert keys_of(kind) - WORDS <= last | {"name"}


def keys_of(model: Any) -> set[str]:
    """Names of all keys of a file and of the tables in it."""
    from pydantic import BaseModel

    found: set[str] = set()
    for name, field in model.model_fields.items():
        found.add(name)
        kinds = [field.annotation, *getattr(field.annotation, "__args__", ())]
        kinds += [inner for kind in kinds for inner in getattr(kind, "__args__", ())]
        for kind in kinds:
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                found |= keys_of(kind)
    return found
