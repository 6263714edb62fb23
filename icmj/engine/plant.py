"""The MuJoCo plant: an MJCF model with its deviation and its linearisation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

from icmj.engine.assessment import assess
from icmj.engine.deviation import Deviation
from icmj.engine.equilibrium import equilibrium
from icmj.engine.hush import hushed
from icmj.engine.linearisation import Linearisation, linearise
from icmj.engine.model import OperatingPoint, load_spec, operating_point, state_names
from icmj.engine.ports import ports_of
from icmj.engine.sensing import sensed
from icmj.engine.soundness import check_names, check_plant, check_sizes, sound
from icmj.errors import ModelError
from icmj.plant.linear_plant import LinearPlant
from icmj.plant.matching import Match, picked, ports
from icmj.plant.operating import OperatingRule
from icmj.plant.person import Person
from icmj.plant.quality import Quality
from icmj.plant.selection import Selection


@dataclass(frozen=True, eq=False)
class MujocoPlant:
    """A plant on the physics engine.

    Attributes:
        path: the MJCF file.
        spec: its model, deviated; copy before editing (``spec.copy()``).
        linearisation: at the operating point, with the point itself and the ports.
    """

    path: Path
    spec: mujoco.MjSpec
    linearisation: Linearisation

    @cached_property
    def model(self) -> mujoco.MjModel:
        """The model that steps; copy before editing (``copy.copy``)."""
        # from a copy, for compiling changes the spec, and threads that share the plant may ask at once
        with hushed():
            return self.spec.copy().compile()

    @cached_property
    def quality(self) -> Quality:
        """How good its operating point is."""
        return assess(self.model, self.linearisation)

    @property
    def states(self) -> tuple[str, ...]:
        """All states that the model has, also those that the plant leaves out."""
        return state_names(self.model)

    def matched(self, assumed: LinearPlant, match: Match = "name") -> MujocoPlant:
        """The same with its inputs and outputs in the order of ``assumed``; see :func:`icmj.plant.matching.matched`.

        Raises:
            AnalysisError: if they differ in number, or in name.
        """
        here = self.linearisation
        u, y = ports(here.plant, assumed, match)
        if (u == np.arange(len(u))).all() and (y == np.arange(len(y))).all():
            return self
        at = here.ports
        turned = replace(at, actuators=at.actuators[u], b=at.b[u], entries=at.entries[y], g=at.g[y], beta=at.beta[y])
        plant, D = picked(here.plant, u, y), here.D[np.ix_(y, u)]
        return replace(self, linearisation=replace(here, plant=plant, ports=turned, y=here.y[y], D=D))

    @property
    def xml(self) -> str:
        """The deviated model as MJCF text."""
        return self.spec.to_xml()


def load_plant(
    path: Path | str,
    deviation: Deviation | None = None,
    keyframe: str | None = None,
    *,
    selection: Selection | None = None,
    operating: OperatingRule | None = None,
    start: OperatingPoint | None = None,
    person: Person | None = None,
) -> MujocoPlant:
    """Load, deviate and linearise an MJCF plant.

    Args:
        path: the MJCF file.
        deviation: what is changed in it.
        keyframe: its operating point; the reference configuration if ``None``.
        selection: its inputs, outputs and states; all of the model's if ``None``.
        operating: how its operating point follows from the keyframe; it is the keyframe's if ``None``.
        start: instead of a keyframe.
        person: whose measures the model gets.

    Raises:
        ModelError: see :func:`icmj.engine.model.load_spec`, :func:`icmj.engine.ports.ports_of`,
            :func:`icmj.engine.equilibrium.equilibrium`, :func:`icmj.engine.linearisation.linearise` and
            :mod:`icmj.engine.soundness`.
    """
    path = Path(path)
    with sound(path):
        spec = load_spec(path, deviation, person)
        check_names(path, spec)
        selection = sensed(spec, selection or Selection())
        model = spec.compile()
        check_sizes(path, model)
        ports = ports_of(model, selection, deviation)
        given = start or operating_point(model, keyframe)
        try:
            point = equilibrium(model, given, operating or OperatingRule())
        except ModelError as error:
            raise ModelError(f"{path}: {error}") from error
        linearisation = linearise(model, ports=ports, point=point)
        check_plant(path, linearisation.plant)
    return MujocoPlant(path, spec, linearisation)
