"""The MuJoCo plant: an MJCF model with its deviation, at rest at its operating point, and its linearisation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from pathlib import Path

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.activations import add_muscles, count_without_muscles, remove_muscles, select_muscles
from icmj.engine.deviation import Deviation
from icmj.engine.forces import compute_effects
from icmj.engine.isolation import isolate_engine
from icmj.engine.linearisation import Linearisation, linearise
from icmj.engine.model import (
    Models,
    OperatingPoint,
    depart,
    forget,
    get_operating_point,
    load_model,
    load_spec,
    name_inputs,
    name_states,
)
from icmj.engine.moving_ground import push_bodies
from icmj.engine.operating_point import find_equilibria
from icmj.engine.ports import find_ports, find_still
from icmj.engine.pose_rule import notice_move
from icmj.engine.push_table import make_table
from icmj.engine.quality import assess
from icmj.engine.safety import check_names, check_plant, check_sizes, use_model
from icmj.engine.sensors import add_sensors
from icmj.engine.units import name_state_units
from icmj.errors import ModelError, prefix_errors
from icmj.plant.activation import Activation, Lag
from icmj.plant.body import OperatingRule, Selection
from icmj.plant.linear_plant import LinearPlant, Match, Push, pick, ports
from icmj.plant.person import Person
from icmj.plant.quality import Notice, Quality, adrift, idle, notice_omission
from icmj.simulation.position_limit import Limit, get_limits
from icmj.work.shipped import MODELS


@dataclass(frozen=True, eq=False)
class MujocoPlant:
    """A plant that is simulated in MuJoCo.

    Attributes:
        path: the MJCF file.
        spec: its model with the deviation applied; copy before editing (``spec.copy()``).
        linearisation: linearisation at the operating point, with the point itself and the ports.
        told: notices of default choices.
        muscles: the lags that an :class:`icmj.plant.Activation` added to actuators, by the number of the actuator.
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
        with isolate_engine():
            return self.models.at(self.linearisation.point)

    @cached_property
    def quality(self) -> Quality:
        """The quality of its operating point."""
        with isolate_engine():
            return assess(self.model, self.linearisation)

    @property
    def rest(self) -> OperatingPoint:
        """The operating point without the activations of the muscles."""
        point = self.linearisation.point
        return replace(point, act=remove_muscles(self.model, self.muscles, point.act))

    @property
    def states(self) -> tuple[str, ...]:
        """All states of the model, including those that the plant leaves out."""
        return name_states(self.model)

    def matched(self, assumed: LinearPlant, match: Match = "name") -> MujocoPlant:
        """The same plant with the inputs and outputs of ``assumed``; see :func:`icmj.plant.linear_plant.match_ports`.

        Raises:
            AnalysisError: if they differ in number or in name.
        """
        here = self.linearisation
        u, y = ports(here.plant, assumed, match)
        if (u == np.arange(len(u))).all() and (y == np.arange(len(y))).all():
            return self
        at = here.ports
        turned = replace(at, actuators=at.actuators[u], b=at.b[u], entries=at.entries[y], g=at.g[y], beta=at.beta[y])
        plant, D = pick(here.plant, u, y), here.D[np.ix_(y, u)]
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
        parts = [push_bodies(self.model, here.point, push) for push in wanted]
        tables = (make_table(self.model, each, (), ()) for each in parts)
        found = [compute_effects(self.model, here.point, table)[here.ports.states].sum(axis=1) for table in tables]
        return replace(here.plant, pushes=dict(zip(wanted, found, strict=True)))

    def limits(self, limit: Limit) -> Array:
        """The deviation of each position of the model at which the body counts as fallen [rad or m], shape (nv,).

        Raises:
            SimulationError: if a limit names something that is not a position.
        """
        nv = self.model.nv
        return get_limits(limit, name_states(self.model)[:nv], name_state_units(self.model)[:nv])

    @property
    def xml(self) -> str:
        """The model with its deviation as MJCF text."""
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
        ModelError: see :func:`icmj.engine.model.load_model`, :func:`icmj.engine.ports.find_ports`,
            :func:`icmj.engine.operating_point.find_equilibria`, :func:`icmj.engine.linearisation.linearise` and
            :mod:`icmj.engine.safety`.
    """
    path, rule = MODELS.meant(Path(path)), operating or OperatingRule()
    with use_model(path):
        inputs = selection.inputs if selection else None
        spec, model = load_model(path, deviation, person, activation, inputs)
        check_names(path, spec)
        chosen, told, model = add_sensors(spec, model, selection or Selection())
        check_sizes(path, model)
        ports = find_ports(model, chosen, deviation)
        if model.nhistory:  # what has a delay is not used, and would hold nothing but zeros
            forget(spec)
            model = spec.compile()
        if chosen.spare and chosen.drop:  # what shows a dropped state is left out below
            ports = find_ports(model, replace(chosen, drop=()), deviation)
        muscles = select_muscles(name_inputs(model), activation, inputs)
        if start is not None:
            start = replace(
                start, act=add_muscles(count_without_muscles(model, muscles), muscles, start.act, start.ctrl)
            )
        given = start or get_operating_point(model, keyframe)
        models = Models(spec, model)
        model = models.at(given)
        points = _say_where(path, find_equilibria(model, given, rule))
        raw = (
            MujocoPlant(path, spec, linearise(model, ports=ports, point=point), told, muscles, models)
            for point in points
        )
        plants = (_say_along(_without(plant, model, chosen, deviation), model) for plant in raw)
        first = next(plants)
        plant = _best(first, plants) if rule.kind in ("balance", "found") else first
        check_plant(path, plant.linearisation.plant)
        if rule.kind == "found":
            why = "has a kink, or no room" if first.quality.at_rest else "is not at rest"
            plant = replace(plant, told=(*notice_move(model, given, plant.linearisation.point, why), *plant.told))
        return plant


def shape_to_person(path: Path, person: Person) -> str:
    """The MJCF text of a model with the measures of ``person``.

    Raises:
        ModelError: see :func:`icmj.engine.model.load_model` and :mod:`icmj.engine.safety`.
    """
    with use_model(path):
        return load_spec(path, person=person).to_xml()


def place(plant: MujocoPlant, data: mujoco.MjData, x: Array, u: Array, qpos: Array | None = None) -> None:
    """Put ``data`` at a state and commands, all states as departures from the point at rest.

    Positions are ``qpos`` instead, if given.
    """
    point, ports = plant.linearisation.point, plant.linearisation.ports
    depart(plant.model, data, point, x, qpos)
    data.ctrl[:] = point.ctrl
    data.ctrl[ports.actuators] += ports.b * u


def _say_where(path: Path, points: Iterator[OperatingPoint]) -> Iterator[OperatingPoint]:
    with prefix_errors(path):
        yield from points


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
    linear, found = plant.linearisation.plant, plant.linearisation.ports
    drop = chosen.drop
    if not drop and chosen.states is None:
        drop = adrift(linear, np.flatnonzero(found.states < model.nv))
        # whatever an input does to what affects no rate and no output, without it the rest is as it is
        shown = dict(zip(linear.states, np.abs(linear.C).max(axis=0) > 0, strict=True))
        unseen = tuple(name for name in idle(linear) if name not in drop and not shown[name])
        drop += unseen if unseen and plant.quality.undecided else ()
    there = [linear.states.index(name) for name in drop if name in linear.states]
    V, positions = np.eye(linear.n)[:, there], np.flatnonzero(found.states < model.nv)
    for i, v in find_still(linear.A, np.intersect1d(there, positions), np.setdiff1d(positions, there)).items():
        V[:, there.index(i)] = v
    shown = np.abs(linear.C @ V).max(axis=1, initial=0.0) > 1e-9
    if not there or (shown.any() and not chosen.spare):
        return plant
    outputs = chosen.outputs
    if chosen.spare:  # what is left may show nothing, as the first entry of a quaternion
        shows = ~shown & (np.abs(linear.C).max(axis=1) > 1e-9)
        outputs = tuple(name for name, shows in zip(linear.outputs, shows, strict=True) if shows)
    ports = find_ports(model, replace(chosen, outputs=outputs, drop=drop), deviation)
    kept = replace(plant, linearisation=linearise(model, ports=ports, point=plant.linearisation.point))
    return kept if chosen.drop else replace(kept, told=(*plant.told, notice_omission(linear, drop)))


def _say_along(plant: MujocoPlant, model: mujoco.MjModel) -> MujocoPlant:
    """The plant, with a notice of what goes along with states that are left out."""
    names, ports = name_states(model), plant.linearisation.ports
    told = []
    for i, v in zip(ports.left, ports.still, strict=True):
        far = [j for j in np.argsort(-np.abs(v), kind="stable") if j != i and abs(v[j]) > 1e-6]
        others = "".join(f" {'-' if v[j] < 0 else '+'} {abs(v[j]):.2g} {names[j]}" for j in far)
        words = f"with {names[i]} the direction {names[i]}{others} is left out, on which nothing depends"
        told.append(Notice("dropped state", "warning", words))
    return replace(plant, told=(*plant.told, *told)) if told else plant
