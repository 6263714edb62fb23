"""Changes of a model before it is compiled: those of the actual plant, and the measures of a person.

The deviation of the actual plant from a model: a set of changes, applied before it is compiled.

A model of shank, thigh and trunk, with or without a foot, scaled to the body measures of a person.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.errors import ModelError
from icmj.plant.body import Change, What
from icmj.plant.person import ANKLE_HEIGHT, SEGMENTS, Person


def write_inertia(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Write the inertia of ``model``, as which the spec compiles, into every body, to be changed without its geoms."""
    model = _as_written(spec, model)
    for body in spec.bodies:
        index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body.name) if body.name else int(body.id)
        if index <= 0 or not model.body_mass[index] > 0:
            continue
        body.explicitinertial = True
        body.mass, body.inertia = float(model.body_mass[index]), model.body_inertia[index]
        body.ipos, body.iquat = model.body_ipos[index], model.body_iquat[index]
        body.fullinertia = [np.nan, 0, 0, 0, 0, 0]
        body.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    compiler = spec.compiler
    compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    # what these do is done, and would undo a change
    compiler.settotalmass, compiler.boundmass, compiler.boundinertia, compiler.balanceinertia = -1, 0, 0, False


def _as_written(spec: mujoco.MjSpec, model: mujoco.MjModel) -> mujoco.MjModel:
    """``model`` with free bodies in the frames of the file: another, where the compiler aligns some with inertia."""
    no, by_default = mujoco.mjtAlignFree.mjALIGNFREE_FALSE, mujoco.mjtAlignFree.mjALIGNFREE_AUTO
    if not spec.compiler.alignfree and all(joint.align in (no, by_default) for joint in spec.joints):
        return model
    plain = spec.copy()
    plain.compiler.alignfree = False
    for joint in plain.joints:
        joint.align = no
    return plain.compile()


ANCHOR = "icmj_anchor"


def write_derived(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Write what the compiler derives of inertia, lengths and ranges into the spec, as ``model`` has it.

    A change then leaves it as it was: the stiffness of joints with ``springdamper``, the damping of servos with
    ``dampratio``, the peak force of muscles without ``force``, length ranges, inherited ranges of control, rest lengths
    of tendons, and where welds and connections hold. What keeps following inertia is how soft a constraint is, which
    the engine defines relative to it. ``model`` is what the spec compiles to.
    """
    for i, joint in enumerate(spec.joints):
        if joint.springdamper[0] > 0:
            dof = model.jnt_dofadr[i]
            joint.stiffness = [model.jnt_stiffness[i], *np.asarray(joint.stiffness)[1:]]
            joint.damping = [model.dof_damping[dof], *np.asarray(joint.damping)[1:]]
            joint.springdamper = [0, 0]
    for i, tendon in enumerate(spec.tendons):
        tendon.springlength = model.tendon_lengthspring[i]
    for i, actuator in enumerate(spec.actuators):
        _write_actuator(actuator, model, i)
    spec.compiler.LRopt.useexisting = True
    plain = _as_written(spec, model) if len(spec.equalities) else model
    for i, equality in enumerate(spec.equalities):
        if equality.objtype != mujoco.mjtObj.mjOBJ_BODY:
            continue
        if equality.type == mujoco.mjtEq.mjEQ_WELD:
            equality.data = model.eq_data[i]
        elif equality.type == mujoco.mjtEq.mjEQ_CONNECT:
            _write_connection(spec, equality, model, plain, i)


def _write_actuator(actuator: mujoco.MjsActuator, model: mujoco.MjModel, i: int) -> None:
    first = int(model.actuator_outadr[i])
    low, high = model.actuator_lengthrange[first]
    if low < high:
        actuator.lengthrange = [low, high]
    if actuator.inheritrange > 0:
        if actuator.dyntype == mujoco.mjtDyn.mjDYN_INTEGRATOR:
            actuator.actrange = model.actuator_actrange[i]
        else:
            actuator.ctrlrange = model.actuator_ctrlrange[model.actuator_ctrladr[i]]
        actuator.inheritrange = 0.0
    gain, bias = model.actuator_gainprm[i].copy(), model.actuator_biasprm[i].copy()
    muscular = (
        (gain, model.actuator_gaintype[i] == mujoco.mjtGain.mjGAIN_MUSCLE),
        (bias, model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_MUSCLE),
    )
    for prm, is_muscle in muscular:
        if is_muscle and prm[2] < 0:  # no peak force: it is the scale over the acceleration by a unit force
            prm[2] = prm[3] / max(mujoco.mjMINVAL, model.actuator_acc0[first])
    actuator.gainprm, actuator.biasprm = gain, bias


def _write_connection(
    spec: mujoco.MjSpec, equality: mujoco.MjsEquality, model: mujoco.MjModel, plain: mujoco.MjModel, i: int
) -> None:
    """Connect sites where the bodies are connected: the second place has no attribute of its own."""
    ends = (equality.name1, int(model.eq_obj1id[i])), (equality.name2, int(model.eq_obj2id[i]))
    names = []
    for end, (name, body) in enumerate(ends):
        place = model.eq_data[i, 3 * end : 3 * end + 3].copy()
        if not np.array_equal(model.body_pos[body], plain.body_pos[body]):  # aligned: from its frame to the file's
            turned, back = np.zeros(3), np.zeros(4)
            mujoco.mju_rotVecQuat(turned, place, model.body_quat[body])
            mujoco.mju_negQuat(back, plain.body_quat[body])
            mujoco.mju_rotVecQuat(place, model.body_pos[body] + turned - plain.body_pos[body], back)
        names.append(f"{ANCHOR}_{i}_{end}")
        of = spec.body(name) if name and body else spec.worldbody
        of.add_site(name=names[-1], pos=place, group=5)
    equality.name1, equality.name2 = names
    equality.objtype, equality.data = mujoco.mjtObj.mjOBJ_SITE, np.zeros_like(equality.data)


def lengthen(body: mujoco.MjsBody, factor: float) -> None:
    """Scale everything placed in the body's frame about its origin; the mass stays, inertia scales with the square."""
    sites = [site for site in body.sites if not site.name.startswith(ANCHOR)]
    for thing in (*body.bodies, *body.joints, *sites, *body.frames, *body.cameras, *body.lights):
        thing.pos = np.asarray(thing.pos) * factor
    for item in (*body.geoms, *sites):
        item.size = np.asarray(item.size) * factor
        item.fromto = np.asarray(item.fromto) * factor
    for geom in body.geoms:
        geom.pos = np.asarray(geom.pos) * factor
    if body.mass > 0:
        body.ipos = np.asarray(body.ipos) * factor
        body.inertia = np.asarray(body.inertia) * factor**2


_OUTSIDE = ("input_gain", "sensor_gain", "sensor_bias")  # not in the model but at the plant's ports
_INERTIAL = ("mass", "inertia", "centre_of_mass", "length")
_PASSIVE = ("stiffness", "damping", "armature")

Edit = Callable[[mujoco.MjSpec, float], object]
"""A change of a model in code: of its spec, by ρ: 0 none of it, 1 all."""


@dataclass(frozen=True)
class Deviation:
    """The deviation of the actual plant from an MJCF model; by default there is none.

    Attributes:
        gain: b, the input gain of all inputs (one number), or of each input in the order of their selection; an
            abbreviation for changes of ``input_gain``.
        dynprm: replacements for ``dynprm`` of the named actuators; an abbreviation for changes of ``dynprm``.
        rho: ρ, the scale of every change: 0 for none, 1 for the whole change.
        changes: other changes, by name.
        edit: any other change of the model: a function of its spec and ρ, which is called last.
    """

    gain: float | Sequence[float] = 1.0
    dynprm: Mapping[str, Sequence[float]] = field(default_factory=dict)
    rho: float = 1.0
    changes: tuple[Change, ...] = ()
    edit: Edit | None = None

    def apply(self, spec: mujoco.MjSpec, model: mujoco.MjModel, name: str) -> mujoco.MjModel:
        """Apply the changes to the spec, except those of inputs and sensors, which are applied there.

        ``model`` is what the spec compiles to; returns what it then compiles to.

        Raises:
            ModelError: if the model has no element of a given name, or a number does not fit; the message begins with
                ``name``.
        """
        short = [Change("dynprm", actuator, value=tuple(values)) for actuator, values in self.dynprm.items()]
        inside = [change for change in (*short, *self.changes) if change.what not in _OUTSIDE]
        if inside or self.edit is not None:
            write_derived(spec, model)
        if self.edit is not None or any(change.what in _INERTIAL for change in inside):
            write_inertia(spec, model)
        for change in inside:
            try:
                _apply(spec, change, self.rho)
            except (ValueError, mujoco.FatalError) as error:
                raise ModelError(f"{name}: change of {change.what}: {' '.join(str(error).split())}") from error
            except ModelError as error:
                raise ModelError(f"{name}: {error}") from error
        if self.edit is not None:
            try:
                self.edit(spec, self.rho)
            except (Exception, SystemExit) as error:  # whatever the user's code raises
                raise ModelError(f"{name}: edit: {type(error).__name__}: {' '.join(str(error).split())}") from error
        if not inside and self.edit is None:
            return model
        try:
            return spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            reason = " ".join(str(error).split())
            raise ModelError(f"{name}: the changed model does not compile: {reason}") from error

    def input_gains(self, inputs: Sequence[str], chosen: Sequence[int], name: str) -> Array:
        """Input gain b of each actuator that is ``chosen`` from ``inputs``, in this order, shape (n_u,).

        Raises:
            ModelError: if the number of gains, or a name, does not fit.
        """
        gain = np.asarray(self.gain, dtype=float)
        if gain.ndim > 1 or (gain.ndim == 1 and gain.size != len(chosen)):
            raise ModelError(
                f"{name}: gain has {gain.size} entries for {len(chosen)} inputs, {', '.join(inputs[i] for i in chosen)}"
            )
        b = np.ones(len(inputs))
        b[list(chosen)] = 1 + self.rho * (gain - 1)
        places = {label: (i,) for i, label in enumerate(inputs)}
        return self._ports("input_gain", b, places, "actuator", name)[list(chosen)]

    def sensor_errors(
        self, outputs: Sequence[str], sensors: Mapping[str, Sequence[int]], name: str
    ) -> tuple[Array, Array]:
        """Gain g and bias β of each entry of ``sensordata``; changes name a sensor or one entry of it.

        Raises:
            ModelError: if there is no sensor of a given name, or a gain is zero.
        """
        places = {**{label: (i,) for i, label in enumerate(outputs)}, **sensors}
        g = self._ports("sensor_gain", np.ones(len(outputs)), places, "sensor", name)
        if not g.all():
            raise ModelError(f"{name}: a sensor gain of 0 leaves nothing to observe; leave the output out instead")
        return g, self._ports("sensor_bias", np.zeros(len(outputs)), places, "sensor", name)

    def _ports(self, what: What, values: Array, places: Mapping[str, Sequence[int]], kind: str, name: str) -> Array:
        values = values.copy()
        for change in self.changes:
            if change.what == what:
                if change.of is not None and change.of not in places:
                    known = ", ".join(filter(None, places))
                    raise ModelError(f"{name}: no {kind} {change.of!r} to change; it has {known}")
                at = list(range(len(values)) if change.of is None else places[change.of])
                if isinstance(change.value, Sequence):  # a list is for the entries of one sensor
                    try:
                        values[at] = change(values[at], self.rho)
                    except ModelError as error:
                        raise ModelError(f"{name}: {error}") from error
                else:
                    values[at] = [change(value, self.rho) for value in values[at]]
        return values


def _apply(spec: mujoco.MjSpec, change: Change, rho: float) -> None:
    if change.what == "gravity":
        spec.option.gravity = change(spec.option.gravity, rho)
        return
    if change.what in _INERTIAL:
        known = [(body.name, body) for body in spec.bodies if body.name != "world"]
        verb: Callable[..., None] = {"mass": _mass, "inertia": _inertia, "centre_of_mass": _com, "length": _length}[
            change.what
        ]
        for body in _choose(change, known, "body", lambda body: body.mass > 0):
            verb(body, change, rho)
        return
    if change.what in _PASSIVE:
        kind = "joint, tendon or actuator" if change.what != "stiffness" else "joint or tendon"
        things = [*spec.joints, *spec.tendons, *(spec.actuators if change.what != "stiffness" else ())]
        if change.of is None and change.factor is None:  # a number with a unit fits one kind
            things = list(spec.joints)
    else:
        things, kind = list(spec.actuators), "actuator"
    for thing in _choose(change, [(thing.name, thing) for thing in things], kind, lambda thing: True):
        before = getattr(thing, change.what)
        setattr(thing, change.what, change(before, rho) if np.ndim(before) else float(change(before, rho)))


def _choose(change: Change, known: list, kind: str, where: Callable) -> list:
    """The selected entries; of several with the same name, the first."""
    if change.of is None:
        return [thing for _, thing in known if where(thing)]
    found = [thing for name, thing in known if name == change.of]
    if not found:
        names = ", ".join(filter(None, dict(known)))
        raise ModelError(f"no {kind} {change.of!r} to change; it has {names}")
    if not where(found[0]):
        raise ModelError(f"{kind} {change.of!r} has no mass of its own to change")
    return found[:1]


def _mass(body: mujoco.MjsBody, change: Change, rho: float) -> None:
    before = float(body.mass)
    body.mass = float(change(before, rho))
    body.inertia = np.asarray(body.inertia) * (body.mass / before)


def _inertia(body: mujoco.MjsBody, change: Change, rho: float) -> None:
    body.inertia = change(body.inertia, rho)


def _com(body: mujoco.MjsBody, change: Change, rho: float) -> None:
    body.ipos = change(body.ipos, rho)


def _length(body: mujoco.MjsBody, change: Change, rho: float) -> None:
    lengthen(body, float(change(1.0, rho)))


JOINTS = ("ankle", "knee", "hip")


def shape(spec: mujoco.MjSpec, model: mujoco.MjModel, person: Person, name: str) -> mujoco.MjModel:
    """Give the bodies ``shank``, ``thigh`` and ``trunk`` of ``spec`` the measures of ``person``, upwards along z.

    What is placed on a body (geoms, sites) grows with it. The joints ``ankle``, ``knee`` and ``hip`` get its passive
    torque. A body ``foot`` gets its mass and length; ``feet``, which is fixed, and a floor named ``floor`` only follow
    the height. ``model`` is what the spec compiles to; returns what it then compiles to.

    Raises:
        ModelError: if the model lacks one of the bodies or joints; it begins with ``name``.
    """
    bodies = {body.name: body for body in spec.bodies}
    joints = {joint.name: joint for joint in spec.joints}
    missing = [f"body {b!r}" for b in SEGMENTS if b not in bodies] + [f"joint {j!r}" for j in JOINTS if j not in joints]
    if missing:
        raise ModelError(f"{name}: a person is put into a model of shank, thigh and trunk; it has no {missing[0]}")
    write_derived(spec, model)
    write_inertia(spec, model)
    names = list(SEGMENTS)
    for body, above in zip(names, (*names[1:], None), strict=True):
        known = bodies[above].pos[2] if above else bodies[body].ipos[2]
        wanted = person.length_of(body) if above else person.com_of(body)
        _measure(bodies[body], wanted / float(known), person, body)
        if above:
            bodies[above].pos = [0, 0, person.length_of(body)]
    _stand(spec, bodies, person)
    for j, (joint, G) in enumerate(zip(JOINTS, person.toppling_stiffness(_gravity(spec)), strict=True)):
        joints[joint].stiffness = [person.stiffness[j] * G, *np.asarray(joints[joint].stiffness)[1:]]
        joints[joint].damping = [person.damping * G, *np.asarray(joints[joint].damping)[1:]]
    return spec.compile()


def _measure(body: mujoco.MjsBody, factor: float, person: Person, name: str) -> None:
    """Scale the elements of the body and set its mass; the inertia across the plane of sway scales in proportion."""
    lengthen(body, factor)
    inertia = np.asarray(body.inertia, dtype=float)
    body.ipos = [0, 0, person.com_of(name)]
    body.inertia = inertia * (person.inertia_of(name) / inertia[1])
    body.mass = person.mass_of(name)


def _stand(spec: mujoco.MjSpec, bodies: dict[str, mujoco.MjsBody], person: Person) -> None:
    """Feet and floor: the floor lies where the ankle's height above it is the person's."""
    floor = next((geom for geom in spec.geoms if geom.name == "floor"), None)
    if floor is None or not floor.pos[2] < 0:
        return
    factor = -ANKLE_HEIGHT * person.height / float(floor.pos[2])
    floor.pos = [floor.pos[0], floor.pos[1], -ANKLE_HEIGHT * person.height]
    for name in ("feet", "foot"):
        if name not in bodies:
            continue
        foot = bodies[name]
        lengthen(foot, factor)
        if name == "foot":
            inertia = np.asarray(foot.inertia)
            foot.mass = person.mass_of(name)
            foot.inertia = inertia * (person.inertia_of(name) / inertia[1])


def _gravity(spec: mujoco.MjSpec) -> float:
    return float(np.linalg.norm(spec.option.gravity))
