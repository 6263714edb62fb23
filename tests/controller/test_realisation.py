"""The contract refuses what no simulation could read, and picks modes by its table."""

from __future__ import annotations

import numpy as np
import pytest

from icmj.controller.realisation import Guard, Layout, Mode, Realisation
from icmj.errors import AnalysisError

NONE = np.zeros((0, 0))
MODES = tuple(
    Mode(name, NONE, np.zeros((0, 1)), np.zeros((1, 0)), np.array([[gain]])) for name, gain in (("a", 1.0), ("b", 2.0))
)


def realisation(**changes: object) -> Realisation:
    given = {"taps": (0.1,), "guards": (Guard(np.eye(1), -1.0),), "table": np.array([[0, 1], [0, 1]])} | changes
    return Realisation(Layout.of(), MODES, NONE, NONE, NONE, np.zeros(1, dtype=int), **given)  # type: ignore[arg-type]


def test_the_table_is_asked_for_the_signs_of_the_guards() -> None:
    real = realisation()
    assert real.following(0, np.array([0.5])) == 0
    assert real.following(0, np.array([-1.5])) == 1


def test_a_table_may_remember_the_mode() -> None:
    """Hysteresis: on from one bound, off from another, and between the two as it was."""
    guards = Guard(np.eye(1), -1.0), Guard(np.eye(1), -4.0)
    real = realisation(guards=guards, table=np.array([[0, 0, 1, 1], [0, 1, 1, 1]]))
    for size, before, after in ((0.5, 0, 0), (1.5, 0, 0), (2.5, 0, 1), (1.5, 1, 1), (0.5, 1, 0)):
        assert real.following(before, np.array([size])) == after


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"guards": (Guard(np.zeros((1, 1)), 1.0),)}, "one sign for ever"),
        ({"taps": ()}, "rising delays"),
        ({"taps": (0.2, 0.1)}, "rising delays"),
        ({"taps": (-0.1,)}, "at least 0 s"),
        ({"taps": (0.0,), "commands": True}, "needs a delayed tap"),
        ({"commands": True}, "must have S = 0"),
        ({"period": 0.0}, "must be positive"),
        ({"period": 0.1, "clock": 0.1}, "leave one of them out"),
        ({"clock": -1.0}, "expected a positive clock"),
        ({"wait": -1.0}, "at least 0 s for the others"),
        ({"watched": (True,)}, "one entry for each of its 2 modes"),
        ({"after": (0, 2)}, "a mode follows that does not exist"),
        ({"table": np.array([[0, 1]])}, "expected \\(2, 2\\)"),
        ({"table": np.array([[0, 2], [0, 1]])}, "a mode follows that does not exist"),
    ],
)
def test_taps_and_guards_fit(changes: dict, words: str) -> None:
    with pytest.raises(AnalysisError, match=words):
        realisation(**changes)


def test_rates_that_are_not_told_are_an_error() -> None:
    with pytest.raises(AnalysisError, match="does not state which outputs its rates"):
        _ = realisation().rates
