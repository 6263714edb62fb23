"""Every key of every kind of experiment in simulations: another value gives other trials or results, or is refused."""

import hashlib
from typing import Any

import pytest

import icmj
from icmj.errors import IcmjError
from icmj.study import experiment
from icmj.study.experiment_file import CaseTable, ExperimentFile, ExperimentTable
from icmj.study.kinds import KINDS

OF_RECORDINGS = {
    "intersection_point": {"angle", "force", "cop"},
    "quiet_standing": set(),
    "multisine": {"stimulus"},
    "perturbed_stance": {"stimulus", "response"},
    "double_step": {"target"},
}
"""Keys that name columns of a recording."""
WORDS = {"name", "title"}
"""Keys that say what something is called."""
BASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "quiet_standing": ({"run": "simple-0.8"}, {"settle": 1.0, "duration": 12.0}),
    "multisine": (
        {"run": "simple-0.8"},
        {"input": "torque", "amplitude": 0.1, "period": 2.0, "lines": [0.5, 1.0], "periods": 4, "settle": 1},
    ),
    "perturbed_stance": (
        {"run": "one-link-delayed-pd", "set": {"simulation": {"disturbance": [], "initial": {}}}},
        {
            "size": 0.0175, "interval": 0.02, "highest": 2.0, "periods": 2, "settle": 1, "axis_height": 0.06,
            "inertia": 60.0, "toppling": 588.6, "stiffness": 470.88, "damping": 4.0,
        },
    ),
    "double_step": (
        {"run": "simple-exact", "set": {"assumed": {"delay": 0.14}, "controller": {"delta_min": 0.35}}},
        {
            "combination": {"angle": 0.9}, "size": 0.02, "isi": [0.15, 0.25, 0.4, 0.8], "repetitions": 4,
            "recovery": [1.5, 2.0],
        },
    ),
    "intersection_point": ({"run": "quiet-standing"}, {"settle": 2.0, "duration": 8.0}),
}  # fmt: skip
OTHERS: dict[str, dict[str, Any]] = {
    "quiet_standing": {
        "duration": 10.0, "settle": 2.0, "rate": 50.0, "low_pass": 5.0, "columns": ["u.torque"], "measures": ["none"],
    },
    "multisine": {
        "input": "none", "setpoint": "angle", "amplitude": 0.2, "period": 4.0, "lines": [0.5, 1.5], "periods": 5,
        "settle": 2, "rate": 50.0, "response": "applied.torque",
    },
    "perturbed_stance": {
        "size": 0.03, "interval": 0.03, "highest": 1.5, "axis_height": 0.1, "vertical": {"lean": 0.3},
        "vertical_rate": {"lean_rate": 0.3}, "output": "none", "periods": 3, "settle": 2, "rate": 50.0,
        "inertia": 70.0, "toppling": 500.0, "stiffness": 400.0, "damping": 10.0,
    },
    "double_step": {
        "output": "angle", "combination": {"angle": 0.8}, "unit": "m", "size": 0.03, "isi": [0.15, 0.3, 0.4, 0.8],
        "repetitions": 3, "directions": ["same"], "recovery": [1.5, 2.5], "rate": 50.0, "latest": 0.5, "shortest": 0.2,
        "control": "y.angle",
    },
    "intersection_point": {
        "duration": 9.0, "settle": 3.0, "rate": 50.0, "window": 2.56, "low": 0.8, "high": 6.0, "axis": "y",
        "height": 0.9,
    },
}  # fmt: skip
OF_THE_FRAME: dict[str, list[Any]] = {
    "experiment.plants": [["linear", "mujoco"]],
    "experiment.repetitions": [2],
    "experiment.seed": [1],
    "case.run": ["simple-1.2"],
    "case.control": ["continuous", "clock"],
    "case.interval": [0.1],
    "case.set": [{"controller": {"q_t": 0.02}}],
}


@pytest.fixture(autouse=True)
def no_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figure and page are of the numbers, which are compared; drawing them would be most of the time."""
    monkeypatch.setattr(experiment, "_draw", lambda *_: None)
    monkeypatch.setattr(experiment, "experiment_page", lambda *_: "")


def carry_out(kind: str, changes: dict[str, Any], path) -> dict[str, str]:
    """The digests of trials and results; ``changes`` are by table and key."""
    case, table = BASES[kind]
    tables = {"experiment": {"name": "keys", "plants": ["linear"], "seed": 3}, "case": dict(case), kind: dict(table)}
    for key, value in changes.items():
        of, _, name = key.partition(".")
        tables[of][name] = value
    file = ExperimentFile.validated({**tables, "case": [tables["case"]]}, path / "keys.toml")
    folder = path / f"out{sum(1 for _ in path.iterdir())}"
    icmj.run_experiment(file, folder, jobs=1)
    if not changes:
        assert '"told": true' in (folder / "summary.json").read_text(encoding="utf-8")
    kept = [*sorted((folder / "trials").iterdir()), folder / "results.parquet", folder / "summary.json"]
    return {one.name: hashlib.sha256(one.read_bytes()).hexdigest() for one in kept}


def find_idle(kind: str, others: dict[str, tuple[str, Any]], path) -> tuple[set[str], dict[str, str]]:
    """Of changes by name, each a key and its other value, those that do nothing, and what was said of those refused."""
    first, idle, refused = carry_out(kind, {}, path), set[str](), dict[str, str]()
    assert first == carry_out(kind, {}, path)
    for name, (key, value) in others.items():
        try:
            if carry_out(kind, {key: value}, path) == first:
                idle.add(name)
        except IcmjError as error:
            refused[name] = str(error)
    return idle, refused


@pytest.mark.slow
@pytest.mark.parametrize("kind", sorted(KINDS.names))
def test_another_value_of_a_key_gives_other_trials_or_results_or_is_refused_by_name(kind, tmp_path):
    others = {key: (f"{kind}.{key}", value) for key, value in OTHERS[kind].items()}
    idle, refused = find_idle(kind, others, tmp_path)
    assert not idle, f"without effect: {', '.join(sorted(idle))}"
    assert all(key in said or "none'" in said for key, said in refused.items()), refused


@pytest.mark.slow
def test_so_does_one_of_the_frame(tmp_path):
    others = {f"{key} = {value}": (key, value) for key, each in OF_THE_FRAME.items() for value in each}
    idle, refused = find_idle("multisine", others, tmp_path)  # whose phases are drawn
    assert not idle, f"without effect: {', '.join(sorted(idle))}"
    assert all("interval" in said for said in refused.values()), refused


@pytest.mark.parametrize("kind", sorted(KINDS.names))
def test_every_key_is_one_of_recordings_or_is_tried(kind):
    fields = ExperimentFile.model_fields[kind].annotation.__args__[0].model_fields
    assert fields.keys() == OF_RECORDINGS[kind] | OTHERS[kind].keys()
    known = {"experiment": ExperimentTable, "case": CaseTable}
    keys = {f"{table}.{key}" for table, of in known.items() for key in of.model_fields if key not in WORDS}
    assert keys == OF_THE_FRAME.keys()
