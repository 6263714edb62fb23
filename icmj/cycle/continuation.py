"""Branches of cycles of a run file: from its cycle at one value of a parameter, and from special points."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from icmj.base.array import Array
from icmj.base.blas_threads import limit_to_one_thread
from icmj.case.case import Theory, expect_theory, prepare
from icmj.cycle.branch import ALONG, OF_POINTS, Branch, SpecialPoint
from icmj.cycle.curve import Curve, Miss, Range, correct
from icmj.cycle.cycle import LONGEST, Start, close_cycle
from icmj.cycle.family import ReturnMaps
from icmj.cycle.guess import Guess, guess_from_prediction, guess_from_simulation
from icmj.cycle.jacobian import compute_jacobian
from icmj.cycle.parameter import find_parameter
from icmj.cycle.point import make_point
from icmj.cycle.return_map import PlantKind, ReturnMap
from icmj.cycle.stability_changes import find_direction
from icmj.cycle.walk import Walk, walk
from icmj.errors import CycleError, prefix_errors
from icmj.runfile.schema import RunFile

AWAY = 0.02  # of the state's size: the first step onto a branch that branches off
BRANCHING = ("flip", "symmetry breaking", "branch point")


@limit_to_one_thread()
def follow(
    run: RunFile,
    name: str,
    to: float,
    *,
    start_at: float | None = None,
    plant: PlantKind = "mujoco",
    start: Start | Guess = "auto",
    points: int = 40,
    progress: Callable[[float], None] | None = None,
) -> Branch:
    """The branch of cycles of a run file along a parameter, by pseudo-arclength continuation.

    Args:
        run: the run file; its ``simulation.limit`` defines when the body has fallen.
        name: name of the parameter: ``b``, ``q_t``, ``delay``, ``delta_min``, ``rho``, a change such as ``mass:trunk``
            (by a factor), or a dotted key of the run file.
        to: its last value.
        start_at: its first value; by default that of the run file.
        plant: ``linear`` or ``mujoco``.
        start: first guess of the first cycle; see :func:`icmj.cycle.cycle.find_cycle`.
        points: minimum number of cycles, if the branch reaches ``to``.
        progress: called repeatedly with the completed fraction of the range, 0–1.

    Raises:
        CycleError: if there is no such parameter, or no cycle to start from, with the reason.
        IcmjError: if the run file does not allow a value, or no loop can be formed from it.
    """
    of = find_parameter(name)
    first = of.value(run) if start_at is None else start_at
    over, run = Range(first, to), of.put(run, first)
    if isinstance(start, Guess):
        family, guess = ReturnMaps(run, of, plant), start
    else:
        theory = expect_theory(case := prepare(run), "a branch of cycles")
        family = ReturnMaps(run, of, plant, case)
        with prefix_errors(run.path):
            guess = _guess(theory, family.at(first), start)
    curve = Curve(family, over, guess.p, guess.sign, guess.scale, _size(family, over.start))
    curve.longest = LONGEST * guess.longest
    loop = curve.loop(0.0)
    with prefix_errors(run.path):
        found = close_cycle(loop, guess)
    N = len(found.z)
    row = np.append(np.zeros(N), 1.0)
    unit = curve.unit(loop)
    G = curve.sign * compute_jacobian(loop, found.turn, unit) * (unit[None, :] / unit[:, None]) - np.eye(N)
    at = correct(curve, curve.u(found.z, 0.0), np.column_stack([G, np.zeros(N)]), row)
    assert not isinstance(at, Miss)
    walked = walk(curve, make_point(curve, at), points=points, neutral=found.neutral, progress=progress)
    return join_branch(curve, walked, run, found.neutral)


@limit_to_one_thread()
def branch_off(
    branch: Branch,
    special: SpecialPoint,
    *,
    to: float | None = None,
    away: float = AWAY,
    points: int = 40,
    progress: Callable[[float], None] | None = None,
) -> Branch:
    """The branch that begins at a flip, a loss of symmetry or a branch point of another.

    Args:
        branch: the other branch.
        special: one of its special points.
        to: last value of the parameter on one side; by default the range of ``branch``.
        away: length of the first step, relative to the size of the state; its sign selects the side.
        points, progress: as for :func:`follow`.

    Raises:
        CycleError: if no branch begins at this point, or no cycle was found on the new branch.
    """
    if special.kind not in BRANCHING:
        raise CycleError(f"nothing branches off from a {special.kind}; take one of {', '.join(BRANCHING)}")
    of = find_parameter(branch.parameter)
    doubled = special.kind != "branch point"
    p = len(special.intervals) * (2 if doubled else 1)
    sign = 1 if doubled else branch.sign
    low, high = float(branch.value.min()), float(branch.value.max())
    over = Range(low, high) if to is None else Range(low if to > special.value else high, to)
    family = ReturnMaps(branch.run, of, branch.plant)
    size = _size(family, float(branch.value[0]))
    curve = Curve(family, over, p, sign, branch.scale, size)
    curve.patient(float(special.intervals.max()))
    sigma = over.sigma(special.value)
    loop = curve.loop(sigma)
    unit = curve.unit(loop)
    turn = loop.turn(special.state, len(special.intervals))
    J = compute_jacobian(loop, turn, unit)
    v = find_direction(J * (unit[None, :] / unit[:, None]), special.multiplier)
    u = curve.u(special.state, sigma)
    curve.weigh(u)
    J = J @ J if doubled else J
    D = np.column_stack([sign * J * (unit[None, :] / unit[:, None]) - np.eye(len(unit)), np.zeros(len(unit))])
    h = 1e-4
    ahead = u + np.append(np.zeros(len(unit)), h)
    D[:, -1] = (curve.residual(ahead)[0] - curve.residual(u)[0]) / h
    v /= np.abs(v).max()
    tangent = np.append(v, 0.0)
    if not doubled:  # across the branch that is known
        along = find_tangent(curve, branch, special)
        tangent -= curve.normal(along) @ tangent / (curve.normal(along) @ along) * along
    for shorter in (1.0, 0.3, 0.1, 3.0):
        step = away * shorter * tangent
        found = correct(curve, u + step, D, curve.normal(tangent))
        if not isinstance(found, Miss) and curve.turn_of(tangent, found.u - u) > 0.5:
            break
    else:
        raise CycleError(f"no cycle was found on the branch that leaves at {branch.parameter} = {special.value:.6g}")
    walked = walk(
        curve, make_point(curve, found), points=points, tangent=found.u - u, neutral=branch.neutral, progress=progress
    )
    return join_branch(curve, walked, branch.run, branch.neutral)


def find_tangent(curve: Curve, branch: Branch, special: SpecialPoint) -> Array:
    i = min(special.index, len(branch) - 2)
    ends = [curve.u(branch.states[j, 0], curve.range.sigma(float(branch.value[j]))) for j in (i, i + 1)]
    return np.asarray(ends[1] - ends[0])


def _guess(theory: Theory, loop: ReturnMap, start: Start) -> Guess:
    orbit = theory.prediction.orbit
    if start == "prediction" or (start == "auto" and orbit is not None and np.isfinite(orbit.gamma)):
        return guess_from_prediction(theory, loop, theory.rule.size)
    return guess_from_simulation(loop, theory.system.T_hat)


def _size(family: ReturnMaps, value: float) -> float:
    return float(getattr(family.at(value).controller.trigger, "size", 1.0))


def join_branch(curve: Curve, walked: Walk, run: RunFile, neutral: int) -> Branch:
    """A walk as a branch, its courses laid end to end."""
    points, plant = walked.points, curve.loop(walked.points[0].sigma).linear

    def laid(name: str) -> Array:
        return np.array([np.concatenate([getattr(sample, name) for sample in at.samples]) for at in points])

    parts: dict[str, Any] = {name: laid(name) for name in ALONG}
    parts |= {name: np.array([getattr(at, name) for at in points]) for name in (*OF_POINTS, "alternating")}
    starts = [np.concatenate([[0.0], np.cumsum(at.intervals)[:-1]]) for at in points]
    t = [
        np.concatenate([s + sample.t for s, sample in zip(begin, at.samples, strict=True)])
        for begin, at in zip(starts, points, strict=True)
    ]
    return Branch(
        run=run,
        parameter=curve.family.parameter.name,
        plant=curve.family.plant,
        mirrored=curve.sign < 0,
        scale=curve.scale,
        neutral=neutral,
        t=np.array(t),
        **parts,
        outputs=plant.outputs,
        inputs=plant.inputs,
        names=plant.states,
        units=plant.output_units or ("",) * plant.n_y,
        specials=walked.specials,
        end=walked.end,
    )
