"""Five controllers of users (examples/hybrid) on the one-link person, and any controller by its realisation alone."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import icmj
from icmj.controller.realisation import Realisation
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
