"""The MuJoCo plant: an MJCF model with its deviation and its linearisation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from pathlib import Path

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.actuator import muscles_of, sizes_without, with_muscles, without_muscles
from icmj.engine.assessment import assess
from icmj.engine.callbacks import hushed
from icmj.engine.deviation import Deviation
from icmj.engine.equilibrium import equilibria
from icmj.engine.linearisation import Linearisation, linearise
from icmj.engine.model import (
    Models,
    OperatingPoint,
    depart,
    forget,
    input_names,
    load_model,
    load_spec,
    operating_point,
    state_names,
)
from icmj.engine.ports import ports_of
from icmj.engine.pushing import effects, on_bodies, places
from icmj.engine.sensing import sensed
from icmj.engine.soundness import check_names, check_plant, check_sizes, sound
from icmj.engine.stance import moved
from icmj.engine.units import state_units
from icmj.errors import ModelError
from icmj.plant.activation import Activation, Lag
from icmj.plant.linear_plant import LinearPlant
from icmj.plant.matching import Match, picked, ports
from icmj.plant.modes import adrift
from icmj.plant.notice import Notice
from icmj.plant.person import Person
from icmj.plant.push import Push
from icmj.plant.quality import Quality, dropped
from icmj.plant.selection import OperatingRule, Selection
from icmj.simulation.ending import Limit, limits_of
from icmj.work.shipped import MODELS


@dataclass(frozen=True, eq=False)
class MujocoPlant:
    """A plant that is simulated in MuJoCo.

    Attributes:
        path: the MJCF file.
        spec: its model with the deviation applied; copy before editing (``spec.copy()``).
        linearisation: linearisation at the operating point, with the point itself and the ports.
        told: notices of default choices.
        muscles: the lags that an :class:`icmj.Activation` added to actuators, by the number of the actuator.
        models: what is compiled of ``spec``.
    """

    path: Path
    spec: mujoco.MjSpec
    linearisation: Linearisation
    told: tuple[Notice, ...] = ()
    muscles: Mapping[int, Lag] = field(default_factory=dict)
    models: Models = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.models is None or self.models.spec is not self.spec:
            object.__setattr__(self, "models", Models(self.spec))

    @cached_property
    def model(self) -> mujoco.MjModel:
        """The compiled model; copy before editing (``copy.copy``)."""
        with hushed():
            return self.models.at(self.linearisation.point)

    @cached_property
    def quality(self) -> Quality:
        """The quality of its operating point."""
        with hushed():
            return assess(self.model, self.linearisation)

    @property
    def rest(self) -> OperatingPoint:
        """The operating point without the activations of the muscles."""
        point = self.linearisation.point
        return replace(point, act=without_muscles(self.model, self.muscles, point.act))

    @property
    def states(self) -> tuple[str, ...]:
        """All states of the model, including those that the plant leaves out."""
        return state_names(self.model)

    def matched(self, assumed: LinearPlant, match: Match = "name") -> MujocoPlant:
        """The same plant with inputs and outputs in the order of ``assumed``; see :func:`icmj.plant.matching.matched`.

        Raises:
            AnalysisError: if they differ in number or in name.
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
    def bodies(self) -> tuple[str, ...]:
        """The names of its bodies, which can be pushed."""
        return tuple(filter(None, (self.model.body(i).name for i in range(1, self.model.nbody))))

    def pushed(self, pushes: Iterable[Push]) -> LinearPlant:
        """The linear plant with the effect of these pushes on bodies.

        Raises:
            SimulationError: if there is no such body.
        """
        here, wanted = self.linearisation, [push for push in pushes if push.input is None]
        if not wanted:
            return here.plant
        parts = [on_bodies(self.model, here.point, push) for push in wanted]
        tables = (places(self.model, each, (), ()) for each in parts)
        found = [effects(self.model, here.point, table)[here.ports.states].sum(axis=1) for table in tables]
        return replace(here.plant, pushes=dict(zip(wanted, found, strict=True)))

    def limits(self, limit: Limit) -> Array:
        """The deviation of each position of the model at which the body counts as fallen [rad or m], shape (nv,).

        Raises:
            SimulationError: if a limit names something that is not a position.
        """
        nv = self.model.nv
        return limits_of(limit, state_names(self.model)[:nv], state_units(self.model)[:nv])

    @property
    def xml(self) -> str:
        """The model with its deviation as MJCF text."""
        return self.spec.to_xml()


@hushed()
def load_plant(
    path: Path | str,
    deviation: Deviation | None = None,
    keyframe: str | None = None,
    *,
    selection: Selection | None = None,
    operating: OperatingRule | None = None,
    start: OperatingPoint | None = None,
    person: Person | None = None,
    activation: Activation | None = None,
) -> MujocoPlant:
    """Load an MJCF model, apply its deviation, and linearise it.

    Args:
        path: the MJCF file, or the name of a shipped model, such as ``three_link``.
        deviation: changes of the model.
        keyframe: the keyframe of its operating point; the reference configuration if ``None``.
        selection: its inputs, outputs and states; if ``None``, all of the model.
        operating: the rule that gives the operating point from the keyframe; if ``None``, the keyframe itself.
        start: a configuration to use instead of a keyframe, without the states of ``activation``; these start at rest.
        person: the person to whose body measures the model is scaled.
        activation: the lag of its inputs, which must be motors.

    Raises:
        ModelError: see :func:`icmj.engine.model.load_spec`, :func:`icmj.engine.ports.ports_of`,
            :func:`icmj.engine.equilibrium.equilibria`, :func:`icmj.engine.linearisation.linearise` and
            :mod:`icmj.engine.soundness`.
    """
    path, rule = MODELS.meant(Path(path)), operating or OperatingRule()
    with sound(path):
        inputs = selection.inputs if selection else None
        spec, model = load_model(path, deviation, person, activation, inputs)
        check_names(path, spec)
        chosen, told, model = sensed(spec, model, selection or Selection())
        check_sizes(path, model)
        ports = ports_of(model, chosen, deviation)
        if model.nhistory:  # what has a delay is not used, and would hold nothing but zeros
            forget(spec)
            model = spec.compile()
        if chosen.spare and chosen.drop:  # what shows a dropped state is left out below
            ports = ports_of(model, replace(chosen, drop=()), deviation)
        muscles = muscles_of(input_names(model), activation, inputs)
        if start is not None:
            start = replace(start, act=with_muscles(sizes_without(model, muscles), muscles, start.act, start.ctrl))
        given = start or operating_point(model, keyframe)
        models = Models(spec, model)
        model = models.at(given)
        points = _told_where(path, equilibria(model, given, rule))
        raw = (
            MujocoPlant(path, spec, linearise(model, ports=ports, point=point), told, muscles, models)
            for point in points
        )
        plants = (_without(plant, model, chosen, deviation) for plant in raw)
        first = next(plants)
        plant = _best(first, plants) if rule.kind in ("balance", "found") else first
        check_plant(path, plant.linearisation.plant)
        if rule.kind == "found":
            why = "has a kink, or no room" if first.quality.at_rest else "is not at rest"
            plant = replace(plant, told=(*moved(model, given, plant.linearisation.point, why), *plant.told))
        return plant


def shaped(path: Path, person: Person) -> str:
    """The MJCF text of a model with the measures of ``person``.

    Raises:
        ModelError: see :func:`icmj.engine.model.load_spec` and :mod:`icmj.engine.soundness`.
    """
    with sound(path):
        return load_spec(path, person=person).to_xml()


def place(plant: MujocoPlant, data: mujoco.MjData, x: Array, u: Array, qpos: Array | None = None) -> None:
    """Put ``data`` at a state and commands, all states (:mod:`icmj.engine.ports`) as departures from the point at rest.

    Positions are ``qpos`` instead, if given.
    """
    point, ports = plant.linearisation.point, plant.linearisation.ports
    depart(plant.model, data, point, x, qpos)
    data.ctrl[:] = point.ctrl
    data.ctrl[ports.actuators] += ports.b * u


def _told_where(path: Path, points: Iterator[OperatingPoint]) -> Iterator[OperatingPoint]:
    try:
        yield from points
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from error


def _best(first: MujocoPlant, others: Iterator[MujocoPlant]) -> MujocoPlant:
    """The first whose operating point permits a prediction, or else the one with the smallest residual."""
    found: list[MujocoPlant] = []
    try:
        for plant in chain((first,), others):
            found.append(plant)
            if all(plant.quality.merits):
                break
    except ModelError:
        if not any(plant.quality.at_rest for plant in found):
            raise
    return max(found, key=lambda plant: plant.quality.merits)


def _without(plant: MujocoPlant, model: mujoco.MjModel, chosen: Selection, deviation: Deviation | None) -> MujocoPlant:
    """The plant without the dropped states, and without spare outputs that show them; with notices of idle ones."""
    linear = plant.linearisation.plant
    drop = chosen.drop or (adrift(linear) if chosen.states is None else ())
    there = [linear.states.index(name) for name in drop if name in linear.states]
    shown = np.abs(linear.C[:, there]).max(axis=1, initial=0.0) > 1e-9
    if not there or (shown.any() and not chosen.spare):
        return plant
    outputs = chosen.outputs
    if chosen.spare:  # what is left may show nothing, as the first entry of a quaternion
        shows = ~shown & (np.abs(linear.C).max(axis=1) > 1e-9)
        outputs = tuple(name for name, shows in zip(linear.outputs, shows, strict=True) if shows)
    ports = ports_of(model, replace(chosen, outputs=outputs, drop=drop), deviation)
    kept = replace(plant, linearisation=linearise(model, ports=ports, point=plant.linearisation.point))
    return kept if chosen.drop else replace(kept, told=(*plant.told, dropped(drop)))
