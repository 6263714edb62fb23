"""Kinks of the plant's response along the predicted motion, where the linear theory does not hold.

The engine is asked for its rates and outputs at states and inputs of the motion. The limits that a model can have are
lifted on a copy: where that changes the answer, one of them acts, and each imposed by itself says which. With these
lifted, the way from rest to a state is followed in ever finer steps: what is smooth changes its slope less from step to
step, a corner (a contact made or lost, a muscle that cannot pull less) by as much in however small a step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.bounds import SORTS, Bound, impose, name_of, sort_bounds
from icmj.engine.dynamics import Dynamics
from icmj.engine.isolation import isolate_engine
from icmj.engine.model import name_inputs
from icmj.engine.plant import MujocoPlant
from icmj.plant.quality import BENT, Notice

_SAMPLES = 64  # of a motion, beside those where a signal is largest
_SAME = 1e-6  # of the size of an answer: a change that no limit makes
_SLIGHT = 5e-4  # of the size of an answer: a departure from the linear one that hides no corner
_SMALL = 1e-3  # of the size of the largest answer of its kind: one that is taken to be as large
_WAYS = 16  # from rest that are followed
_LEAP = 1e-4  # of the size of an answer: what is no rounding
_CELLS, _FINER, _DEPTH = 16, 4, 4  # cells of the way from rest; into how many a cell is cut, and how often
_END = "; the linear theory knows no limits"


@isolate_engine()
def find_corners(plant: MujocoPlant, x: Array, u: Array) -> tuple[Notice, ...]:
    """The corners on a motion that the linear theory predicts: each limit that acts, and one that no limit explains.

    Args:
        plant: the plant.
        x, u: states and inputs of the motion, departures from rest, shapes (N, n), (N, n_u).
    """
    return tuple(_corners(plant, x, u))


def _corners(plant: MujocoPlant, x: Array, u: Array) -> Iterator[Notice]:
    signals = np.hstack([x, u, x @ plant.linearisation.plant.C.T])
    if not np.isfinite(signals).all():
        return
    even = np.linspace(0, len(x) - 1, _SAMPLES).astype(int)
    few = np.unique(np.concatenate([even, signals.argmax(axis=0), signals.argmin(axis=0)]))
    engine, x, u = Dynamics(plant), x[few], u[few]
    try:
        ports = plant.linearisation.ports
        # those that act at rest are in the linearisation, and are told with it
        limits = sort_bounds(plant.model, plant.linearisation.point, ports.states, ports.entries)[0]
        yield from (_notice(plant, limit, x, u) for limit in _acting(engine, limits, x, u))
        yield from _yielding(engine, x, u)
        impose(engine.model, plant.model, limits)
        yield from _elsewhere(engine, x, u)
    except mujoco.FatalError as error:
        yield Notice(
            "not linear", "warning", f"the engine gives up on the predicted orbit: {' '.join(str(error).split())}"
        )


def _answers(engine: Dynamics, x: Array, u: Array) -> Array:
    """ẋ and y, shape (N, n + n_y)."""
    return np.array([np.concatenate(engine(*at)) for at in zip(x, u, strict=True)])


def _at_rest(engine: Dynamics) -> Array:
    plant = engine.plant.linearisation.plant
    return _answers(engine, np.zeros((1, plant.n)), np.zeros((1, plant.n_u)))[0]


def _acting(engine: Dynamics, limits: Sequence[Bound], x: Array, u: Array) -> Iterator[Bound]:
    """The ``limits`` that change the rates or outputs."""
    if not limits:
        return
    model, original = engine.model, engine.plant.model
    impose(model, original, limits)
    free = _answers(engine, x, u)
    impose(model, original, limits, *limits)
    bound = _answers(engine, x, u)
    same = _SAME * np.maximum(np.abs(free), np.abs(bound)).max(axis=0) + 1e-12
    there = (np.abs(bound - free) > same).any(axis=1)
    if not there.any():
        return
    x, u, free = x[there], u[there], free[there]
    for limit in limits:
        impose(model, original, limits, limit)
        if (np.abs(_answers(engine, x, u) - free) > same).any():
            yield limit


def _yielding(engine: Dynamics, x: Array, u: Array) -> Iterator[Notice]:
    """Springs that a motion strains beyond where they yield: no answer shows it, for steps alone move their rest."""
    model, data = engine.model, engine.data
    if not model.nplastic:
        return
    joints, tendons = (np.flatnonzero(of >= 0) for of in (model.jnt_plasticadr, model.tendon_plasticadr))
    strain, turn = np.zeros((len(x), len(joints) + len(tendons))), np.zeros(3)
    for row, at in zip(strain, zip(x, u, strict=True), strict=True):
        engine.forward(*at)
        for i, joint in enumerate(joints):
            first, ball = int(model.jnt_qposadr[joint]), model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_BALL
            here, rest = (of[first : first + 4] for of in (data.qpos, model.qpos_spring))
            if ball:
                mujoco.mju_subQuat(turn, here, rest)
            row[i] = np.linalg.norm(turn) if ball else abs(here[0] - rest[0])
        low, high = model.tendon_lengthspring[tendons].T
        row[len(joints) :] = np.maximum(low - data.ten_length[tendons], data.ten_length[tendons] - high)
    names = [f"joint {model.joint(i).name or i}" for i in joints] + [
        f"tendon {model.tendon(i).name or i}" for i in tendons
    ]
    yields = np.concatenate([model.jnt_springyield[joints], model.tendon_springyield[tendons]])
    for name, most, least in zip(names, strain.max(axis=0), yields, strict=True):
        if most > least:
            words = (
                f"the predicted orbit strains the spring of {name} by {most:.3g}, and it yields at {least:.3g}{_END}"
            )
            yield Notice("not linear", "warning", words)


def _notice(plant: MujocoPlant, limit: Bound, x: Array, u: Array) -> Notice:
    model, here, i = plant.model, plant.linearisation, limit.at
    sort, name = SORTS[limit.array], name_of(model, limit)
    words = f"the predicted orbit passes {sort.words.format(name)}{_END}"
    if limit.array == "actuator_ctrllimited":
        port = np.flatnonzero(here.ports.actuators == i)
        peak = float(np.abs(here.ports.b[port] * u[:, port]).max(initial=0.0))
        room = np.abs(model.actuator_ctrlrange[i] - here.point.ctrl[i]).min()
        words = f"the predicted orbit moves {name} by {peak:.3g}, and its ctrlrange leaves {room:.3g}{_END}"
    margins = [margin for margin in plant.quality.room if limit.array == "jnt_limited" and margin.of == name]
    for margin in margins:
        peak = float(np.abs(x[:, here.plant.states.index(name)]).max())
        room = max(min(margin.down, margin.up), 0)
        words = f"the predicted orbit moves {name} by {peak:.3g}, and {room:.3g} are left to an end of its range{_END}"
    return Notice(sort.kind, "warning", words)


def _elsewhere(engine: Dynamics, x: Array, u: Array) -> Iterator[Notice]:
    """A corner that no known limit explains."""
    linear, rest = engine.plant.linearisation.plant, _at_rest(engine)
    expected = np.hstack([x @ linear.A.T + u @ linear.B.T, x @ linear.C.T])
    found = _answers(engine, x, u) - rest
    size = np.maximum(np.abs(expected), np.abs(found)).max(axis=0)
    nq, n = int((engine.plant.linearisation.ports.states < engine.model.nv).sum()), linear.n
    for kind in (slice(0, nq), slice(nq, n), slice(n, None)):  # what is small beside its like is rounding, or squares
        size[kind] = np.maximum(size[kind], _SMALL * size[kind].max(initial=0.0))
    size[size < 1e-12] = np.inf
    departure = (np.abs(found - expected) / size).max(axis=1)
    touching = _touching(engine, 0 * x[0], 0 * u[0])
    for i in _ways(departure, u):

        def along(s: float, x: Array = x[i], u: Array = u[i]) -> Array:
            return np.concatenate(engine(s * x, s * u)) / size

        s = _corner(along)
        if s is None:
            continue
        words = f"the predicted orbit passes a corner of the plant, at {s:.0%} of its size"
        excitations = engine.plant.linearisation.point.ctrl.copy()
        excitations[engine.plant.linearisation.ports.actuators] += engine.plant.linearisation.ports.b * u[i]
        muscles = engine.model.actuator_dyntype == mujoco.mjtDyn.mjDYN_MUSCLE
        beyond = np.flatnonzero(muscles & ((excitations < 0) | (excitations > 1)))
        if len(beyond):
            names = ", ".join(name_inputs(engine.model)[k] for k in beyond)
            yield Notice("saturation", "warning", f"{words}: the excitation of {names} is beyond 0 to 1{_END}")
            return
        others = sorted(touching ^ _touching(engine, x[i], u[i]))
        why = ": " + ", ".join(f"{one} and {other} touch, or let go" for one, other in others) if others else ""
        yield Notice("not linear", "warning", f"{words}{why}; the linear theory knows none")
        return


def _ways(departure: Array, u: Array) -> list[int]:
    """Samples towards which the straight line from rest is searched, largest departure first.

    Some of all that depart, and those where an input is largest, either way.
    """
    order = [int(i) for i in np.argsort(-departure) if departure[i] > _SLIGHT]
    some = set(order[:: max(1, len(order) // _WAYS)]) | {*u.argmax(axis=0), *u.argmin(axis=0)}
    return [i for i in order if i in some]


def _corner(
    along: Callable[[float], Array], low: float = 0.0, high: float = 1.0, depth: int = 0, before: float = np.inf
) -> float | None:
    """The place from ``low`` to ``high`` where the slope of ``along``, of size 1, jumps; ``None`` without a jump."""
    s = np.linspace(low, high, (2 * _FINER if depth else _CELLS) + 1)
    slopes = np.diff(np.array([along(at) for at in s]), axis=0) / (s[1] - s[0])
    jumps = np.abs(np.diff(slopes, axis=0)).max(axis=1)
    for k in np.argsort(-jumps):
        # a curve's jump falls in proportion to the step; that of rounding, and of a leap, grows with its inverse
        rounding = jumps[k] > 2.5 * before and jumps[k] * (s[1] - s[0]) < _LEAP
        if jumps[k] <= BENT or rounding or (depth and jumps[k] < 0.4 * before):
            continue
        if depth == _DEPTH:
            return float(s[k + 1])
        found = _corner(along, s[k], s[k + 2], depth + 1, jumps[k])
        if found is not None:
            return found
    return None


def _touching(engine: Dynamics, x: Array, u: Array) -> set[tuple[str, str]]:
    """Pairs of geoms that push each other."""
    engine.forward(x, u)
    model, contact, force = engine.model, engine.data.contact, np.zeros(6)
    pairs = set()
    for i in range(engine.data.ncon):
        mujoco.mj_contactForce(model, engine.data, i, force)
        if force[0] > 0 and min(contact[i].geom) >= 0:
            one, other = sorted(model.geom(int(k)).name or f"geom{k}" for k in contact[i].geom)
            pairs.add((one, other))
    return pairs
