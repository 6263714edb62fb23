"""The limits that a model can have: each lifted or imposed on a copy, and those that act at an operating point.

A limit acts where lifting it changes what the engine answers: accelerations, rates of activations, or sensors.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import NamedTuple

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.activations import activation_rates
from icmj.engine.isolation import isolate_engine
from icmj.engine.model import OperatingPoint, make_data, name_inputs, solve_fully
from icmj.plant.quality import Excess

_SAME = 1e-6  # of the size of an answer: a change that no limit makes


class Bound(NamedTuple):
    """An entry of an array of the model, and its value where it limits nothing."""

    array: str
    at: int
    lifted: Array


class _Sort(NamedTuple):
    """Kind of the notice, what of the plant an entry belongs to, words for the limit, and where its numbers are."""

    kind: str
    of: str
    words: str
    range: str


SORTS: dict[str, _Sort] = {
    "actuator_ctrllimited": _Sort("saturation", "control", "the ctrlrange of {}", "actuator_ctrlrange"),
    "actuator_forcelimited": _Sort("saturation", "actuator", "the forcerange of {}", "actuator_forcerange"),
    "actuator_actlimited": _Sort("saturation", "actuator", "the actrange of {}", "actuator_actrange"),
    "jnt_actfrclimited": _Sort("saturation", "joint", "the actuatorfrcrange of joint {}", "jnt_actfrcrange"),
    "tendon_actfrclimited": _Sort("saturation", "tendon", "the actuatorfrcrange of tendon {}", "tendon_actfrcrange"),
    "sensor_cutoff": _Sort("saturation", "sensor", "the cutoff of sensor {}", "sensor_cutoff"),
    "jnt_limited": _Sort("joint limit", "joint", "an end of the range of joint {}", "jnt_range"),
    "tendon_limited": _Sort("joint limit", "tendon", "an end of the range of tendon {}", "tendon_range"),
    "tendon_lengthspring": _Sort(
        "not linear", "tendon", "an end of the springlength of tendon {}", "tendon_lengthspring"
    ),
}  # fmt: skip
"""The arrays that limit a plant."""


def list_bounds(model: mujoco.MjModel, lengths: Array) -> list[Bound]:
    """All limits of ``model``, where its tendons have these lengths."""
    found = []
    for array in SORTS:
        entries = getattr(model, array)
        if array != "tendon_lengthspring":
            found += [Bound(array, int(i), np.zeros(())) for i in np.flatnonzero(entries)]
            continue
        for i in np.flatnonzero(entries[:, 0] < entries[:, 1]):
            low, high = entries[i]
            slack = low <= lengths[i] <= high
            end = low if lengths[i] < low else high
            lifted = np.array([-mujoco.mjMAXVAL, mujoco.mjMAXVAL]) if slack else np.array([end, end])
            found.append(Bound(array, int(i), lifted))
    return found


def impose(model: mujoco.MjModel, original: mujoco.MjModel, bounds: Sequence[Bound], *those: Bound) -> None:
    """Remove all ``bounds`` from ``model`` but ``those``, which are as in the ``original``."""
    for bound in bounds:
        there = any(bound is one for one in those)
        getattr(model, bound.array)[bound.at] = getattr(original, bound.array)[bound.at] if there else bound.lifted


def sort_bounds(
    model: mujoco.MjModel, point: OperatingPoint, states: np.ndarray, entries: np.ndarray
) -> tuple[list[Bound], list[Bound]]:
    """The limits that do not act on these states and entries of ``sensordata`` at an operating point, and that do."""
    trial, data = copy(model), make_data(model, point)

    def answer() -> Array:
        mujoco.mj_forward(trial, data)
        rates = np.concatenate([data.qvel, data.qacc, activation_rates(trial, data)])
        return np.concatenate([rates[states], data.sensordata[entries]])

    quiet: list[Bound] = []
    acting: list[Bound] = []
    with isolate_engine(), solve_fully(trial):
        rest = answer()
        for bound in list_bounds(model, data.ten_length.copy()):
            impose(trial, model, [bound])
            same = (np.abs(answer() - rest) <= _SAME * (1 + np.abs(rest))).all()
            impose(trial, model, [bound], bound)
            (quiet if same else acting).append(bound)
    return quiet, acting


def name_of(model: mujoco.MjModel, bound: Bound) -> str:
    """The name of what a limit belongs to."""
    of = SORTS[bound.array].of
    if of in ("control", "actuator"):
        return name_inputs(model)[bound.at]
    return getattr(model, of)(bound.at).name or str(bound.at)


def find_excesses(
    model: mujoco.MjModel, point: OperatingPoint, states: np.ndarray, entries: np.ndarray, controls: np.ndarray
) -> tuple[Excess, ...]:
    """The limits beyond which an operating point lies, but those of controls that are no inputs."""
    names, found = name_inputs(model), []
    for bound in sort_bounds(model, point, states, entries)[1]:
        sort, at = SORTS[bound.array], bound.at
        held = (names[at],) if sort.of in ("control", "actuator") and at in controls else ()
        if sort.of == "control" and not held:
            continue
        ends = " to ".join(f"{end:g}" for end in np.atleast_1d(getattr(model, sort.range)[at]))
        found.append(Excess(f"{sort.words.format(name_of(model, bound))}, {ends}", sort.kind, held))
    return tuple(found)
