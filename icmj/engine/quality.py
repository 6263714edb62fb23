"""The quality of a plant's operating point, measured on its model."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy

import mujoco
import numpy as np

from icmj.base.array import Array, argmax_abs
from icmj.engine.bounds import find_excesses
from icmj.engine.isolation import isolate_engine
from icmj.engine.joint_room import find_limited
from icmj.engine.linearisation import (
    EPS,
    Differences,
    Linearisation,
    difference_model,
    step_of,
)
from icmj.engine.model import (
    OperatingPoint,
    make_data,
    name_inputs,
    name_outputs,
    name_states,
)
from icmj.engine.units import name_state_units
from icmj.plant import quality
from icmj.plant.linear_plant import LinearPlant
from icmj.plant.quality import BENT, Kink, Margin, Quality, Raised, Residual

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
    whole, half = (difference_model(model, point, eps) for eps in (step, step / 2))
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
        moving=tuple(name_states(model)[i] for i in np.flatnonzero(np.abs(point.qvel) > 1e-9)),
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
        excesses=find_excesses(model, point, kept, rows, columns),
        dead=quality.dead(plant, _NO_SLOPE * mobile),
        step_effect=quality.compare_steps(slow, quick, float(model.opt.timestep)),
        raised=tuple(dict.fromkeys(_find_raised(model, linearisation))),
        undecided=() if kinks else quality.find_undecided(plant, max(A, B)),
    )


def _at_half_step(model: mujoco.MjModel, point: OperatingPoint, eps: float) -> Differences:
    halved = copy(model)
    halved.opt.timestep /= 2
    return difference_model(halved, point, eps)


def _error(whole: Array, half: Array) -> float:
    """Error of a centred difference from that over half the distance, relative to the largest entry."""
    size = float(np.abs(half).max(initial=0.0))
    return 4 / 3 * float(np.abs(whole - half).max()) / size if size > 0 else 0.0


def _residual(model: mujoco.MjModel, found: Differences) -> Residual:
    nv, names, units = model.nv, name_states(model), name_state_units(model)
    gravity = float(np.linalg.norm(model.opt.gravity)) or 9.81
    share = np.abs(found.rate) / np.where(np.arange(len(found.rate)) < nv, gravity, 1.0)
    i = argmax_abs(share)
    of, unit = (names[i], f"{units[i]}/s²") if i < nv else (names[nv + i], "1/s")
    return Residual(float(np.abs(found.rate[i])), of, unit, float(share[i]))


def _kinks(
    model: mujoco.MjModel, linearisation: Linearisation, whole: Differences, half: Differences
) -> Iterator[Kink]:
    """Kinks: the difference of one-sided slopes stays when the step is halved; on a smooth curve it halves."""
    ports, nv, rates = linearisation.ports, model.nv, len(half.rate)
    n, names = nv + rates, name_outputs(model)
    bend = _bends(whole, half, ports.states[ports.states >= nv] - nv, n)
    for i in ports.actuators[bend[n + ports.actuators] > 0]:
        yield Kink(name_inputs(model)[i], "input", float(bend[n + i]), _why_input(model, int(i), linearisation))
    for i in ports.states[bend[ports.states] > 0]:
        why = "a joint limit, a contact or dry friction begins there; move the operating point away from it"
        yield Kink(name_states(model)[i], "state", float(bend[i]), why)
    for entry in ports.entries:
        bend = _bends(whole, half, np.array([rates + entry]), n)
        for i in ports.states[bend[ports.states] > 0]:
            why = (
                f"output {names[entry]!r} has a corner there, such as its cutoff; move the operating point away from it"
            )
            yield Kink(name_states(model)[i], "state", float(bend[i]), why)


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
    data, names = make_data(model, linearisation.point), name_states(model)
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
    data, taken = make_data(model, linearisation.point), 2 * float(model.opt.timestep)
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_REFSAFE:
        return
    with isolate_engine():
        mujoco.mj_forward(model, data)
    for kind, i in dict.fromkeys(zip(data.efc_type.tolist(), data.efc_id.tolist(), strict=True)):
        if (sort := _CONSTRAINTS.get(mujoco.mjtConstraint(kind))) is not None:
            element, words, array = sort
            solref = getattr(model, array)[i]
            name = name_states(model)[i] if element == "dof" else getattr(model, element)(i).name or str(i)
        else:  # a contact, of whose geoms the engine has mixed them
            solref, pair = data.contact[i].solref, data.contact[i].geom
            name, words = " and ".join(model.geom(j).name or f"geom{j}" if j >= 0 else "flex" for j in pair), "{}"
        if 0 < solref[0] < taken and solref[1] > 0:  # others are stiffness and damping themselves
            yield Raised(words.format(name), float(solref[0]), taken)


def _margins(model: mujoco.MjModel, linearisation: Linearisation) -> Iterator[Margin]:
    for i in linearisation.ports.actuators:
        if model.actuator_ctrllimited[i]:
            ctrl, (low, high) = linearisation.point.ctrl[i], model.actuator_ctrlrange[i]
            yield Margin(name_inputs(model)[i], float(ctrl - low), float(high - ctrl))


def _room(model: mujoco.MjModel, linearisation: Linearisation) -> Iterator[Margin]:
    names, kept = name_states(model), set(linearisation.ports.states)
    for i in find_limited(model):
        if i in kept:
            joint = model.dof_jntid[i]
            at, (low, high) = linearisation.point.qpos[model.jnt_qposadr[joint]], model.jnt_range[joint]
            yield Margin(names[i], float(at - low), float(high - at))
