"""Random runs obey the rules of all runs (``python -m tests.metamorphic`` hunts for longer)."""

import pytest
from metamorphic_cases import RULES, check, draw, hunt


@pytest.mark.parametrize("rule", RULES)
def test_random_runs_obey(rule):
    tally = hunt(range(1000, 1003), rules=[rule])
    assert not tally.failures
    assert tally.obeyed[rule]


def test_a_run_comes_again_by_its_seed():
    assert draw(7) == draw(7)
    assert check("order", 7, "linear") == check("order", 7, "linear") == ""


@pytest.mark.parametrize("seed", [40000117, 40000388, 50000515])
def test_rows_change_no_bit_of_a_motion_under_sinusoids(seed):
    """A product of matrices is rounded by its shape, so what is worked out for rows stands apart from the motion."""
    assert check("rows", seed, "linear") == ""


@pytest.mark.parametrize(
    ("seed", "plant"),
    [
        (250000015, "linear"),  # falls within a few rows, which a window that moves by one weighs otherwise
        (250000015, "mujoco"),
        (300000039, "mujoco"),  # rests, and falls in the last rows, which move the mean of a window
    ],
)
def test_the_last_row_of_a_fall_changes_a_spectrum_by_its_share(seed, plant):
    assert check("rows", seed, plant) == ""


@pytest.mark.parametrize(
    "seed",
    [
        310000010,  # a threshold is met within a step, and sampled later
        340000213,  # the plant has fallen within a step, and only the last row is beyond its limit
    ],
)
def test_no_row_is_lost_within_a_step(seed):
    assert check("rows", seed, "mujoco") == ""


@pytest.mark.parametrize("seed", [1214, 1220])
def test_integrators_that_nothing_reads_are_neutral_in_any_coordinates(seed):
    assert check("coordinates", seed, "linear") == ""


def test_units_of_integrators_that_nothing_reads_make_no_loop_stiff():
    assert check("units", 270000069, "linear") == ""


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "plant"), [
    (4, "linear"),  # an action at the end of the run but for rounding
    (13, "linear"),  # a step of a push less than three rows after an action
    (36, "linear"),  # the start, and a step of a reading, are read late, and what that does once more
    (7006, "linear"),  # a step at a row whose time is off by the rounding of many delays
    (9030, "mujoco"),  # a piece without a row after a switch
    (26, "mujoco"),  # a piece without a row between an event and an edge
    (230000062, "linear"),  # a piece of one row between an event and an edge, of which nothing is asked
    (310000205, "linear"),  # what an action does is read late, a few rows before an edge, and bends the command
    (310000205, "mujoco"),
])  # fmt: skip
def test_signals_are_exported_alike_whatever_the_rows(seed, plant):
    assert check("instants", seed, plant) == ""
