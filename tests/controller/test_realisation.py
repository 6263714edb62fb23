"""The contract refuses what no simulation could read, and picks modes by its table."""

from collections.abc import Callable

import numpy as np
import pytest

from icmj.controller.layout import Layout
from icmj.controller.realisation import Guard, Mode, Realisation, parallel
from icmj.errors import AnalysisError

NONE = np.zeros((0, 0))
MODES = tuple(
    Mode(name, NONE, np.zeros((0, 1)), np.zeros((1, 0)), np.array([[gain]])) for name, gain in (("a", 1.0), ("b", 2.0))
)


def realisation(**changes: object) -> Realisation:
    given = {
        "layout": Layout.of(), "modes": MODES, "J": NONE, "G": NONE, "R": NONE, "cuts": np.zeros(1, dtype=int),
        "taps": (0.1,), "guards": (Guard(np.eye(1), -1.0),), "table": np.array([[0, 1], [0, 1]]),
    } | changes  # fmt: skip
    return Realisation(**given)  # type: ignore[arg-type]


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


@pytest.mark.parametrize(("changes", "words"), [
    ({"taps": ()}, "rising delays"),
    ({"taps": (0.2, 0.1)}, "rising delays"),
    ({"taps": (-0.1,)}, "at least 0"),
    ({"taps": (0.0,), "commands": True}, "needs a delayed tap"),
    ({"commands": True}, "must have S = 0"),
    ({"period": 0.0}, "must be positive"),
    ({"period": 0.1, "clock": 0.1}, "leave one of them out"),
    ({"clock": -1.0}, "the clock of a controller is -1.0 s; it must be positive"),
    ({"wait": -1.0}, r"the wait of a controller \[s\] is -1.0"),
    ({"wait": np.nan}, "the wait of a controller"),
    ({"delay": np.inf}, "the delay of a controller"),
    ({"taps": (0.1, np.inf)}, "a tap of a controller"),
    ({"taps": ("0.1",)}, r"a tap of a controller \[s\] is '0.1'"),
    ({"J": np.eye(1)}, r"J of a controller has the shape \(1, 1\); expected \(0, 0\)"),
    ({"R": np.zeros((1, 1))}, r"R of a controller has the shape \(1, 1\)"),
    ({"cuts": np.array([0, 1])}, "rising numbers from 0 to 0"),
    ({"cuts": np.array([], dtype=int)}, "rising numbers from 0 to 0"),
    ({"signals": np.zeros((1, 5))}, "signals of a controller"),
    ({"signals": np.full((1, 6), np.nan)}, "not finite"),
    ({"guards": (Guard(np.eye(3), -1.0),)}, r"expected \(1, 1\) for readings"),
    ({"guards": (Guard(np.eye(1), -1.0),) * 17, "table": None}, "at most 16"),
    ({"table": None}, "needs a table"),
    ({"table": np.array([[0, 0.5], [0, 1]])}, "the table of modes: 0.0; expected a whole number"),
    ({"modes": ()}, "at least one mode"),
    ({"modes": (*MODES, Mode("c", NONE, np.zeros((0, 2)), np.zeros((1, 0)), np.zeros((1, 2))))}, "S of mode 'c'"),
    ({"watched": (True,)}, "one entry for each of its 2 modes"),
    ({"after": (0, 2)}, "a mode follows that does not exist"),
    ({"table": np.array([[0, 1]])}, "expected \\(2, 2\\)"),
    ({"table": np.array([[0, 2], [0, 1]])}, "a mode follows that does not exist"),
])  # fmt: skip
def test_taps_and_guards_fit(changes: dict, words: str) -> None:
    with pytest.raises(AnalysisError, match=words):
        realisation(**changes)


@pytest.mark.parametrize(("make", "words"), [
    (lambda: Guard(np.zeros((1, 1)), 1.0), "one sign for ever"),
    (lambda: Guard(np.array([[1.0, 1.0], [0.0, 1.0]])), "must be symmetric"),
    (lambda: Guard(np.ones(3)), "the matrix of a guard has the shape"),
    (lambda: Guard(np.eye(1), np.nan), "the constant of a guard"),
    (lambda: Mode("a", np.eye(2), np.zeros((1, 1)), np.zeros((1, 1)), np.eye(1)), "M of mode 'a' has the shape"),
    (lambda: Mode("a", np.eye(1), np.zeros((1, 2)), np.zeros((1, 1)), np.eye(1)), "N of mode 'a' has the shape"),
    (lambda: Mode("a", np.eye(1), np.zeros((1, 1)), np.zeros((2, 1)), np.eye(1)), "K of mode 'a' has the shape"),
    (lambda: Mode("a", np.eye(1) * np.nan, np.zeros((1, 1)), np.zeros((1, 1)), np.eye(1)), "not finite"),
    (lambda: Mode("a", [["1"]], np.zeros((1, 1)), np.zeros((1, 1)), np.eye(1)), "M of mode 'a' is not a matrix"),
])  # fmt: skip
def test_matrices_fit_and_are_finite(make: Callable[[], object], words: str) -> None:
    with pytest.raises(AnalysisError, match=words):
        make()


def test_matrices_may_be_lists_of_whole_numbers() -> None:
    mode = Mode("a", [[1]], [[2]], [[3]], [[4]])  # type: ignore[arg-type]
    assert (mode.M.dtype, mode.N[0, 0], mode.K[0, 0], mode.S[0, 0]) == (float, 2.0, 3.0, 4.0)


def test_controllers_for_different_plants_are_not_added() -> None:
    two = Mode("b", NONE, np.zeros((0, 1)), np.zeros((2, 0)), np.zeros((2, 1)))
    with pytest.raises(AnalysisError, match="have 1 and 2 commands"):
        parallel(realisation(), realisation(modes=(two, two)), 1)
    with pytest.raises(AnalysisError, match="plant, of 3 outputs"):
        parallel(realisation(), realisation(), 3)


def test_rates_that_are_not_told_are_an_error() -> None:
    with pytest.raises(AnalysisError, match="does not state which outputs its rates"):
        _ = realisation().rates
