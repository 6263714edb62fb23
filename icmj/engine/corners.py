"""Kinks of the plant's response along the predicted motion, where the linear theory does not hold.

The engine is asked for its rates and outputs at states and inputs of the motion. The limits that a model can have are
lifted on a copy: where that changes the answer, one of them acts, and each imposed by itself says which. With these
lifted, the way from rest to a state is followed in ever finer steps: what is smooth changes its slope less from step to
step, a corner (a contact made or lost, a muscle that cannot pull less) by as much in however small a step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.callbacks import hushed
from icmj.engine.dynamics import Dynamics
from icmj.engine.model import input_names
from icmj.engine.plant import MujocoPlant
from icmj.plant.notice import Kind, Notice
from icmj.plant.quality import BENT

_SAMPLES = 64  # of a motion, beside those where a signal is largest
_SAME = 1e-6  # of the size of an answer: a change that no limit makes
_SLIGHT = 5e-4  # of the size of an answer: a departure from the linear one that hides no corner
_SMALL = 1e-3  # of the size of the largest answer of its kind: one that is taken to be as large
_WAYS = 16  # from rest that are followed
_LEAP = 1e-4  # of the size of an answer: what is no rounding
_CELLS, _FINER, _DEPTH = 16, 4, 4  # cells of the way from rest; into how many a cell is cut, and how often
_END = "; the linear theory knows no limits"


class _Limit(NamedTuple):
    """An entry of an array of the model, and its value where it limits nothing."""

    array: str
    at: int
    lifted: Array


# arrays that limit a plant: the kind of the notice, what of the plant each entry belongs to, and words for it
_LIMITS: dict[str, tuple[Kind, str, str]] = {
    "actuator_ctrllimited": ("saturation", "actuator", "the ctrlrange of {}"),
    "actuator_forcelimited": ("saturation", "actuator", "the forcerange of {}"),
    "actuator_actlimited": ("saturation", "actuator", "the actrange of {}"),
    "jnt_actfrclimited": ("saturation", "joint", "the actuatorfrcrange of joint {}"),
    "tendon_actfrclimited": ("saturation", "tendon", "the actuatorfrcrange of tendon {}"),
    "sensor_cutoff": ("saturation", "sensor", "the cutoff of sensor {}"),
    "jnt_limited": ("joint limit", "joint", "an end of the range of joint {}"),
    "tendon_limited": ("joint limit", "tendon", "an end of the range of tendon {}"),
    "tendon_lengthspring": ("not linear", "tendon", "an end of the springlength of tendon {}"),
}


@hushed()
def corners(plant: MujocoPlant, x: Array, u: Array) -> tuple[Notice, ...]:
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
        limits = _limits(engine)
        yield from (_told(plant, limit, x, u) for limit in _acting(engine, limits, x, u))
        _impose(engine, limits)
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


def _impose(engine: Dynamics, limits: Sequence[_Limit], *those: _Limit) -> None:
    """Remove all limits except ``those``."""
    for limit in limits:
        there = any(limit is one for one in those)
        value = getattr(engine.plant.model, limit.array)[limit.at] if there else limit.lifted
        getattr(engine.model, limit.array)[limit.at] = value


def _limits(engine: Dynamics) -> list[_Limit]:
    """The limits of the model, without those that act at rest: they are in the linearisation."""
    model, rest = engine.model, _at_rest(engine)
    lengths = engine.data.ten_length.copy()
    found = []
    for array in _LIMITS:
        entries = getattr(model, array)
        if array != "tendon_lengthspring":
            found += [_Limit(array, int(i), np.zeros(())) for i in np.flatnonzero(entries)]
            continue
        for i in np.flatnonzero(entries[:, 0] < entries[:, 1]):
            low, high = entries[i]
            slack = low <= lengths[i] <= high
            end = low if lengths[i] < low else high
            lifted = np.array([-mujoco.mjMAXVAL, mujoco.mjMAXVAL]) if slack else np.array([end, end])
            found.append(_Limit(array, int(i), lifted))
    quiet = []
    for limit in found:
        _impose(engine, [limit])
        if (np.abs(_at_rest(engine) - rest) <= _SAME * (1 + np.abs(rest))).all():
            quiet.append(limit)
        _impose(engine, [limit], limit)
    return quiet


def _acting(engine: Dynamics, limits: Sequence[_Limit], x: Array, u: Array) -> Iterator[_Limit]:
    """The ``limits`` that change the rates or outputs."""
    if not limits:
        return
    _impose(engine, limits)
    free = _answers(engine, x, u)
    _impose(engine, limits, *limits)
    bound = _answers(engine, x, u)
    same = _SAME * np.maximum(np.abs(free), np.abs(bound)).max(axis=0) + 1e-12
    there = (np.abs(bound - free) > same).any(axis=1)
    if not there.any():
        return
    x, u, free = x[there], u[there], free[there]
    for limit in limits:
        _impose(engine, limits, limit)
        if (np.abs(_answers(engine, x, u) - free) > same).any():
            yield limit


def _told(plant: MujocoPlant, limit: _Limit, x: Array, u: Array) -> Notice:
    model, here, i = plant.model, plant.linearisation, limit.at
    kind, sort, what = _LIMITS[limit.array]
    name = input_names(model)[i] if sort == "actuator" else getattr(model, sort)(i).name or str(i)
    words = f"the predicted orbit passes {what.format(name)}{_END}"
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
    return Notice(kind, "warning", words)


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
            names = ", ".join(input_names(engine.model)[k] for k in beyond)
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
