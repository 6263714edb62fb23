"""The MuJoCo plant: an MJCF model with its deviation and its linearisation."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco

from icmj.engine.linearisation import Linearisation, linearise
from icmj.engine.model import Deviation, load_spec
from icmj.engine.soundness import check_names, check_plant, check_sizes, sound


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
        ModelError: see :func:`icmj.engine.model.load_spec`, :func:`icmj.engine.linearisation.linearise` and
            :mod:`icmj.engine.soundness`.
    """
    path = Path(path)
    with sound(path):
        spec = load_spec(path, deviation)
        check_names(path, spec)
        model = spec.compile()
        check_sizes(path, model)
        linearisation = linearise(model, keyframe)
        check_plant(path, linearisation.plant)
    return MujocoPlant(path, spec, linearisation)
