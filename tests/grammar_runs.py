"""Run files and sweep files made by a grammar: valid TOML, of values that contradict each other or go to extremes."""

import json
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from icmj.controller.hold import HOLDS
from icmj.plant.quality import Fault

ROOT = Path(__file__).resolve().parent.parent
FAULTS = get_args(Fault)


@dataclass(frozen=True)
class Names:
    """What a plant's parts are called, for run files that speak of them.

    Attributes:
        source: keys of a plant's table that name it.
        n: states; 0 where only icmj knows.
    """

    source: dict[str, Any]
    joints: Sequence[str]
    inputs: Sequence[str]
    outputs: Sequence[str]
    bodies: Sequence[str] = ()
    keyframes: Sequence[str] = ()
    n: int = 0

    @property
    def states(self) -> list[str]:
        return [*self.joints, *(f"{joint}_rate" for joint in self.joints)]


def shipped(rng: random.Random) -> Names:
    """One of the models that come with icmj."""
    three = (("ankle", "knee", "hip"), ("ankle_torque", "knee_torque", "hip_torque"), ("shank", "thigh", "trunk"))
    return rng.choices(
        (
            Names({"model": "pendulum.xml"}, ("hinge",), ("torque",), ("angle",), ("rod",), ("upright",), 2),
            Names({"model": "pendulum_neglected.xml"}, ("hinge",), ("torque",), ("angle",), ("rod",), ("upright",), 4),
            Names({"model": "three_link.xml"}, *three, three[2], ("upright",), 6),
            Names({"model": "three_link_floor.xml"}, *three, (*three[2], "foot"), ("upright",)),
        ),
        (6, 2, 3, 1),
    )[0]


def by_matrices(rng: random.Random) -> Names:
    """A plant by its matrices: chains of integrators, oscillators, rates far apart, parts that nothing reaches."""
    n, n_u, n_y = rng.randint(1, 5), rng.choice((1, 1, 2, 3)), rng.choice((1, 1, 2, 3))
    scale = rng.choice((1.0, 1.0, 1e-6, 1e6, 1e12))
    entry: Callable[[], float] = lambda: rng.choice((0.0, 1.0, -1.0, rng.gauss(0, 1), scale * rng.uniform(-1, 1)))  # noqa: E731
    kind = rng.randrange(4)
    if kind == 0:  # integrators
        A = [[float(j == i + 1) for j in range(n)] for i in range(n)]
    elif kind == 1:
        A = [[rng.choice((0.0, rng.gauss(0, 3), scale)) * (i == j) for j in range(n)] for i in range(n)]
    elif kind == 2:  # one entry far from the rest
        A = [[rng.gauss(0, 1) for _ in range(n)] for _ in range(n)]
        A[rng.randrange(n)][rng.randrange(n)] = number(rng)
    else:
        A = [[entry() for _ in range(n)] for _ in range(n)]
    B = [[entry() for _ in range(n_u)] for _ in range(n)]
    C = [[entry() for _ in range(n)] for _ in range(n_y)]
    source: dict[str, Any] = {"A": A, "B": B, "C": C}
    names: dict[str, list[str]] = {}
    for key, count, usual in (("states", n, "x"), ("inputs", n_u, "u"), ("outputs", n_y, "y")):
        names[key] = [f"{usual}{i}" for i in range(count)]
        if rng.random() < 0.4:
            names[key] = source[key] = [rng.choice((f"{key[0]} {i}", f"ζ{i}", f"y{i}", f"a.{i}")) for i in range(count)]
    if rng.random() < 0.2:
        units = rng.choice([*names["states"], *names["outputs"]]), rng.choice(("rad", "deg", "m", "%", "µV"))
        source["units"] = dict([units])
    return Names(source, names["states"], names["inputs"], names["outputs"], n=n)


def number(rng: random.Random, *usual: float, low: float = -1e12, high: float = 1e12) -> float:
    """A usual number, near one, or any at all between the two."""
    if usual and rng.random() < 0.8:
        value = rng.choice(usual) * rng.choice((1.0, 1.0, 1.0, rng.uniform(0.3, 3.0)))
    else:
        value = 10.0 ** rng.uniform(-15, 12) * rng.choice((1.0, 1.0, -1.0))
        value = rng.choice((value, value, low, high, 0.0, 1.0))
    return min(max(value, low), high)


def positive(rng: random.Random, *usual: float, low: float = 1e-15, high: float = 1e12) -> float:
    return number(rng, *usual, low=low, high=high)


def run_tables(rng: random.Random, names: Names, name: str = "case") -> dict[str, Any]:
    """The tables of a run file of this plant."""
    n = names.n or rng.randint(2, 8)
    tables = {
        "case": {"name": name, "title": rng.choice(("A case", "ζ [bold]x[/]", "", "'\"\\"))},
        "assumed": {**names.source, **_plant(rng, names)},
        "actual": _actual(rng, names),
        "design": _design(rng, names, n),
        "controller": _controller(rng, names, n),
        "analysis": {"delta_max": positive(rng, 3.0, 1.0, low=1e-6, high=1e4)},
        "simulation": _simulation(rng, names),
        "study": {"growth_points": rng.choice((0, 0, 0, 1, 2))},
    }
    if rng.random() < 0.5:
        tables["analysis"]["allow"] = rng.sample(FAULTS, rng.choice((1, 3, len(FAULTS))))
    if rng.random() < 0.12:
        duration = tables["simulation"]["duration"]
        tables["setpoint"] = [_setpoint(rng, names, duration) for _ in range(rng.choice((1, 1, 2)))]
    if tables["controller"].get("kind") in ("predictor", "switching") and rng.random() < 0.9:
        tables["assumed"]["delay"] = positive(rng, 0.2, 0.05)
    return tables


def _some(rng: random.Random, share: float, tables: dict[str, Callable[[], Any]]) -> dict[str, Any]:
    """A part of these keys."""
    return {key: make() for key, make in tables.items() if rng.random() < share}


def _order(rng: random.Random, names: Sequence[str]) -> list[str]:
    """Some of the names, mostly all, in any order."""
    return rng.sample(list(names), rng.choice((len(names), len(names), rng.randint(1, len(names)))))


def _activation(rng: random.Random, names: Names) -> dict[str, Any]:
    """Mostly a lag, sometimes keys that contradict each other."""
    each: Callable[..., Any] = lambda *usual: (  # noqa: E731
        positive(rng, *usual) if rng.random() < 0.7 else {rng.choice(names.inputs): positive(rng, *usual)}
    )
    order = rng.choice((1, 1, 2, 2, 0))
    found: dict[str, Any] = {"order": order}
    if order == 2 and rng.random() < 0.5:
        found["frequency"] = each(16.8, 10.0)
    elif order or rng.random() < 0.1:
        found["time_constant"] = each(0.05, 0.17)
    if rng.random() < (0.5 if order == 2 else 0.05):
        found["damping_ratio"] = each(0.99, 0.5)
    return found


def _plant(rng: random.Random, names: Names) -> dict[str, Any]:
    muscles = _some(rng, 0.12, {"activation": lambda: _activation(rng, names)})
    if "A" in names.source:
        return muscles | _some(rng, 0.2, {"delay": lambda: positive(rng, 0.1, 0.01, low=0.0)})
    keyframes = {"keyframe": rng.choice(names.keyframes)} if names.keyframes and rng.random() < 0.8 else {}
    few: dict[str, Callable[[], Any]] = {
        "operating_point": lambda: rng.choice(("as given", "static control", "balance")),
        "pose": lambda: {rng.choice(names.joints): number(rng, 0.1, 1.0, -0.5, 3.0)},
        "inputs": lambda: _order(rng, names.inputs),
        "outputs": lambda: rng.choice((_order(rng, names.outputs), "joints", _order(rng, names.joints))),
        "drop": lambda: [rng.choice(names.states)],
        "delay": lambda: positive(rng, 0.1, 0.05, 0.2, low=0.0),
        "person": lambda: {"height": positive(rng, 1.8), "mass": positive(rng, 80.0)},
    }
    found = keyframes | muscles | _some(rng, 0.08, few)
    if found.get("operating_point") == "balance" and rng.random() < 0.5:
        found["free"] = _order(rng, names.joints)
    return found


def _actual(rng: random.Random, names: Names) -> dict[str, Any]:
    several = rng.random() < 0.2
    gain = lambda: number(rng, 0.8, 0.9, 1.1, 1.2, 1.7)  # noqa: E731
    found: dict[str, Any] = {"gain": [gain() for _ in names.inputs] if several else gain()}
    more = {"rho": lambda: number(rng, 1.0, 0.5, 0.0), "delay": lambda: positive(rng, 0.1, 0.02, low=0.0)}
    found |= _some(rng, 0.1, more)
    found |= _some(rng, 0.12, {"activation": lambda: _activation(rng, names)})
    if "A" in names.source:
        if rng.random() < 0.2:
            found |= {letter: names.source[letter] for letter in "ABC"}
            found |= {key: names.source[key] for key in ("states", "inputs", "outputs") if key in names.source}
        return found
    if rng.random() < 0.3:
        found["change"] = [_change(rng, names) for _ in range(rng.choice((1, 1, 2, 5)))]
    return found


def _change(rng: random.Random, names: Names) -> dict[str, Any]:
    what, of = rng.choice(
        (
            *((what, names.bodies) for what in ("mass", "inertia", "centre_of_mass", "length")),
            *((what, names.joints) for what in ("stiffness", "damping", "armature")),
            *((what, names.inputs) for what in ("input_gain", "gainprm", "biasprm", "dynprm")),
            *((what, names.outputs) for what in ("sensor_gain", "sensor_bias")),
            ("gravity", ()),
        )
    )
    found: dict[str, Any] = {"what": what}
    if of and rng.random() < 0.8:
        found["of"] = rng.choice(list(of))
    if rng.random() < 0.6:
        return found | {"factor": number(rng, 0.5, 0.9, 1.1, 2.0)}
    several = what in ("centre_of_mass", "gravity", "gainprm", "biasprm", "dynprm") or rng.random() < 0.1
    value = [number(rng, 0.0, 1.0, -9.81) for _ in range(3)] if several else number(rng, 0.0, 1.0, 0.1)
    return found | {"value": value}


def _weight(rng: random.Random, n: int) -> Any:
    diagonal = [positive(rng, 1.0, 0.1, low=0.0) for _ in range(n)]
    if rng.random() < 0.5:
        return diagonal
    M = [[diagonal[i] * (i == j) for j in range(n)] for i in range(n)]
    if n > 1 and rng.random() < 0.5:
        M[0][1] = M[1][0] = number(rng, 0.1)
    return M


def _design(rng: random.Random, names: Names, n: int) -> dict[str, Any]:
    several = rng.random() < 0.1
    found = {"R_c": positive(rng, 0.1, 1.0, 5e-7), "R_o": positive(rng, 0.01, 1.0, 2e-7)}
    if several:
        found["R_c"] = [positive(rng, 0.1, 1.0) for _ in names.inputs]
    weights = {
        key: lambda usual=usual: rng.choice((usual, "identity", _weight(rng, n)))
        for key, usual in (("Q_c", "output"), ("Q_o", "input"))
    }
    found |= _some(rng, 0.15, weights)
    if rng.random() < 0.06:
        found = {"k": [[number(rng, 1.0, 5.0) for _ in range(n)] for _ in names.inputs]}
        if rng.random() < 0.5:
            found["L"] = [[number(rng, 1.0, 5.0) for _ in names.outputs] for _ in range(n)]
    return found


def _controller(rng: random.Random, names: Names, n: int) -> dict[str, Any]:
    if rng.random() < 0.1:
        outputs = list(names.outputs)
        found = {"kind": "switching", "position": rng.choice(outputs), "rate": rng.choice(outputs)}
        found |= {"P": number(rng, 1.0, 100.0), "D": number(rng, 0.1, 10.0)}
        if rng.random() < 0.3:
            pid = {"I": lambda: number(rng, 0.0, 10.0), "weight": lambda: number(rng, 0.5, 1.0)}
            pid |= {"force": lambda: rng.choice(outputs), "force_gain": lambda: number(rng, 0.0, 1e-3)}
            pid |= {"force_time": lambda: positive(rng, 10.0), "input": lambda: rng.choice(list(names.inputs))}
            return found | {"kind": "delayed-pid"} | _some(rng, 0.5, pid)
        keys = {"slope": lambda: number(rng, -0.4, 0.0), "dead_zone": lambda: positive(rng, 0.004, low=0.0)}
        found |= _some(rng, 0.6, keys | {"switches": lambda: rng.random() < 0.7})
        if rng.random() < 0.3:
            channel = {key: value for key, value in found.items() if key != "kind"}
            channels = [channel | {"input": rng.choice(list(names.inputs))} for _ in range(rng.randint(1, 3))]
            return {"kind": "switching", "channel": channels}
        return found
    if rng.random() < 0.06:
        return {"kind": "predictor"}
    if rng.random() < 0.02:
        return {"kind": "os:system", "parameters": {"command": "touch wrong"}}
    found: dict[str, Any] = _some(rng, 0.7, {"delta_min": lambda: positive(rng, 0.01, 0.001, 0.1, low=0.0)})
    found |= _some(rng, 0.1, {"sampling_delay": lambda: positive(rng, 0.1, 0.01, low=0.0)})
    if rng.random() < 0.3:
        found["hold"] = rng.choice((*HOLDS, "own"))
        if found["hold"] == "own":
            found["A_h"] = [[number(rng, 0.0, -1.0) for _ in range(n)] for _ in range(n)]
    if rng.random() < 0.25:
        on = rng.choice(("output", "state"))
        each = names.outputs if on == "output" else range(n)
        several = rng.random() < 0.5
        threshold = [positive(rng, 0.01) for _ in each] if several else positive(rng, 0.01, 1e-3)
        return found | {"rule": "box", "on": on, "threshold": threshold}
    found["q_t"] = positive(rng, 0.01, 1e-3, 0.1)
    return found | _some(rng, 0.15, {"Q_t": lambda: rng.choice(("output", "identity", _weight(rng, n)))})


def _simulation(rng: random.Random, names: Names) -> dict[str, Any]:
    duration = positive(rng, 1.0, 0.1, 5.0, 0.001, low=1e-6, high=1e9)
    found: dict[str, Any] = {"duration": duration}
    often = {
        "initial": lambda: {name: number(rng, 0.02, 0.1) for name in _order(rng, names.states)},
        "record_interval": lambda: positive(rng, 0.01, duration / 100, duration, low=1e-6 * duration),
        "limit": lambda: positive(rng, 1.0, 0.1),
        "disturbance": lambda: [_source(rng, names, duration) for _ in range(rng.choice((1, 1, 2, 4, 20)))],
    }
    seldom = {
        "observer": lambda: {rng.choice(names.states): number(rng, 0.02)},
        "integrator": lambda: rng.choice(("RK4", "Euler", "implicit", "implicitfast", "discrete")),
    }
    found |= _some(rng, 0.3, often)
    found |= _some(rng, 0.06, seldom)
    found.setdefault("initial", {names.states[0]: 0.02})
    if duration > 1e4:
        found.setdefault("record_interval", duration / rng.choice((1e2, 1e5, 1.9e6)))
    if rng.random() < 0.4:
        found["timestep"] = positive(rng, 0.005, 0.001, duration / 10, 1e-6)
    elif "integrator" not in found and rng.random() < 0.2:
        found["tolerance"] = positive(rng, 1e-8, 1e-6, 1e-3, 1e-12, low=1e-13, high=0.1)
    return found


def _source(rng: random.Random, names: Names, duration: float) -> dict[str, Any]:
    start = positive(rng, duration / 2, duration / 10, low=0.0)
    base = {"size": number(rng, 0.1, 1.0), **({"start": start} if rng.random() < 0.5 else {})}
    kinds = "impulse step noise bias noise gaussian sinusoids sines ternary os:system ramp sampled file"
    kind = rng.choice(kinds.split())
    on_input = kind in ("impulse", "step") or (kind != "bias" and rng.random() < 0.5)
    port = {"input": rng.choice(list(names.inputs))} if on_input else {"output": rng.choice(list(names.outputs))}
    if kind == "sinusoids":
        size = rng.choice((3, 3, 3, 5, 4))
        rows = [[number(rng, 0.1, 1.0), *(positive(rng, 5.0, 50.0) for _ in range(size - 1))] for _ in range(3)]
        return {"kind": kind, **port, "terms": rows}
    if kind == "os:system":  # never run: nobody allowed it
        return {"kind": kind, **port, "parameters": {"command": "false"}}
    found = {"kind": kind, **port, **base}
    if kind == "impulse":
        found["duration"] = positive(rng, 0.05, duration / 10, duration)
    if kind == "noise":
        found |= {"size": abs(found["size"]) or 0.1, "seed": rng.choice((0, 1, 2**63 - 1))}
        found[rng.choice(("bandwidth", "corner"))] = positive(rng, 1.0, 10.0, 0.1 / duration)
        if rng.random() < 0.2:
            found["terms"] = rng.choice((1, 2, 400, 2000))
    if kind == "sines":
        found["frequencies"] = [positive(rng, 0.1, 1.0, 10.0) for _ in range(rng.choice((1, 3, 30)))]
    if kind in ("sines", "ternary"):
        found.pop("start", None)
    if kind != "bias" and rng.random() < 0.1:
        for key in ("input", "output"):
            found.pop(key, None)
        found["surface"] = rng.choice(("translation", "tilt", "tilt", "turning"))
        keys = {"axis": lambda: rng.choice(([0, 1, 0], [0, 0, 0], [1e12, 0, 0])), "point": lambda: [0, 0, 1.0]}
        keys["vertical"] = lambda: {rng.choice(list(names.outputs)): number(rng, 0.5, 1.0)}
        found |= _some(rng, 0.5, keys)
    if kind == "ramp":
        found["duration"] = positive(rng, 0.05, 0.5, duration)
    if kind == "sampled":
        found.pop("size")
        found["values"] = [number(rng, 0.1, 1.0) for _ in range(rng.choice((1, 2, 50)))]
    if kind == "file":
        found |= {"file": rng.choice(("run.toml", "none.csv", "/dev/zero", "")), "column": rng.choice(("y", "t", ""))}
    if kind == "gaussian":
        found |= {"size": abs(found["size"]) or 0.1, "seed": rng.choice((0, 1, 2**63 - 1))}
        keys = {"corner": lambda: positive(rng, 1.0, 0.1), "interval": lambda: positive(rng, 0.01, duration / 100)}
        found |= _some(rng, 0.5, keys)
        if (on_input and rng.random() < 0.5) or rng.random() < 0.05:
            found |= {"share": positive(rng, 0.1, 1.0, 1e6)}
            if rng.random() < 0.9:
                del found["size"]
    return found


def _setpoint(rng: random.Random, names: Names, duration: float) -> dict[str, Any]:
    kind = rng.choice(("step", "pulse", "ramp", "sines", "ternary", "double-steps", "file"))
    found: dict[str, Any] = {"kind": kind, "size": number(rng, 0.01, 0.1)}
    if rng.random() < 0.8:
        found["output"] = rng.choice((*names.outputs, *names.states))
    else:
        found |= {"combination": {name: number(rng, 0.5, 1.0) for name in names.outputs}, "name": rng.choice(("r", ""))}
    if rng.random() < 0.7:
        found["start"] = positive(rng, duration / 2, duration / 10, low=0.0)
    if kind in ("pulse", "ramp"):
        found["duration"] = positive(rng, 0.1, duration / 10)
    if kind == "sines":
        found["frequencies"] = [positive(rng, 0.1, 1.0, 10.0) for _ in range(rng.choice((1, 3, 30)))]
    if kind == "double-steps":
        found["isi"] = [positive(rng, 0.1, 0.3, duration / 10) for _ in range(rng.choice((1, 3)))]
        keys = {
            "repetitions": lambda: rng.choice((1, 10, 10_000)),
            "recovery": lambda: [positive(rng, 0.5, duration), positive(rng, 0.5, duration)],
            "directions": lambda: rng.choice((["same"], ["reversal", "same"], ["same", "same"])),
            "seed": lambda: rng.choice((0, 1, 2**63 - 1)),
        }
        found |= _some(rng, 0.5, keys)
    if kind == "file":
        found |= {"file": rng.choice(("run.toml", "none.csv", "/dev/zero", "")), "column": rng.choice(("y", "t", ""))}
    if kind in ("ternary", "file") and rng.random() < 0.5:
        found["interval"] = positive(rng, 0.25, 0.01)
    return found


def toml(tables: dict[str, Any]) -> str:
    """TOML text of tables, the inner ones inline."""
    lines = []
    for key, value in tables.items():
        if isinstance(value, dict):
            lines += [f"[{key}]", *(f"{_key(k)} = {_value(v)}" for k, v in value.items())]
        else:
            for entry in value:
                lines += [f"[[{key}]]", *(f"{_key(k)} = {_value(v)}" for k, v in entry.items())]
    return "\n".join(lines) + "\n"


def _key(key: str) -> str:
    return json.dumps(key, ensure_ascii=False)


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    return json.dumps(value, ensure_ascii=False)


def _placed(rng: random.Random, folder: Path) -> Names:
    """A plant whose model, if it has one, lies in ``folder``."""
    names = by_matrices(rng) if rng.random() < 0.3 else shipped(rng)
    if (model := names.source.get("model")) is not None:
        (folder / model).write_bytes((ROOT / "models" / model).read_bytes())
    return names


def run_command(rng: random.Random, names: Names) -> list[str]:
    """A command to put ``case.toml`` to."""
    commands = ["analyse", "run", "run linear", "cycle", "cycle linear", "continue", "study"]
    command, *plant = rng.choices(commands, (6, 5, 3, 2, 2, 1, 0.1))[0].split()
    more = ["--plant", *plant] if plant else []
    if command == "analyse":
        return [command, "case.toml", *rng.choice(([], ["--json"]))]
    if command == "cycle":
        how = (*rng.choice(([], ["--json"])), *rng.choice(([], ["--start", "simulation"])))
        return [command, "case.toml", *more, *how]
    if command == "continue":
        of = ("b", "q_t", "delay", "rho", "delta_min", "simulation.timestep", f"mass:{[*names.bodies, 'x'][0]}")
        of_to = ["--parameter", rng.choice(of), "--to", str(number(rng, 0.7, 1.3, 0.1)), "--points", "5"]
        return [command, "case.toml", *of_to, "--plant", rng.choice(("linear", "mujoco")), "--out", "out"]
    return [command, "case.toml", *more, "--out", "out", *(["--jobs", "1"] if command == "study" else [])]


def grammar_run(rng: random.Random, folder: Path) -> list[str]:
    """A run file in ``folder``, and the command to put it to."""
    names = _placed(rng, folder)
    (folder / "case.toml").write_text(toml(run_tables(rng, names)), encoding="utf-8")
    return run_command(rng, names)


def grammar_sweep(rng: random.Random, folder: Path) -> list[str]:
    """A sweep file in ``folder``, and the command to put it to."""
    names, dry = _placed(rng, folder), rng.random() < 0.9
    tables = run_tables(rng, names) | {"simulation": {"duration": rng.choice((0.01, 0.3, 1.0))}}
    if rng.random() < 0.7:  # one of which some points can be computed
        tables = {"case": {"name": "case", "title": "A"}, "assumed": names.source, "controller": {"q_t": 0.01}} | {
            "actual": {"gain": 0.8}, "simulation": tables["simulation"], "design": {"R_c": 0.1, "R_o": 0.01}
        }  # fmt: skip
    (folder / "case.toml").write_text(toml(tables), encoding="utf-8")
    vary = [_vary(rng, names, dry, i) for i in range(rng.choice((1, 1, 2, 2, 3)))]
    sweep: dict[str, Any] = {"name": rng.choice(("s", "a.b-c", "0")), "run": "case.toml"}
    if any("values" not in one and "count" not in one for one in vary):
        sweep["samples"] = rng.choice((1, 7, 10**5, 10**9 if dry else 9)) if dry else rng.choice((1, 5))
        sweep["method"] = rng.choice(("random", "sobol"))
        sweep["seed"] = rng.choice((0, 2**63 - 1))
    sweep |= _some(rng, 0.3, {"chunk": lambda: rng.choice((1, 3, 100_000)), "title": lambda: "ζ [/]"})
    ask = {
        "motion": lambda: rng.choice((["linear"], ["mujoco"], ["linear", "mujoco"], ["linear", "linear"], [])),
        "cycle": lambda: rng.choice((["linear"], ["mujoco"])),
        "attractors": lambda: rng.choice((1, 3)),
    }
    whole = {"sweep": sweep, "vary": vary, "ask": _some(rng, 0.25, ask)}
    if rng.random() < 0.2:
        table = rng.choice(("simulation", "controller"))
        whole["set"] = {table: {rng.choice(("duration", "delta_min")): number(rng, 0.1)}}
    (folder / "sweep.toml").write_text(toml(whole), encoding="utf-8")
    return ["sweep", "sweep.toml", *(["--dry-run"] if dry else ["--jobs", "1"]), "--out", "out"]


def _vary(rng: random.Random, names: Names, dry: bool, index: int) -> dict[str, Any]:
    simple = {
        "actual.gain": (0.8, 1.2),
        "controller.q_t": (0.01, 0.1),
        "controller.delta_min": (0.0, 0.1),
        "assumed.delay": (0.0, 0.1),
        "actual.rho": (0.0, 1.0),
        "analysis.delta_max": (1.0, 3.0),
        "design.R_c": (0.1, 1.0),
        "simulation.duration": (0.1, 0.5),
        "simulation.timestep": (0.001, 0.005),
        f"simulation.initial.{names.states[0]}": (0.0, 0.1),
        "simulation.disturbance[0].size": (0.1, 1.0),
        "actual.change[0].factor": (0.5, 1.5),
    }
    field, usual = rng.choice(list(simple.items()))
    found: dict[str, Any] = {"field": field if rng.random() < 0.9 else [field, rng.choice(list(simple))]}
    if names.bodies and rng.random() < 0.15:
        of = rng.choice(list(names.bodies))
        found = {"change": {"what": "mass", "of": of, "by": rng.choice(("factor", "value"))}}
    if rng.random() < 0.6:
        odd = ("point", "status", "words", "predicted_delta_crit", "b")
        found["name"] = rng.choice((*[f"p{index}"] * 3, *odd))
    if rng.random() < 0.4:
        odd = ("output", "system-matched", True, [0.5], [0.8, 0.9], "", {"a": 1}, "nan")
        found["values"] = [rng.choice((number(rng, *usual), number(rng, *usual), rng.choice(odd))) for _ in range(3)]
        return found
    low, high = sorted((number(rng, *usual), number(rng, *usual)))
    found |= {"low": low, "high": high}
    if rng.random() < 0.7:
        found["count"] = rng.choice((2, 5, 1000, 100_000)) if dry else 2
    if low == high:
        found["high"] = low + 1
    return found | ({"spacing": "log"} if rng.random() < (0.3 if found["low"] > 0 else 0.02) else {})
