"""Cycles of a switched delayed feedback, against the method of steps, and branches of them."""

from dataclasses import replace

import numpy as np
import pytest
from oracles.delay import of_law
from scipy.linalg import expm
from tapped_cases import BODY, DELAY, HOMOGENEOUS, MGH, SWITCHING

from icmj.cycle.switched import SwitchedMap, find_switched_cycle
from icmj.cycle.switched_branch import follow_switched
from icmj.errors import CycleError

BEFORE = 0.01  # s before ξ at which the method of steps begins


@pytest.fixture(scope="module")
def asai():
    return find_switched_cycle(BODY, SWITCHING)


def _flown(z: np.ndarray, duration: float) -> np.ndarray:
    """Where the plant is so long after ξ, by the method of steps."""
    return of_law(BODY, SWITCHING, expm(-BODY.A * BEFORE) @ z).run(BEFORE + duration).z(BEFORE + duration)


def test_the_cycle_closes_by_the_method_of_steps(asai) -> None:
    assert asai.period == pytest.approx(4.131, abs=5e-4)
    assert not asai.mirrored
    assert asai.attracting
    motion = of_law(BODY, SWITCHING, expm(-BODY.A * BEFORE) @ asai.states[0]).run(BEFORE + DELAY + asai.period + 1e-3)
    switches = np.array(motion.switches) - BEFORE - DELAY
    assert switches == pytest.approx([*asai.switches, asai.period], abs=1e-9)
    assert motion.z(BEFORE + asai.period) == pytest.approx(asai.states[0], rel=1e-9)


def test_its_multiplier_is_what_is_left_of_a_departure(asai) -> None:
    # along the flow a departure comes back later, across it as the multiplier says
    z, along = asai.states[0], BODY.A @ asai.states[0]
    away = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    ends = [_flown(z + h * away, asai.period) - z for h in (-1e-6, 1e-6)]
    left = away @ (ends[1] - ends[0]) / 2e-6
    assert left == pytest.approx(asai.multipliers[0].real, rel=1e-5)
    assert abs(asai.multipliers[1]) < 1e-9


def test_it_is_in_proportion_to_the_dead_zone(asai) -> None:
    larger = find_switched_cycle(BODY, replace(SWITCHING, dead_zone=0.02))
    assert larger.states == pytest.approx(5 * asai.states, rel=1e-9)
    assert larger.period == pytest.approx(asai.period, rel=1e-9)
    assert larger.multipliers[0] == pytest.approx(asai.multipliers[0], abs=1e-6)


@pytest.mark.parametrize("x0", [[0.01, 0.0], [0.03, -0.01], [-0.01, 0.0]])
def test_it_is_told_with_its_shortest_period_from_wherever_it_is_come_to(asai, x0) -> None:
    found = find_switched_cycle(BODY, SWITCHING, x0)
    assert found.period == pytest.approx(asai.period, rel=1e-9)
    assert len(found.switches) == 4


def test_a_mirrored_cycle_is_told_by_its_half() -> None:
    found = find_switched_cycle(BODY, replace(SWITCHING, P=0.7 * MGH, D=60.0))
    doubled = find_switched_cycle(BODY, found.law, found.states[0], rounds=2 * len(found.states), sign=1)
    assert found.mirrored
    assert doubled.mirrored
    assert doubled.period == pytest.approx(found.period, rel=1e-9)


@pytest.mark.slow
@pytest.mark.kernels
def test_a_branch_changes_its_stability_where_a_multiplier_is_one() -> None:
    branch = follow_switched(BODY, SWITCHING, "P", 0.242 * MGH, points=4)
    assert branch.value[-1] == 0.242 * MGH
    assert [cycle.attracting for cycle in branch.cycles][:: len(branch.cycles) - 1] == [True, False]
    (at,) = branch.changes
    there = find_switched_cycle(BODY, replace(SWITCHING, P=at), branch.cycles[-1].states[0], rounds=2)
    assert there.multipliers[0] == pytest.approx(-1, abs=1e-4)


@pytest.mark.slow
@pytest.mark.kernels
def test_a_branch_in_the_share_is_one_in_the_slope() -> None:
    by_share = follow_switched(BODY, SWITCHING, "share", 0.63, points=2)
    by_slope = follow_switched(BODY, SWITCHING, "slope", -float(np.tan(np.pi * 0.13)), points=2)
    assert by_share.cycles[-1].period == pytest.approx(by_slope.cycles[-1].period, rel=1e-9)


@pytest.mark.parametrize(("law", "words"), [
    (HOMOGENEOUS, "without a dead zone every round is the one before times a factor"),
    (replace(SWITCHING, switches=False), "is a linear loop"),
    (replace(SWITCHING, P=1.5 * MGH), "no cycle: the motion"),
])  # fmt: skip
def test_why_there_is_none(law, words: str) -> None:
    with pytest.raises(CycleError, match=words):
        find_switched_cycle(BODY, law)


def test_a_parameter_that_is_none_is_refused() -> None:
    with pytest.raises(CycleError, match="no parameter 'q_t'"):
        follow_switched(BODY, SWITCHING, "q_t", 1.0)
    with pytest.raises(CycleError, match="two different values"):
        follow_switched(BODY, SWITCHING, "P", 0.25 * MGH)


def test_a_flight_that_does_not_begin_in_quiet_is_lost() -> None:
    with pytest.raises(CycleError, match="does not begin where feedback is off"):
        SwitchedMap(BODY, SWITCHING).turn(np.array([0.1, 0.1]))
