"""The arguments of the commands that one begins with: models, run files and their schema."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from icmj.cli.overrides import Shared


@dataclass(frozen=True)
class Cases(Shared):
    """List the cases, rival controllers, sweeps, experiments and families that come with icmj.

    Example: icmj cases
    """

    json: bool = False
    """Print JSON instead of a list."""


@dataclass(frozen=True)
class New(Shared):
    """Write a commented run file for a model, or copy a shipped case and its models.

    Example: icmj new body.xml --out body.toml
    """

    model: tyro.conf.Positional[Path]
    """MJCF file, or name of a shipped model or case."""
    out: Path | None = None
    """Run file to write (default: MODEL.toml in this folder). An existing file is never overwritten."""
    keyframe: str | None = None
    """Keyframe of the operating point (default: the first at which the model is at rest)."""


@dataclass(frozen=True)
class Person(Shared):
    """Scale the three-link model to the height and mass of a person, and write it.

    Example: icmj person three_link --height 1.65 --mass 60 --out person.xml
    """

    model: tyro.conf.Positional[Path]
    """MJCF file with the bodies shank, thigh and trunk, or name of a shipped model."""
    height: float = 1.80
    """Height of the person [m]."""
    mass: float = 80.0
    """Mass of the person [kg]."""
    out: Path = Path("person.xml")
    """MJCF file to write."""


@dataclass(frozen=True)
class Linearise(Shared):
    """Linearise an MJCF model by centred finite differences; print the matrices A, B, C and the poles.

    Example: icmj linearise three_link --keyframe upright
    """

    model: tyro.conf.Positional[Path]
    """MJCF file, or name of a shipped model."""
    keyframe: str | None = None
    """Keyframe of the operating point (default: the reference configuration)."""
    operating_point: Literal["as given", "static control", "balance"] | None = None
    """How the operating point is completed: as given, controls only, or controls and pose (default: as given for a
    keyframe; without one, as given if the model is at rest there, else balance).
    """
    free: tuple[str, ...] = ()
    """Joints that may move to complete the pose with --operating-point balance (default: all)."""
    outputs: tuple[str, ...] = ()
    """Sensors or joints to take as outputs; the word joints means all joints (default: all sensors)."""
    json: bool = False
    """Print JSON instead of tables."""
    full: bool = False
    """Print the matrices even if they are large."""
    out: Path | None = None
    """File (.npz) for A, B, C, poles, names and units."""


@dataclass(frozen=True)
class Schema(Shared):
    """Print the JSON Schema of run, sweep, experiment or family files; editors use it to complete and check them.

    Example: icmj schema run --out run.schema.json
    """

    kind: tyro.conf.Positional[Literal["run", "sweep", "experiment", "family"]] = "run"
    """Kind of file."""
    out: Path | None = None
    """File to write instead of printing."""
