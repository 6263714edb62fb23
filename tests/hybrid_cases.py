"""Five controllers of users (examples/hybrid) on the one-link person, and any controller by its realisation alone."""

import importlib.util
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import icmj
from icmj.controller.layout import Layout
from icmj.controller.realisation import Mode, Realisation
from icmj.plant.linear_plant import LinearPlant

FOLDER = Path(__file__).parents[1] / "examples" / "hybrid"
NAMES = ("plain-pd", "hysteresis", "reflex", "alert", "saturating")
START = np.array([0.01, 0.003])


@cache
def laws() -> ModuleType:
    """The users' file."""
    spec = importlib.util.spec_from_file_location("hybrid_laws", FOLDER / "laws.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules["hybrid_laws"] = module
    spec.loader.exec_module(module)
    return module


@cache
def body() -> Any:
    """The one-link person in MuJoCo."""
    return icmj.load_plant("one_link", keyframe="upright")


def plant() -> LinearPlant:
    """The same, linear."""
    return body().linearisation.plant


def weak() -> LinearPlant:
    """The same with a tenth less torque than controllers assume."""
    return replace(plant(), B=0.9 * plant().B)


def law(name: str) -> icmj.Law:
    """A controller of the users' file, for the person as assumed."""
    of, there = laws(), plant()
    return {
        "plain-pd": lambda: of.PlainPD(there),
        "hysteresis": lambda: of.Hysteresis(there, 0.2),
        "reflex": lambda: of.WithReflex(there, 0.2),
        "alert": lambda: of.Alert(there, 0.2, start=1.5),
        "saturating": lambda: of.Saturating(there, 0.2, u_max=3.0),
    }[name]()


@dataclass(frozen=True, eq=False)
class Bare(icmj.Law):
    """Another controller by its realisation alone."""

    of: icmj.Law

    @property
    def plant(self) -> LinearPlant:
        return self.of.plant

    @property
    def kind(self) -> str:
        return "bare"

    def facts(self) -> Mapping[str, Any]:
        return {}

    @property
    def realisation(self) -> Realisation:
        return self.of.realisation


@dataclass(frozen=True, eq=False)
class Own(icmj.Law):
    """A controller for an assumed plant, of which there is nothing to say."""

    assumed: LinearPlant

    @property
    def plant(self) -> LinearPlant:
        return self.assumed

    def facts(self) -> Mapping[str, Any]:
        return {}


@dataclass(frozen=True, eq=False)
class Given(Own):
    """A controller that is this realisation."""

    given: Any
    kind = "given"

    @property
    def realisation(self) -> Realisation:
        return self.given


@dataclass(frozen=True, eq=False)
class Ramp(Own):
    """A state that grows by 1/s beside a PD: an event where it is 1 sets it to ``keep`` of that, an action halves it.

    What it does is known by hand: with a delay of 1 s and ``keep`` 0, state and action are due at 1 s together. The
    action is first, so the event is at 1.5 s, and every 1.5 s, the last at the very end of 6 s.
    """

    taps: tuple[float, ...] = (0.0,)
    delay: float = 0.0
    wait: float = 0.0
    clock: float = np.inf
    sampling: float = 0.0
    keep: float = 0.0
    kind = "ramp"

    @cached_property
    def realisation(self) -> Realisation:
        n_v, one = 2 * len(self.taps) + 1, np.eye(1)
        N, S = np.zeros((1, n_v)), np.zeros((1, n_v))
        N[0, -1], S[0, :2] = 1.0, (900.0, 300.0)
        mode = Mode("on", np.zeros((1, 1)), N, np.array([[10.0]]), S)
        return Realisation(
            Layout.of(a=1), (mode,), self.keep * one, 0.5 * one, one, np.array([0, 1]), delay=self.delay,
            taps=self.taps, signals=np.array([[0, 1.0, 0, 0, 0, np.inf]]), wait=self.wait, clock=self.clock,
            sampling=self.sampling,
        )  # fmt: skip


RAMPS: dict[str, tuple[dict[str, float], list[float]]] = {
    "an action where the rule is reached": ({"delay": 1.0}, [1.5, 3.0, 4.5, 6.0]),
    "no delay, and an event at the end": ({}, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
    "a rule beyond when its least time ends": ({"wait": 0.25, "keep": 1.0}, [1 + 0.25 * k for k in range(21)]),
    "an action at a quarter, from the start on": (
        {"delay": 0.25, "wait": 0.25, "keep": 1.0}, [1.125 + 0.625 * k for k in range(8)],
    ),
    "a clock, whose last tick is the end": ({"clock": 0.75}, [0.75 * k for k in range(1, 9)]),
    "a sample after the rule": ({"sampling": 0.3}, [1.3, 2.6, 3.9, 5.2]),
    "a delay longer than the interval": ({"delay": 2.0, "wait": 1.0}, [1.0, 2.5, 3.75, 5.125]),
}  # fmt: skip
"""Numbers of a :class:`Ramp`, and its events within 6 s, by hand."""
