"""Crossings against a scan with 50 digits (``python -m tests.fifty_digits`` hunts for longer)."""

from dataclasses import replace

import pytest
from fifty_digits import Scan, check, differences, draw, draw_pair

from icmj import error_system
from icmj.theory.crossings import search
from icmj.theory.reduction import reduce_system

pytest.importorskip("flint", reason="arithmetic of 50 digits")


@pytest.mark.parametrize("seed", [
    4, 5, 7, 8, 9, 11,
    96,  # a pair that passes beside +1
    415,  # rates of 1e-5/s beside one of 50/s, which begin together at +1
    406, 544,  # chains and slow modes in mixed coordinates, which are together
    686,  # a pair that crosses 1e-5 beside +1 where φ is 1e7
    13, 392,  # φ in floats leaves it open
])  # fmt: skip
def test_crossings_are_those_of_a_scan_with_50_digits(seed):
    assert check(seed, far=False)[0] == "same"


@pytest.mark.parametrize("seed", [21, 150])  # rounding moves one by some millionths of the range
def test_a_crossing_that_rounding_moves_is_found(seed):
    assert check(seed, far=False)[0] == "same"


@pytest.mark.slow
def test_an_eigenvalue_that_passes_the_circle_too_fast_to_be_seen_on_it_has_its_crossings():
    """Slopes of 7,000/s, of eigenvalues that rounding moves by more than a millionth: twice +1 within 0.2 ms."""
    loop = draw(188)
    scan = Scan(loop)
    odd = [scan.levels(delta)[1] for delta in (0.1054, 0.1055, 0.1057)]
    assert odd[0] != odd[1] != odd[2]
    system = error_system(loop.actual, loop.design, loop.hold, delay=loop.delay)
    near = [c.kind for c in search(system, 0.16, delta_start=0.1).crossings if 0.1054 < c.delta < 0.1057]
    assert near == ["+1", "+1"]


@pytest.mark.parametrize("seed", [
    280,  # gains of which rounding leaves three digits
    633,  # a mode that seems unobservable beside a gain of ten thousand, in mixed coordinates
    pytest.param(703, marks=pytest.mark.slow),  # of two modes that decay as e^(-1e-7 t) one was taken for an offset
])  # fmt: skip
def test_what_rounding_hides_is_said(seed):
    assert check(seed, far=False)[0] in ("same", "unresolved")


@pytest.mark.parametrize("seed", [230, 929])
def test_what_one_input_moves_beside_gains_of_1e8_is_no_offset(seed):
    """Rates of 0.03 to 0.4/s: what rounding may put at zero, or is small beside the gains, is not zero for that."""
    loop = draw_pair(seed)[1]
    assert reduce_system(error_system(loop.actual, loop.design, loop.hold)).modes == ()


def test_the_scan_takes_as_many_digits_as_gains_need():
    loop = draw(230)
    few, many = Scan(loop).levels(0.3)[0], Scan(loop, 300).levels(0.3)[0]
    assert (few > 0).sum() == (many > 0).sum() == 6


@pytest.mark.parametrize("seed", [5])
def test_a_crossing_that_is_left_out_or_moved_is_noticed(seed):
    loop = draw(seed)
    found, scan = loop.crossings(), Scan(loop)
    assert not differences(found, scan, loop.end)
    first, *rest = found.crossings
    moved = replace(first, delta=first.delta + 1e-5 * loop.end)
    for others in (rest, (moved, *rest)):
        assert differences(replace(found, crossings=tuple(others)), scan, loop.end)


def test_what_a_reduction_neglects_is_rounding_where_a_mode_is_neutral():
    neglected = {}
    for seed in (11, 48, 53, 62, 119, 703):
        loop = draw_pair(seed)[1]
        neglected[seed] = reduce_system(error_system(loop.actual, loop.design, loop.hold)).neglected
    assert 1e-12 < neglected.pop(703) < 1e-9
    assert max(neglected.values()) < 1e-13  # chains of integrators beside gains of up to 1e4
