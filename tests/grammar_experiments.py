"""Experiment files made by a grammar: valid TOML, of values that contradict each other or go to extremes."""

import random
from pathlib import Path
from typing import Any

import grammar_runs as runs
import numpy as np
from grammar_runs import Names, number, run_tables, toml

KINDS = ("intersection_point", "quiet_standing", "multisine", "double_step", "perturbed_stance")
_THREE = ("shank", "thigh", "trunk")
SHIPPED = {
    "quiet-standing": Names({}, ("ankle", "knee", "hip"), ("ankle_torque", "knee_torque", "hip_torque"), _THREE),
    "simple-exact": Names({}, ("hinge",), ("torque",), ("angle",)),
    "joystick-1": Names({}, ("dot",), ("joystick",), ("dot",)),
    "one-link-switching": Names({}, ("ankle",), ("ankle_torque",), ("lean", "lean_rate")),
}


def grammar_experiment(rng: random.Random, folder: Path) -> list[str]:
    """An experiment file in ``folder``, and the command to put it to: with recordings, now and then."""
    usual = rng.random() < 0.7  # one of which all but a number or two can be carried out
    if usual:
        run = rng.choice(list(SHIPPED))
        names = SHIPPED[run]
    else:
        run, names = "case.toml", runs._placed(rng, folder)
        (folder / "case.toml").write_text(toml(run_tables(rng, names)), encoding="utf-8")
    given = rng.choices(KINDS, (2, 2, 3, 3, 2), k=rng.choice((1, 1, 1, 1, 1, 1, 0, 2)))
    tables: dict[str, Any] = {"experiment": _experiment(rng)}
    tables |= {kind: _KINDS[kind](rng, names) for kind in given}
    tables["case"] = [_case(rng, run, usual) for _ in range(1 if usual else rng.choice((1, 1, 2, 3)))]
    (folder / "experiment.toml").write_text(toml(tables), encoding="utf-8")
    more = ["--recording", _recording(rng, folder)] if rng.random() < 0.35 else []
    return ["experiment", "experiment.toml", *more, "--jobs", "1", "--out", "out", *rng.choice(([], ["--json"]))]


def _experiment(rng: random.Random) -> dict[str, Any]:
    found = {"name": rng.choice(("e", "a.b-c", "..", "")), "plants": rng.choice((["linear"], ["mujoco"], [], ["x"]))}
    if rng.random() < 0.8:
        found |= {"name": "e", "plants": rng.choice((["linear"], ["linear"], ["mujoco"], ["linear", "mujoco"]))}
    keys = {"repetitions": lambda: rng.choice((1, 2, 0, 100_000)), "seed": lambda: rng.choice((0, 2**62, 2**63, -1))}
    return found | _some(rng, 0.2, keys | {"title": lambda: rng.choice(("ζ [/]", "", "\u202e"))})


def _case(rng: random.Random, run: str, usual: bool) -> dict[str, Any]:
    found: dict[str, Any] = {"run": run if usual else rng.choice((run, *SHIPPED, "no-such"))}
    keys = {
        "name": lambda: rng.choice(("a", "b", "c", "a/b", "")),
        "title": lambda: "[bold]",
        "control": lambda: rng.choice(("own", "continuous", "clock", "x")),
        "interval": lambda: positive(rng, 0.3, 0.01),
        "set": lambda: rng.choice(
            (
                {"simulation": {"duration": positive(rng, 1.0)}},
                {"controller": {"q_t": number(rng, 0.01), "sampling_delay": number(rng, 0.1)}},
                {"controller.q_t": 1.0},
                {"assumed": {"delay": positive(rng, 0.1)}},
                {},
            )
        ),
    }
    return found | _some(rng, 0.05 if usual else 0.25, keys)


def positive(rng: random.Random, *usual: float, low: float = 1e-15) -> float:
    return rng.choice(usual) if rng.random() < 0.85 else runs.positive(rng, *usual, low=low)


def _some(rng: random.Random, chance: float, keys: dict[str, Any]) -> dict[str, Any]:
    return runs._some(rng, chance * rng.choice((0.3, 1.0)), keys)


def _timed(rng: random.Random) -> dict[str, Any]:
    keys = {"settle": lambda: positive(rng, 0.5, low=0.0), "rate": lambda: positive(rng, 100.0, 50.0, 1e5, low=1.0)}
    return {"duration": positive(rng, 3.0, 6.0, 20.0)} | {"settle": 0.5} | _some(rng, 0.3, keys)


def _intersection(rng: random.Random, _: Names) -> dict[str, Any]:
    keys = {
        "window": lambda: positive(rng, 1.0, 5.12),
        "low": lambda: positive(rng, 0.4, 1.0),
        "high": lambda: positive(rng, 8.0, 0.3),
        "axis": lambda: rng.choice(("x", "y", "z")),
        "height": lambda: positive(rng, 1.0),
        "force": lambda: rng.choice((["force.x", "force.z"], ["a", "a"], ["t", "b"])),
    }
    return _timed(rng) | _some(rng, 0.25, keys)


def _quiet(rng: random.Random, names: Names) -> dict[str, Any]:
    columns = [f"y.{name}" for name in names.outputs] + ["cop.x", "u.x", "", "t"]
    keys = {
        "low_pass": lambda: positive(rng, 10.0, 60.0),
        "columns": lambda: rng.choices(columns, k=rng.choice((1, 2, 3))),
    }
    return _timed(rng) | _some(rng, 0.4, keys)


def _multisine(rng: random.Random, names: Names) -> dict[str, Any]:
    period = positive(rng, 2.0, 5.0, 10.0)
    if rng.random() < 0.85:
        period = rng.choice((1.0, 2.0, 5.0))
    lines = [k / period for k in rng.sample(range(1, 40), rng.choice((1, 3, 10)))]
    if rng.random() < 0.2:
        lines = [positive(rng, 0.1, 1.0, 49.9) for _ in range(3)]
    on = {"input": names.inputs[0]} if rng.random() < 0.5 else {"setpoint": names.outputs[0]}
    if rng.random() < 0.1:
        on = {rng.choice(("input", "setpoint")): rng.choice((*names.inputs, *names.outputs))}
    keys = {
        "periods": lambda: rng.choice((2, 3, 10_000)),
        "settle": lambda: rng.choice((0, 1, 10_000)),
        "rate": lambda: positive(rng, 100.0, 20.0, low=1.0),
        "response": lambda: rng.choice((f"u.{names.inputs[0]}", f"y.{names.outputs[0]}", "stimulus", "x", "")),
        "setpoint": lambda: names.outputs[0],
    }
    found = {**on, "amplitude": positive(rng, 0.1, 1.0), "period": period, "lines": lines, "periods": 3, "settle": 1}
    return found | _some(rng, 0.2, keys)


def _double(rng: random.Random, names: Names) -> dict[str, Any]:
    recovery = sorted((positive(rng, 1.5), positive(rng, 2.0))) if rng.random() < 0.3 else [1.5, 2.0]
    found = {
        "output": names.outputs[0] if rng.random() < 0.7 else rng.choice((*names.outputs, *names.states)),
        "size": positive(rng, 0.02, 1.0),
        "isi": rng.choice(([0.1, 0.3, 0.6], [0.1, 0.2, 0.3, 0.5], [positive(rng, 0.1, 0.3) for _ in range(3)])),
        "recovery": recovery,
        "repetitions": rng.choice((1, 1, 2, 2, 2, 10_000)),
    }
    if rng.random() < 0.15:
        found |= {"combination": {name: number(rng, 0.5) for name in names.outputs}, "unit": rng.choice(("m", ""))}
        found.pop(rng.choice(("output", "size")), None)
    keys = {
        "directions": lambda: rng.choice((["same"], ["reversal"], ["same", "same"], [])),
        "rate": lambda: positive(rng, 100.0, 20.0, low=1.0),
        "latest": lambda: positive(rng, 1.0, 0.05),
        "shortest": lambda: positive(rng, 0.15, low=0.0),
        "control": lambda: rng.choice((f"u.{names.inputs[0]}", "x", "target")),
    }
    return found | _some(rng, 0.2, keys)


def _stance(rng: random.Random, names: Names) -> dict[str, Any]:
    keys = {
        "highest": lambda: positive(rng, 1.0, 2.0, 60.0, 1e-3),
        "axis_height": lambda: positive(rng, 0.06, low=0.0),
        "vertical": lambda: {rng.choice(list(names.outputs)): number(rng, 0.3, 1.0)},
        "vertical_rate": lambda: {rng.choice(list(names.outputs)): number(rng, 0.3, 1.0)},
        "output": lambda: rng.choice((*names.outputs, "head")),
        "inertia": lambda: positive(rng, 60.0),
        "toppling": lambda: positive(rng, 600.0),
    }
    found = {"size": positive(rng, 0.01, 0.1), "interval": rng.choice((0.25, 0.01, 0.02)), "periods": 2, "settle": 0}
    return found | _some(rng, 0.4, keys)


_KINDS = dict(zip(KINDS, (_intersection, _quiet, _multisine, _double, _stance), strict=True))


def _recording(rng: random.Random, folder: Path) -> str:
    """A recording with some of the columns that are asked for, and values that are hardly any."""
    rows, step = rng.choice((3, 200, 3000, 3000)), rng.choice((0.01, 0.01, 1e-9, 1e6))
    columns = ["force.x", "force.z", "cop.x", "stimulus", "x", "target", "control"]
    kept = [name for name in columns if rng.random() < 0.85] or ["x"]
    unit = {"cop.x": "m", "force.x": "N", "force.z": "N", "target": "rad"}
    heads = [f"{name} [{unit.get(name, '1')}]" if rng.random() < 0.9 else name for name in kept]
    draw = np.random.default_rng(rng.randrange(2**32))
    values = draw.standard_normal((rows, len(kept))) * 10.0 ** rng.choice((0, 0, 0, 300, -300))
    if rng.random() < 0.5 and "target" in kept:  # steps
        values[:, kept.index("target")] = np.cumsum(draw.random(rows) < 0.01) % 2
    if rng.random() < 0.2:
        values[rng.randrange(rows)] = rng.choice((np.nan, np.inf, 0.0))
    if rng.random() < 0.1:
        values[:] = 1.0
    text = "\n".join(
        [",".join(["t [s]", *heads])]
        + [",".join([f"{i * step:.12g}", *(f"{value:.9g}" for value in row)]) for i, row in enumerate(values)]
    )
    (folder / "recording.csv").write_text(text + "\n", encoding="utf-8")
    return "recording.csv"
