"""The equilibrium near a pose: controls, and positions of the free joints, with zero accelerations.

At rest the force that each degree of freedom needs, by inverse dynamics, is what the actuators give, and activations
stand still. Newton's method solves these equations for control, activation and free joints; where they leave a choice,
effort is least: the sum of squares of what the actuators give, less what the controls given do, as a share of the
range of each or, without one, as torque beside the weight. A body on a floor is first set down until contacts bear it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from icmj.base.array import Array, argmax_abs
from icmj.base.blas_threads import limit_to_one_thread
from icmj.engine.activations import free_activation_rates
from icmj.engine.isolation import isolate_engine
from icmj.engine.joint_room import Room, list_starts
from icmj.engine.model import OperatingPoint, get_model_name, make_data, name_inputs, name_states
from icmj.engine.pose_rule import apply_pose, find_vertical, list_ways, soften
from icmj.engine.units import name_state_units
from icmj.errors import ModelError
from icmj.plant.body import OperatingRule

_EPS = 1e-6  # half the distance of a difference
_STEPS = 100
_REST = 1e-11  # of the weight: forces that are none
_HELD = 1e-7  # of the weight: forces that the solver may leave, before balance is given up
_EFFORT = 1e-2  # how much effort counts beside balance, where both are sought at once
_HOLD = 1e-4  # how much leaving where a last round begins counts beside it
_END = 1e-3  # from an end of its room [rad, m], a joint is at it
_STAY = 1e-3  # how little a joint's change counts beside a force of the whole weight


def find_equilibria(model: mujoco.MjModel, given: OperatingPoint, rule: OperatingRule) -> Iterator[OperatingPoint]:
    """The operating points that ``rule`` makes of ``given``, the nearest first.

    There is one, but for a balance, which may lie at the end of a range: then one is sought from bent joints.

    Raises:
        ModelError: if a free joint does not exist, or nothing can hold the model at rest; it says what is left over.
    """
    given = apply_pose(model, given, rule)
    if rule.kind in ("as given", "found"):
        yield given
    if rule.kind == "as given":
        return
    failed, found = None, False
    for moving in list_ways(model, rule):
        for start, room in list_starts(model, given, rule, moving):
            try:
                yield _Search(model, start, rule, moving, room).run()
                found = True
            except ModelError as error:  # straight joints may end at a kink, from where bent ones do not
                failed = failed or error
    if failed and not found:
        raise failed


@dataclass(frozen=True, eq=False)
class _Forces:
    """Forces at rest: left over on each degree of freedom, shape (nv,); of the actuators, (nu,); act_dot, (na,)."""

    left: Array
    actuator: Array
    act_dot: Array


class _Search:
    """Newton's method on z = (free positions, controls, activations), as departures from the given values."""

    def __init__(
        self, model: mujoco.MjModel, given: OperatingPoint, rule: OperatingRule, moving: np.ndarray, room: Room
    ) -> None:
        self.model, self.given, self.rule = model, given, rule
        self.data = make_data(model, given)
        self.free, self.room = moving, room
        self.fixed = np.zeros(model.nu, dtype=bool)  # controls at an end of their range
        self.weight = float(model.body_mass.sum() * np.linalg.norm(model.opt.gravity)) or 1.0
        self.z, self.size = np.zeros(model.nv + model.nu + model.na), np.ones(model.nu)
        self.lag = np.ones(model.na)  # time constants of the activations [s]
        low, high = model.actuator_ctrlrange.T
        limited = model.actuator_ctrllimited.astype(bool)
        self.low, self.high = np.where(limited, low, -np.inf), np.where(limited, high, np.inf)
        muscle = model.actuator_dyntype == mujoco.mjtDyn.mjDYN_MUSCLE
        self.low[muscle], self.high[muscle] = np.maximum(self.low[muscle], 0), np.minimum(self.high[muscle], 1)

    def run(self) -> OperatingPoint:
        flags = int(self.model.opt.disableflags)
        # the search may pass beyond a range on its way
        self.model.opt.disableflags = flags | int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
        try:
            with limit_to_one_thread(), isolate_engine():
                self.wanted = self.forces(self.z).actuator if self.given.ctrl.any() else np.zeros(self.model.nu)
                self.lag, self.size = self.lags(), self.sizes()
                self.set_down()
                for _ in range(self.model.nu + 1):
                    self.solve()
                    if not self.held() or self.is_cramped():
                        self.approach()
                    beyond = self.beyond()
                    if not beyond.any():
                        break
                    self.fixed |= beyond
                    ctrl = self.z[self.model.nv :][: self.model.nu]
                    ends = np.clip(self.given.ctrl + ctrl, self.low, self.high) - self.given.ctrl
                    ctrl[beyond] = ends[beyond]
                self.check()
        finally:
            self.model.opt.disableflags = flags
        point = self.place(self.z)
        still = 0 * self.given.qvel
        return replace(self.given, qpos=point.qpos.copy(), qvel=still, act=point.act.copy(), ctrl=point.ctrl.copy())

    def place(self, z: Array) -> mujoco.MjData:
        nv, nu, data = self.model.nv, self.model.nu, self.data
        data.qpos[:] = self.given.qpos
        mujoco.mj_integratePos(self.model, data.qpos, np.ascontiguousarray(z[:nv]), 1.0)
        data.qvel[:], data.qacc[:] = 0, 0
        data.ctrl[:], data.act[:] = self.given.ctrl + z[nv : nv + nu], self.given.act + z[nv + nu :]
        return data

    def forces(self, z: Array) -> _Forces:
        model, data = self.model, self.place(z)
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_fwdActuation(model, data)
        given, force = data.qfrc_actuator.copy(), data.actuator_force.copy()
        act_dot = free_activation_rates(model, data)
        data.qacc[:] = 0
        mujoco.mj_inverse(model, data)
        return _Forces(data.qfrc_inverse - given, force, act_dot)

    def residual(self, found: _Forces) -> Array:
        """The residual: forces relative to the weight, and the distance of the activations from rest."""
        return np.concatenate([found.left / self.weight, self.lag * found.act_dot])

    def lags(self) -> Array:
        """Time constant of each activation, from the slope of its rate over activation and control."""
        slopes, _ = self.slopes(np.arange(self.model.nv, len(self.z)))
        return 1 / np.maximum(np.abs(slopes[self.model.nv :]).max(axis=1, initial=0.0), 1.0)

    def sizes(self) -> Array:
        """The effort of a unit force of each actuator, shape (nu,)."""
        model, data = self.model, self.place(self.z)
        mujoco.mj_fwdPosition(model, data)
        rows = zip(data.moment_rowadr, data.moment_rownnz, strict=True)
        lever = np.array([np.linalg.norm(data.actuator_moment[first : first + count]) for first, count in rows])
        gain = np.abs(model.actuator_gainprm[:, 0]) * (model.actuator_gaintype == mujoco.mjtGain.mjGAIN_FIXED)
        strongest = gain * (self.high - self.low) / 2
        ranged = np.isfinite(strongest) & (strongest > 0)
        return np.where(ranged, 1 / np.where(ranged, strongest, 1.0), lever / self.weight)

    def set_down(self) -> None:
        """Shift a body with a free vertical joint to the height at which its contacts carry the whole weight."""
        i = find_vertical(self.model, self.free)
        if i is None or self.model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CONTACT):
            return
        start = self.z[i]

        def unborne(z: float) -> float:
            self.z[i] = start + z
            return float(self.forces(self.z).left[i])

        here = unborne(0.0)
        for reach in np.geomspace(1e-5, 1.0, 61):
            z = -reach if here > 0 else reach
            if unborne(z) * here < 0:
                low, high = sorted((0.0, z))
                for _ in range(60):
                    middle = (low + high) / 2
                    low, high = (middle, high) if unborne(middle) < 0 else (low, middle)
                return
        self.z[i] = start  # nothing to stand on within a metre

    def moving(self) -> np.ndarray:
        """Indices of the unknown entries of z."""
        nv, nu = self.model.nv, self.model.nu
        parts = (self.free, nv + np.flatnonzero(~self.fixed), np.arange(nv + nu, len(self.z)))
        return np.concatenate(parts).astype(int)

    def approach(self) -> None:
        """Fallback where Newton's method fails: a trust-region method with contacts and limits softened at first.

        Effort is least on soft contacts only: on those that are there its least lies at a kink, and the last bit would
        decide where the search stops. The last rounds are for the balance alone and hold on to where they begin, so
        that what does not matter, such as a place on the floor, stays, and so do joints at an end of their room.
        """
        for softer in (8.0, 4.0, 2.0):
            with soften(self.model, softer):
                self.set_down()
                self.relax(_EFFORT)
        self.set_down()
        for _ in range(8):
            self.relax(0.0)
            if np.linalg.norm(self.residual(self.forces(self.z))) <= _REST:
                return

    def relax(self, effort: float) -> None:
        """Minimise the squares of residual, effort and motion."""
        moving, begin, nv = self.moving(), self.z.copy(), self.model.nv
        low, high = np.full(len(begin), -np.inf), np.full(len(begin), np.inf)
        low[:nv], high[:nv] = self.room
        if effort > 0:  # close to a balance ranges would only hamper
            ctrl = slice(nv, nv + self.model.nu)
            low[ctrl], high[ctrl] = self.low - self.given.ctrl, self.high - self.given.ctrl
        else:
            moving = moving[(moving >= nv) | (np.minimum(begin - low, high - begin)[moving] > _END)]
        position, bounds = moving < nv, (low[moving], high[moving])
        stay = np.where(position, _STAY * (effort or _HOLD), _HOLD)
        about = begin[moving] if effort == 0 else np.where(position, 0.0, begin[moving])

        def misfit(part: Array) -> Array:
            z = begin.copy()
            z[moving] = part
            found = self.forces(z)
            strain = effort * self.size * (found.actuator - self.wanted)
            return np.concatenate([self.residual(found), strain, stay * (part - about)])

        from scipy.optimize import least_squares

        tight = 1e-10 if effort else 1e-15  # less would stop where the last bit decides
        found = least_squares(
            misfit, np.clip(begin[moving], *bounds), jac="3-point", bounds=bounds, x_scale="jac", max_nfev=4 * _STEPS,
            xtol=tight, ftol=tight, gtol=tight,
        )  # fmt: skip
        self.z[moving] = found.x

    def solve(self) -> None:
        """Newton's method; it stops where no step reduces the residual."""
        moving = self.moving()
        found = self.forces(self.z)
        for _ in range(_STEPS):
            r = self.residual(found)
            J, F = self.slopes(moving)
            step = self.step(r, found, J, F, moving)
            size = float(np.linalg.norm(r))
            for halving in range(30):
                trial = self.z.copy()
                trial[moving] += step / 2**halving
                found = self.forces(trial)
                if size <= _REST or float(np.linalg.norm(self.residual(found))) < max(0.99 * size, 10 * _REST):
                    self.z = trial
                    break
            else:
                return
            if size <= _REST and np.abs(step).max(initial=0.0) < 1e-9 * (1 + np.abs(self.z).max(initial=0.0)):
                return

    def slopes(self, moving: np.ndarray) -> tuple[Array, Array]:
        """d residual/dz and d forces/dz with respect to the unknown entries."""
        J, F = [], []
        for j in moving:
            ends = []
            for sign in (1, -1):
                z = self.z.copy()
                z[j] += sign * _EPS
                ends.append(self.forces(z))
            up, down = ends
            J.append((self.residual(up) - self.residual(down)) / (2 * _EPS))
            F.append((up.actuator - down.actuator) / (2 * _EPS))
        size = self.model.nv + self.model.na
        return np.array(J).reshape(-1, size).T, np.array(F).reshape(-1, self.model.nu).T

    def step(self, r: Array, found: _Forces, J: Array, F: Array, moving: np.ndarray) -> Array:
        """The Newton step of least effort and least motion."""
        position = moving < self.model.nv
        effort = np.vstack([self.size[:, None] * F, _STAY * np.diag(position.astype(float))])
        present = np.concatenate(
            [self.size * (found.actuator - self.wanted), _STAY * np.where(position, self.z[moving], 0)]
        )
        # controls of very different strength are brought to one size
        scale = 1 / np.maximum(np.linalg.norm(np.vstack([J, effort]), axis=0), 1e-12)
        U, values, Vt = np.linalg.svd(J * scale)
        rank = int(np.sum(values > 1e-9 * max(values.max(initial=0.0), 1e-300)))
        particular = Vt[:rank].T @ ((U[:, :rank].T @ -r) / values[:rank])
        free = Vt[rank:].T
        choice = np.linalg.lstsq(effort * scale @ free, -(present + effort * scale @ particular), rcond=1e-12)[0]
        return scale * (particular + free @ choice)

    def beyond(self) -> np.ndarray:
        """Whether controls are outside their range."""
        ctrl = self.given.ctrl + self.z[self.model.nv :][: self.model.nu]
        slack = 1e-9 * (1 + np.abs(ctrl))
        return ~self.fixed & ((ctrl < self.low - slack) | (ctrl > self.high + slack))

    def is_cramped(self) -> bool:
        """Whether a joint is at or beyond its limit."""
        low, high = self.room
        position = self.z[: self.model.nv]
        return bool((position < low - 1e-6).any() or (position > high + 1e-6).any())

    def held(self) -> bool:
        """Whether the residual is negligible."""
        return bool(np.abs(self.residual(self.forces(self.z))).max(initial=0.0) <= _HELD)

    def check(self) -> None:
        if self.held():
            return
        left = np.abs(self.forces(self.z).left)
        name, i = get_model_name(self.model), argmax_abs(left)
        stuck = [label for label, fixed in zip(name_inputs(self.model), self.fixed, strict=True) if fixed]
        limits = f"; {', '.join(stuck)} at the end of its range" if stuck else ""
        if left[i] > mujoco.mjMAXVAL:
            limits += f"; MuJoCo takes no control beyond {mujoco.mjMAXVAL:g}, so give the actuator a larger gear"
        unit = "N m" if name_state_units(self.model)[i] == "rad" else "N"
        raise ModelError(
            f"model {name!r} cannot be held at rest by operating_point = {self.rule.kind!r}: "
            f"on {name_states(self.model)[i]} {left[i]:.3g} {unit} are missing{limits}; "
            "choose another pose, or free joints"
        )
