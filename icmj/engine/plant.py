"""The MuJoCo plant: an MJCF model with its deviation, sensors, linearisation and quality.

Joints as outputs: position and velocity sensors added to a model that has none for them.

The quality of a plant's operating point, measured on its model.

The MuJoCo plant: an MJCF model with its deviation and its linearisation.

The named elements of a model that can be selected: keyframes, actuators, sensors, joints, bodies.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from pathlib import Path

import mujoco
import numpy as np

from icmj.base.array import Array, leading
from icmj.engine.bounds import excesses
from icmj.engine.deviation import Deviation
from icmj.engine.linearisation import (
    EPS,
    Differences,
    Linearisation,
    differences,
    effects,
    linearise,
    on_bodies,
    places,
    ports_of,
    step_of,
    still,
)
from icmj.engine.model import (
    Models,
    OperatingPoint,
    data_at,
    depart,
    forget,
    input_names,
    load_model,
    load_spec,
    muscles_of,
    operating_point,
    output_names,
    sensor_entries,
    sizes_without,
    state_names,
    with_muscles,
    without_muscles,
)
from icmj.engine.operating_point import equilibria, find_limited, input_units, notice_move, output_units, state_units
from icmj.engine.safety import check_names, check_plant, check_sizes, isolate_engine, sound
from icmj.errors import ModelError
from icmj.plant import quality
from icmj.plant.body import Activation, Lag, OperatingRule, Person, Selection
from icmj.plant.linear_plant import LinearPlant, Match, Push, pick, ports
from icmj.plant.quality import BENT, Kink, Margin, Notice, Quality, Raised, Residual, adrift, idle, notice_omission
from icmj.simulation.ending import Limit, limits_of
from icmj.work.own_code import MODELS

RATE, TURN = "_rate", "_turn"
_SENSORS = {
    mujoco.mjtJoint.mjJNT_HINGE: (mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtSensor.mjSENS_JOINTVEL),
    mujoco.mjtJoint.mjJNT_SLIDE: (mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtSensor.mjSENS_JOINTVEL),
    mujoco.mjtJoint.mjJNT_BALL: (mujoco.mjtSensor.mjSENS_BALLQUAT, mujoco.mjtSensor.mjSENS_BALLANGVEL),
}


def add_sensors(
    spec: mujoco.MjSpec, model: mujoco.MjModel, selection: Selection
) -> tuple[Selection, tuple[Notice, ...], mujoco.MjModel]:
    """The selection with sensors for all its outputs, and a word where they were not named.

    ``"joints"`` means the positions of all joints, and so does a model without sensors; ``<joint>`` and
    ``<joint>_rate`` those of one. A ball joint gives its quaternion, a free joint the position of its body and, as
    ``<joint>_turn``, its quaternion; ``.0`` and so on single entries. Sensors that the model lacks are added. Names
    that are neither a sensor nor a joint stay, for :func:`icmj.engine.linearisation.ports_of` to refuse. ``model`` is
    what the spec compiles to; the last that is returned is what it then compiles to.
    """
    told: tuple[Notice, ...] = ()
    if selection.outputs is None:
        if len(spec.sensors) or not len(spec.joints):
            return selection, (), model
        selection = replace(selection, outputs="joints")
        told = (Notice("outputs", "warning", 'the model has no sensors; its outputs are its joints ("joints")'),)
    joints = {joint.name or f"joint{i}": joint for i, joint in enumerate(spec.joints)}
    nameless = [joint for joint in joints.values() if not joint.name]
    for name, joint in joints.items():
        joint.name = name
    everything = selection.outputs == "joints"
    wanted = tuple(joints) if everything else selection.outputs
    assert wanted is not None
    known = {*output_names(model), *sensor_entries(model)}
    outputs: list[str] = []
    added: dict[tuple[str, bool], list[str]] = {}
    for name in (wanted,) if isinstance(wanted, str) else wanted:
        of, rate, turn, entry = _find_joint(name, joints)
        if (name in known and not everything) or of is None:
            outputs.append(name)
            continue
        if (of, rate) not in added:
            added[of, rate] = _add(spec, joints[of], rate, taken=known)
        labels = added[of, rate][1:] if turn else added[of, rate][:1] if entry else added[of, rate]
        outputs += [f"{label}{entry}" for label in labels]
    if nameless or added:
        model = spec.compile()
    return replace(selection, outputs=tuple(outputs), spare=everything), told, model


def _find_joint(name: str, joints: Mapping[str, object]) -> tuple[str | None, bool, bool, str]:
    """The joint that an output is of, whether its rate, whether its quaternion, and which entry, such as ".0"."""
    head, dot, number = (name, "", "") if name in joints else name.partition(".")
    for rate in (False, True):
        for turn in (False, True):
            joint = head.removesuffix(TURN) if turn else head
            joint = joint.removesuffix(RATE) if rate else joint
            if joint in joints and head == f"{joint}{RATE * rate}{TURN * turn}":
                return joint, rate, turn, f"{dot}{number}"
    return None, False, False, ""


def _add(spec: mujoco.MjSpec, joint: mujoco.MjsJoint, rate: bool, taken: set[str]) -> list[str]:
    kind, name = mujoco.mjtJoint(joint.type), f"{joint.name}{RATE}" if rate else str(joint.name)
    if kind != mujoco.mjtJoint.mjJNT_FREE:
        return [_sensor(spec, name, _SENSORS[kind][rate], mujoco.mjtObj.mjOBJ_JOINT, joint.name, taken)]
    body = joint.parent
    body.name = body.name or f"{joint.name}_body"
    pair = ("FRAMELINVEL", "FRAMEANGVEL") if rate else ("FRAMEPOS", "FRAMEQUAT")
    return [
        _sensor(spec, label, getattr(mujoco.mjtSensor, f"mjSENS_{sort}"), mujoco.mjtObj.mjOBJ_XBODY, body.name, taken)
        for label, sort in zip((name, f"{name}{TURN}"), pair, strict=True)
    ]


def _sensor(
    spec: mujoco.MjSpec, name: str, kind: mujoco.mjtSensor, sort: mujoco.mjtObj, of: str, taken: set[str]
) -> str:
    # a sensor of this name may already be there and show something else
    label = name if name not in taken else f"{name}_position"
    spec.add_sensor(name=label, type=kind, objtype=sort, objname=of)
    return label


# of a body that 1 N or 1 N m moves by 1 m/s² or 1 rad/s², and less of a heavier one: a slope that is rounding alone, in
# 1/s² or in units of an output; and the smallest feed-through that is one, for a position or velocity has exactly none
_NO_SLOPE, _D = 1e-8, 1e-9


def assess(model: mujoco.MjModel, linearisation: Linearisation) -> Quality:
    """Assess the operating point of ``linearisation``, which was made from ``model``.

    Raises:
        ModelError: if a derivative is not finite.
    """
    point, plant, ports = linearisation.point, linearisation.plant, linearisation.ports
    step = step_of(model, point)
    whole, half = (differences(model, point, eps) for eps in (step, step / 2))
    kept, rows, columns = ports.states, ports.entries, ports.actuators

    def matrices(found: Differences) -> tuple[Array, Array, Array]:
        """A, B and C at unit gains of the ports, which change nothing relative."""
        A, B = (ports.reduce(of[:, at].T).T for of, at in ((found.A, kept), (found.B, columns)))
        return np.ascontiguousarray(A), np.ascontiguousarray(B), found.C[np.ix_(rows, kept)]

    A, B, C = (_error(*pair) for pair in zip(matrices(whole), matrices(half), strict=True))
    names = plant.states, plant.inputs, plant.outputs
    slow, quick = (LinearPlant(*matrices(found), *names) for found in (whole, _at_half_step(model, point, step)))
    mobile = min(1.0, float(model.dof_invweight0.max(initial=0.0)) or 1.0)
    feedthrough = [
        name for name, row in zip(plant.outputs, linearisation.D, strict=True) if np.abs(row).max() > _D * mobile
    ]
    kinks = tuple(_kinks(model, linearisation, whole, half))
    return Quality(
        residual=_residual(model, whole),
        moving=tuple(state_names(model)[i] for i in np.flatnonzero(np.abs(point.qvel) > 1e-9)),
        errors=(A, B, C),
        kinks=kinks,
        friction=tuple(_rubbing(model, linearisation)),
        margins=tuple(_margins(model, linearisation)),
        room=tuple(_room(model, linearisation)),
        feedthrough=tuple(feedthrough),
        neutral=quality.neutral(plant),
        uncontrollable=quality.uncontrollable(plant),
        unobservable=quality.unobservable(plant),
        idle=quality.idle(plant),
        excesses=excesses(model, point, kept, rows, columns),
        dead=quality.dead(plant, _NO_SLOPE * mobile),
        step_effect=quality.compare_steps(slow, quick, float(model.opt.timestep)),
        raised=tuple(dict.fromkeys(_find_raised(model, linearisation))),
        undecided=() if kinks else quality.find_undecided(plant, max(A, B)),
    )


def _at_half_step(model: mujoco.MjModel, point: OperatingPoint, eps: float) -> Differences:
    halved = copy(model)
    halved.opt.timestep /= 2
    return differences(halved, point, eps)


def _error(whole: Array, half: Array) -> float:
    """Error of a centred difference from that over half the distance, relative to the largest entry."""
    size = float(np.abs(half).max(initial=0.0))
    return 4 / 3 * float(np.abs(whole - half).max()) / size if size > 0 else 0.0


def _residual(model: mujoco.MjModel, found: Differences) -> Residual:
    nv, names, units = model.nv, state_names(model), state_units(model)
    gravity = float(np.linalg.norm(model.opt.gravity)) or 9.81
    share = np.abs(found.rate) / np.where(np.arange(len(found.rate)) < nv, gravity, 1.0)
    i = leading(share)
    of, unit = (names[i], f"{units[i]}/s²") if i < nv else (names[nv + i], "1/s")
    return Residual(float(np.abs(found.rate[i])), of, unit, float(share[i]))


def _kinks(
    model: mujoco.MjModel, linearisation: Linearisation, whole: Differences, half: Differences
) -> Iterator[Kink]:
    """Kinks: the difference of one-sided slopes stays when the step is halved; on a smooth curve it halves."""
    ports, nv, rates = linearisation.ports, model.nv, len(half.rate)
    n, names = nv + rates, output_names(model)
    bend = _bends(whole, half, ports.states[ports.states >= nv] - nv, n)
    for i in ports.actuators[bend[n + ports.actuators] > 0]:
        yield Kink(input_names(model)[i], "input", float(bend[n + i]), _why_input(model, int(i), linearisation))
    for i in ports.states[bend[ports.states] > 0]:
        why = "a joint limit, a contact or dry friction begins there; move the operating point away from it"
        yield Kink(state_names(model)[i], "state", float(bend[i]), why)
    for entry in ports.entries:
        bend = _bends(whole, half, np.array([rates + entry]), n)
        for i in ports.states[bend[ports.states] > 0]:
            why = (
                f"output {names[entry]!r} has a corner there, such as its cutoff; move the operating point away from it"
            )
            yield Kink(state_names(model)[i], "state", float(bend[i]), why)


def _bends(whole: Differences, half: Differences, rows: Array, n: int) -> Array:
    """The disagreement of one-sided slopes of ``rows``, relative to the larger, of each column that has a kink; else 0.

    A column that is zero but for rounding, beside others of the n states or of the inputs, bends by nothing.
    """
    if not len(rows):
        return np.zeros(half.right.shape[1])
    size = np.maximum(np.abs(half.right[rows]), np.abs(half.left[rows])).max(axis=0)
    least = np.repeat([part.max(initial=0.0) for part in (size[:n], size[n:])], [n, len(size) - n]) * 1e-6
    coarse, fine = (np.abs(found.right - found.left)[rows].max(axis=0) for found in (whole, half))
    bend = fine / np.maximum(np.maximum(size, least), _NO_SLOPE)
    return np.where((bend > BENT) & (fine > 0.75 * coarse), bend, 0.0)


def _why_input(model: mujoco.MjModel, i: int, linearisation: Linearisation) -> str:
    ctrl, (low, high) = linearisation.point.ctrl[i], model.actuator_ctrlrange[i]
    if model.actuator_ctrllimited[i] and (ctrl <= low + EPS or ctrl >= high - EPS):
        return f"its control {ctrl:g} is at an end of its ctrlrange {low:g} to {high:g}; operate it inside"
    if model.actuator_actlimited[i]:
        act, (low, high) = linearisation.point.act[model.actuator_actadr[i]], model.actuator_actrange[i]
        if act <= low + EPS or act >= high - EPS:
            return f"its activation {act:g} is at an end of its actrange {low:g} to {high:g}; operate it inside"
    if model.actuator_dyntype[i] == mujoco.mjtDyn.mjDYN_MUSCLE:
        if 0 < ctrl < 1 and model.actuator_dynprm[i, 2] == 0:
            return f"a muscle at excitation {ctrl:g} rises and falls at different rates; give it a tausmooth"
        return f"a muscle at excitation {ctrl:g} can only go one way; give it a tonic excitation within 0 to 1"
    return "its force is at a limit, or its law has a corner there; operate it elsewhere"


def _rubbing(model: mujoco.MjModel, linearisation: Linearisation) -> Iterator[str]:
    """Degrees of freedom and tendons that the engine holds by dry friction at the operating point."""
    data, names = data_at(model, linearisation.point), state_names(model)
    with isolate_engine():
        mujoco.mj_forward(model, data)
    for kind, i in zip(data.efc_type, data.efc_id, strict=True):
        if kind == mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF:
            yield names[i]
        elif kind == mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON:
            yield f"tendon {model.tendon(i).name or i}"


_CONSTRAINTS = {
    mujoco.mjtConstraint.mjCNSTR_EQUALITY: ("equality", "equality {}", "eq_solref"),
    mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF: ("dof", "the dry friction of {}", "dof_solref"),
    mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON: ("tendon", "the dry friction of tendon {}", "tendon_solref_fri"),
    mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT: ("joint", "the limit of joint {}", "jnt_solref"),
    mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON: ("tendon", "the limit of tendon {}", "tendon_solref_lim"),
}


def _find_raised(model: mujoco.MjModel, linearisation: Linearisation) -> Iterator[Raised]:
    """Constraints at the operating point whose time constant is less than two steps, and which the engine softens."""
    data, taken = data_at(model, linearisation.point), 2 * float(model.opt.timestep)
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_REFSAFE:
        return
    with isolate_engine():
        mujoco.mj_forward(model, data)
    for kind, i in dict.fromkeys(zip(data.efc_type.tolist(), data.efc_id.tolist(), strict=True)):
        if (sort := _CONSTRAINTS.get(mujoco.mjtConstraint(kind))) is not None:
            element, words, array = sort
            solref = getattr(model, array)[i]
            name = state_names(model)[i] if element == "dof" else getattr(model, element)(i).name or str(i)
        else:  # a contact, of whose geoms the engine has mixed them
            solref, pair = data.contact[i].solref, data.contact[i].geom
            name, words = " and ".join(model.geom(j).name or f"geom{j}" if j >= 0 else "flex" for j in pair), "{}"
        if 0 < solref[0] < taken and solref[1] > 0:  # others are stiffness and damping themselves
            yield Raised(words.format(name), float(solref[0]), taken)


def _margins(model: mujoco.MjModel, linearisation: Linearisation) -> Iterator[Margin]:
    for i in linearisation.ports.actuators:
        if model.actuator_ctrllimited[i]:
            ctrl, (low, high) = linearisation.point.ctrl[i], model.actuator_ctrlrange[i]
            yield Margin(input_names(model)[i], float(ctrl - low), float(high - ctrl))


def _room(model: mujoco.MjModel, linearisation: Linearisation) -> Iterator[Margin]:
    names, kept = state_names(model), set(linearisation.ports.states)
    for i in find_limited(model):
        if i in kept:
            joint = model.dof_jntid[i]
            at, (low, high) = linearisation.point.qpos[model.jnt_qposadr[joint]], model.jnt_range[joint]
            yield Margin(names[i], float(at - low), float(high - at))


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
        return replace(point, act=without_muscles(self.model, self.muscles, point.act))

    @property
    def states(self) -> tuple[str, ...]:
        """All states of the model, including those that the plant leaves out."""
        return state_names(self.model)

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
        ModelError: see :func:`icmj.engine.model.load_spec`, :func:`icmj.engine.linearisation.ports_of`,
            :func:`icmj.engine.operating_point.equilibria`, :func:`icmj.engine.linearisation.linearise` and
            :mod:`icmj.engine.safety`.
    """
    path, rule = MODELS.meant(Path(path)), operating or OperatingRule()
    with sound(path):
        inputs = selection.inputs if selection else None
        spec, model = load_model(path, deviation, person, activation, inputs)
        check_names(path, spec)
        chosen, told, model = add_sensors(spec, model, selection or Selection())
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
        points = _say_where(path, equilibria(model, given, rule))
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
        ModelError: see :func:`icmj.engine.model.load_spec` and :mod:`icmj.engine.safety`.
    """
    with sound(path):
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
    for i, v in still(linear.A, np.intersect1d(there, positions), np.setdiff1d(positions, there)).items():
        V[:, there.index(i)] = v
    shown = np.abs(linear.C @ V).max(axis=1, initial=0.0) > 1e-9
    if not there or (shown.any() and not chosen.spare):
        return plant
    outputs = chosen.outputs
    if chosen.spare:  # what is left may show nothing, as the first entry of a quaternion
        shows = ~shown & (np.abs(linear.C).max(axis=1) > 1e-9)
        outputs = tuple(name for name, shows in zip(linear.outputs, shows, strict=True) if shows)
    ports = ports_of(model, replace(chosen, outputs=outputs, drop=drop), deviation)
    kept = replace(plant, linearisation=linearise(model, ports=ports, point=plant.linearisation.point))
    return kept if chosen.drop else replace(kept, told=(*plant.told, notice_omission(linear, drop)))


def _say_along(plant: MujocoPlant, model: mujoco.MjModel) -> MujocoPlant:
    """The plant, with a notice of what goes along with states that are left out."""
    names, ports = state_names(model), plant.linearisation.ports
    told = []
    for i, v in zip(ports.left, ports.still, strict=True):
        far = [j for j in np.argsort(-np.abs(v), kind="stable") if j != i and abs(v[j]) > 1e-6]
        others = "".join(f" {'-' if v[j] < 0 else '+'} {abs(v[j]):.2g} {names[j]}" for j in far)
        words = f"with {names[i]} the direction {names[i]}{others} is left out, on which nothing depends"
        told.append(Notice("dropped state", "warning", words))
    return replace(plant, told=(*plant.told, *told)) if told else plant


_UNITS = {mujoco.mjtJoint.mjJNT_HINGE: "rad", mujoco.mjtJoint.mjJNT_SLIDE: "m"}


@dataclass(frozen=True)
class Inventory:
    """Names in the model's order; quantities are mapped to their units, "" where the unit is unknown.

    Attributes:
        keyframes, bodies: names.
        inputs, outputs, joints: names and units; an output is one entry of a sensor.
        driven: joints that an actuator drives by itself.
        timestep: the model's own [s].
    """

    keyframes: tuple[str, ...]
    inputs: dict[str, str]
    outputs: dict[str, str]
    joints: dict[str, str]
    bodies: tuple[str, ...]
    driven: tuple[str, ...]
    timestep: float


def inventory(path: Path) -> Inventory:
    """The selectable elements of the model in an MJCF file.

    Raises:
        ModelError: if it cannot be loaded; see :func:`icmj.engine.model.load_model`.
    """
    with sound(path):
        spec, model = load_model(path)
        check_names(path, spec)
        check_sizes(path, model)
    return Inventory(
        tuple(model.key(i).name for i in range(model.nkey) if model.key(i).name),
        dict(zip(input_names(model), input_units(model), strict=True)),
        dict(zip(output_names(model), output_units(model), strict=True)),
        {
            model.joint(i).name or f"joint{i}": _UNITS.get(mujoco.mjtJoint(model.jnt_type[i]), "")
            for i in range(model.njnt)
        },
        tuple(model.body(i).name for i in range(1, model.nbody) if model.body(i).name),
        tuple(
            model.joint(int(model.actuator_trnid[i, 0])).name
            for i in range(model.nu)
            if model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT
        ),
        float(model.opt.timestep),
    )
