"""Piecewise interpolation: fourth order within pieces, nothing of one piece in another."""

import numpy as np
import pytest

from icmj.series.interpolation import piecewise

JUMPS = np.array([0.7315, 1.2052])


def signal(t, jumps=JUMPS):
    """Smooth between the jumps, by closed form; at a jump the value before it."""
    piece = np.searchsorted(jumps, t, side="left")
    return np.column_stack([np.cos(5 * t) + piece**2, np.sin(3 * t + piece), t])


def error(step, **known):
    grid = np.arange(0, 2 + step / 2, step)
    t = np.unique(np.concatenate([grid, JUMPS])) if "jumps" in known else grid
    at = np.linspace(0, 2, 1777)
    return np.abs(piecewise(t, signal(t), at, **known) - signal(at)).max()


AFTER = signal(JUMPS + 1e-15)


@pytest.mark.parametrize(
    "known", [{"jumps": JUMPS, "after": AFTER}, {"jumps": JUMPS}, {"breaks": JUMPS}], ids=["after", "before", "neither"]
)
def test_it_is_of_fourth_order_whatever_is_known_of_the_jumps(known):
    steps = np.array([0.04, 0.02, 0.01, 0.005])
    errors = [error(step, **known) for step in steps]
    slopes = np.diff(np.log(errors)) / np.diff(np.log(steps))
    assert slopes[-1] == pytest.approx(4, abs=0.4)
    assert errors[2] < 2e-5


def test_the_value_at_a_jump_is_the_one_before_and_the_next_the_one_after():
    t = np.unique(np.concatenate([np.arange(0, 2.01, 0.02), JUMPS]))
    at = np.sort(np.concatenate([JUMPS, JUMPS + 1e-8]))
    found = piecewise(t, signal(t), at, jumps=JUMPS, after=AFTER)
    assert found[::2] == pytest.approx(signal(JUMPS), abs=1e-12)
    assert found[1::2] == pytest.approx(AFTER, abs=1e-7)


@pytest.mark.parametrize("slip", [-3e-16, 0.0, 3e-16])
def test_the_value_at_a_break_is_the_one_from_there_on_whatever_rounding_made_of_its_time(slip):
    t = np.arange(0, 2.01, 0.02)
    found = piecewise(t, signal(t), JUMPS, breaks=JUMPS + slip)
    # a cubic that is extended by one distance of the rows errs by a fourth derivative times its fourth power
    bound = 5**4 * 0.02**4
    assert found == pytest.approx(AFTER, abs=bound)
    # a row there has that value, too, and takes no part in the piece before it
    t = np.sort(np.concatenate([t, JUMPS]))
    rows = np.where(np.isin(t, JUMPS)[:, None], signal(t + 1e-15), signal(t))
    assert piecewise(t, rows, JUMPS, breaks=JUMPS + slip) == pytest.approx(AFTER, abs=1e-12)
    before = piecewise(t, rows, JUMPS - 1e-6, breaks=JUMPS + slip)
    assert before == pytest.approx(signal(JUMPS - 1e-6), abs=bound)


def test_breaks_at_one_instant_but_for_rounding_are_one():
    t = np.arange(0, 2.01, 0.02)
    breaks = np.concatenate([JUMPS, JUMPS * (1 + 4e-16), JUMPS * (1 - 4e-16)])
    at = np.linspace(0, 2, 1777)
    np.testing.assert_array_equal(*(piecewise(t, signal(t), at, breaks=each) for each in (breaks, JUMPS * (1 - 4e-16))))


def test_all_rows_are_met_and_those_beside_a_row_of_a_jump_take_no_part_elsewhere():
    rng = np.random.default_rng(1)
    t = np.sort(np.concatenate([np.arange(0, 2, 0.02), JUMPS]))
    values = rng.standard_normal((len(t), 2))
    found = piecewise(t, values, t, jumps=JUMPS, after=np.full((2, 2), np.nan))
    np.testing.assert_array_equal(found, values)
    crowded = np.sort(np.concatenate([t, JUMPS[1:] - 1e-4]))
    rows = np.where((crowded == JUMPS[1] - 1e-4)[:, None], 1e3, np.ones((1, 2)))
    at = np.linspace(0, 1.98, 777)
    assert piecewise(crowded, rows, at, jumps=JUMPS) == pytest.approx(np.ones((777, 2)), abs=1e-9)


def test_pieces_with_few_rows_and_missing_values_are_drawn_straight():
    t = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    line = np.column_stack([2 * t, np.where(t == 2, np.nan, t)])
    breaks = np.array([1.2, 1.8, 2.5])
    found = piecewise(t, line, np.array([0.5, 1.5, 3.5]), breaks=breaks)
    assert found[:, 0] == pytest.approx([1, 3, 7])
    assert found[[0, 2], 1] == pytest.approx([0.5, 3.5])
    assert np.isnan(found[1, 1])


def test_one_row_stands_for_itself():
    assert piecewise(np.zeros(1), np.ones((1, 2)), np.zeros(1)) == pytest.approx(np.ones((1, 2)))


def test_a_break_at_the_last_row_but_for_rounding_keeps_it_out_of_the_piece_before():
    """An action at 2.6 + 4e-16 s of a run that ends at 2.6 s: its row pulled the spline along."""
    t = np.arange(0, 2.005, 0.01)
    values = np.where(t < t[-1], np.cos(5 * t), 7.0)[:, None]
    at = np.linspace(0, t[-1] - 1e-6, 777)
    for slip in (-4e-16, 0.0, 4e-16):
        found = piecewise(t, values, at, breaks=np.array([t[-1] + slip]))
        assert found[:, 0] == pytest.approx(np.cos(5 * at), abs=1e-5)


def test_what_bends_has_the_row_of_both_sides_and_what_jumps_its_own():
    """A signal that bends at 0.8 has a kink there, of which neither side is extended, though one has two rows."""
    t = np.array([*np.arange(0, 0.8, 0.02), 0.8, 0.8023, *np.arange(0.82, 2, 0.02)])
    bent = np.abs(t - 0.8023)[:, None]
    at = np.linspace(0, 1.9, 1777)
    assert piecewise(t, bent, at, bends=np.array([0.8, 0.8023]))[:, 0] == pytest.approx(np.abs(at - 0.8023), abs=1e-12)
    assert np.abs(piecewise(t, bent, at)[:, 0] - np.abs(at - 0.8023)).max() > 1e-4


def test_of_a_jump_on_a_break_what_is_before_both_ends_the_piece_before():
    """The row lies between the two: 5 after the break and before the jump; the piece before has three rows."""
    t = np.array([0.0, 0.4, 0.7, 1.0, 1.3, 1.7, 2.0])
    values = np.where(t < 1, t**3, np.where(t > 1, 9.0, 5.0))[:, None]
    known = {"jumps": np.array([1.0]), "after": np.array([[9.0]]), "breaks": np.array([1.0])}
    at = np.array([0.2, 0.9, 0.999999, 1.0, 1.000001, 1.5])
    found = piecewise(t, values, at, **known, before=(np.array([1.0]), np.array([[1.0]])))
    assert found.ravel() == pytest.approx([*at[:3] ** 3, 5, 9, 9], abs=1e-12)
    blind = piecewise(t, values, at, **known).ravel()
    assert abs(blind[2] - 1) > 0.05


def test_after_a_jump_without_a_row_comes_the_value_of_the_next():
    t = np.array([0.0, 1.0, 2.0, 2.1, 2.5, 3.0, 4.0])
    values = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0])[:, None]
    found = piecewise(t, values, np.array([1.5, 2.05, 2.3]), jumps=np.array([2.0]), breaks=np.array([2.1]))
    assert found[:, 0] == pytest.approx([1, 0, 0])


@pytest.mark.parametrize("kind", ["jumps", "breaks"])
def test_where_instants_come_faster_than_rows_lines_join_them(kind):
    """A clock of some milliseconds, which stands for continuous control: a value alone would be late by half of it."""
    t, h = 0.005 * np.arange(201), 0.005
    at = np.arange(0.0201, 0.98, 0.0017)
    found = piecewise(t, np.sin(20 * t)[:, None], at, **{kind: t[1:-1]})
    assert np.abs(found.ravel() - np.sin(20 * at)).max() < 1.01 * (20 * h) ** 2 / 8
