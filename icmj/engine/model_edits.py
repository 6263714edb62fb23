"""Edits of a model before it is compiled: inertia, lengths, and what follows from them, written out."""

from __future__ import annotations

import mujoco
import numpy as np


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
