"""The MuJoCo plant: an MJCF model with its deviation and its linearisation."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco

from icmj.engine.linearisation import Linearisation, linearise
from icmj.engine.model import Deviation, load_spec


@dataclass(frozen=True, eq=False)
class MujocoPlant:
    """A plant on the physics engine.

    Attributes:
        path: the MJCF file.
        spec: its model, deviated; copy before editing (``spec.copy()``).
        linearisation: at the operating point, with the point itself.
    """

    path: Path
    spec: mujoco.MjSpec
    linearisation: Linearisation

    @property
    def xml(self) -> str:
        """The deviated model as MJCF text."""
        return self.spec.to_xml()


def load_plant(path: Path | str, deviation: Deviation | None = None, keyframe: str | None = None) -> MujocoPlant:
    """Load, deviate and linearise an MJCF plant.

    Raises:
        ModelError: see :func:`icmj.engine.model.load_spec` and :func:`icmj.engine.linearisation.linearise`.
    """
    path = Path(path)
    spec = load_spec(path, deviation)
    return MujocoPlant(path, spec, linearise(spec.compile(), keyframe))
