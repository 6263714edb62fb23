"""An archive with a right digest is believed only where it is a run: shapes, rising times, enumerations, types."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_cases import awkward, made_up, standing

from icmj import Result, parse_run, run_case
from icmj.errors import IcmjError, LogError
from icmj.log.archive import pack, unpack
from icmj.log.validation import validate

Change = Callable[[Result], Result]


def of(path: str, change: Callable[[Any], Any]) -> Change:
    """A result with one thing in it changed, by its dotted place."""

    def changed(value: Any, names: list[str]) -> Any:
        if not names:
            return change(value)
        return replace(value, **{names[0]: changed(getattr(value, names[0]), names[1:])})

    return lambda result: changed(result, path.split("."))


def half(values: np.ndarray) -> np.ndarray:
    return values[: len(values) // 2]


def spoilt(values: np.ndarray) -> np.ndarray:
    values = values.copy()
    values[1] = np.nan
    return values


WRONG: list[tuple[Change, str]] = [
    (of("simulation.t", half), r"simulation\.x has shape"),
    (of("simulation.t", spoilt), r"simulation\.t does not rise"),
    (of("simulation.t", lambda t: t[::-1]), r"simulation\.t does not rise"),
    (of("simulation.t", lambda t: t[:0]), "at least 1 times"),
    (of("simulation.y", lambda y: np.hstack([y, y])), r"simulation\.y has shape"),
    (of("continuous.u", half), r"continuous\.u has shape"),
    (of("simulation.events.t", half), r"simulation\.events\.x has shape"),
    (of("simulation.events.t", lambda t: t + 1e3), "ends after the run"),
    (of("simulation.events.x", lambda x: x[:, :1]), r"simulation\.events\.x has shape"),
    (of("simulation.labels.outputs", lambda _: ("a", "b")), r"simulation\.labels\.outputs has 2 words for 1 columns"),
    (of("continuous.labels.assumed", lambda _: (1, 2)), r"continuous\.labels\.assumed\.0 is 1; expected text"),
    (of("measurement.output_units", lambda _: ("m", "m")), r"measurement\.output_units has 2 words"),
    (of("prediction.outputs", lambda _: ("a", "b", "c")), r"prediction\.outputs has 3 words"),
    (of("simulation.plant", lambda _: "paper"), r"simulation\.plant is 'paper'; expected 'linear' or 'mujoco'"),
    (of("simulation.control", lambda _: 3), r"simulation\.control is 3"),
    (of("simulation.outcome.kind", lambda _: "exploded"), r"simulation\.outcome\.kind is 'exploded'"),
    (of("simulation.outcome.t", lambda _: float("nan")), r"outcome\.t is nan"),
    (of("simulation.outcome.message", lambda _: 7), r"outcome\.message is 7; expected text"),
    (of("simulation.x", lambda _: "x"), r"simulation\.x is 'x'; expected an array"),
    (of("simulation.E", lambda E: E.astype(complex)), r"simulation\.E"),
    (of("continuous.plant", lambda _: "mujoco"), r"continuous\.plant"),
    (of("measurement.kind", lambda _: "circle"), r"measurement\.kind"),
    (of("measurement.amplitude", lambda a: np.tile(a, 3)), r"measurement\.amplitude has shape"),
    (of("measurement.period", lambda _: None), r"measurement\.period is missing"),
    (of("measurement.p", lambda _: 10**6), r"measurement\.p is 1000000"),
    (of("prediction.verdict", lambda _: "maybe"), r"prediction\.verdict"),
    (of("prediction.orbit.X", half), r"prediction\.orbit\.X has shape"),
    (of("prediction.orbit.t", lambda t: t[:1]), r"prediction\.orbit\.t"),
    (of("prediction.V_inv", lambda V: V[:2]), r"prediction\.V_inv has shape"),
    (of("prediction.delta_max", lambda _: -1.0), r"prediction\.delta_max is -1"),
    (of("prediction.crossings", lambda c: (1, *c)), r"prediction\.crossings\.0 is 1; expected Crossing"),
    (of("prediction.orbit", lambda _: None), "no orbit"),
    (of("growth.delta", half), r"growth\.measured has shape"),
    (of("law.q_t", lambda q: -q), r"law\.q_t"),
    (of("actual", lambda plant: replace(plant, C=np.eye(2), outputs=(), output_units=())), "other inputs or outputs"),
    (of("controller.trigger.Q_t", lambda _: np.eye(3)), "trigger does not fit"),
    (of("provenance", lambda _: {"icmj": 1}), r"provenance\.icmj is 1; expected text"),
]


@pytest.mark.parametrize(("change", "words"), WRONG, ids=[words for _, words in WRONG])
def test_what_is_no_run_is_refused_in_one_line(change: Change, words: str) -> None:
    result = change(made_up(duration=20.0)[0])
    with pytest.raises(LogError, match=words):
        unpack(*pack(result))


@pytest.mark.parametrize("A_h", [np.zeros((1, 2)), np.zeros((3, 3))])
def test_a_hold_that_could_not_be_made_is_refused(A_h: np.ndarray) -> None:
    result = made_up(duration=20.0)[0]
    result = replace(result, controller=replace(result.controller, hold=replace(result.controller.hold)))
    object.__setattr__(result.controller.hold, "A_h", A_h)
    with pytest.raises(IcmjError, match="A_h"):
        unpack(*pack(result))


@pytest.mark.parametrize(("change", "words"), [
    (of("simulation.pushed", lambda _: np.zeros((3, 1))), r"simulation\.pushed has shape"),
    (of("simulation.applied", lambda _: np.zeros((3, 1))), r"simulation\.applied has shape"),
    (of("simulation.pressure.load", half), r"simulation\.pressure\.load has shape"),
    (of("simulation.pressure.centre", lambda c: c[:, :1]), r"simulation\.pressure\.centre has shape"),
    (of("simulation.pressure.geoms", lambda g: g[:1]), r"simulation\.pressure\.load has shape"),
    (of("simulation.pressure.t_after", half), r"t_after has \d+ times for \d+ events"),
    (of("simulation.pressure.at_rest", lambda _: "x"), r"simulation\.pressure"),
    (of("simulation.pressure", lambda _: 1.0), r"simulation\.pressure is 1\.0; expected Pressure or nothing"),
])  # fmt: skip
def test_what_is_no_pressure_is_refused_in_one_line(change: Change, words: str) -> None:
    test_what_is_no_run_is_refused_in_one_line(lambda _: change(standing()), words)


def test_a_run_with_a_delay_has_the_hold_in_its_state_at_events(root: Path) -> None:
    path = root / "runs" / "three-link-0.9-delay.toml"
    text = path.read_text(encoding="utf-8").replace("duration = 50.0", "duration = 2.0")
    text = text.replace("growth_points = 9", "growth_points = 0").replace(
        "attractor_starts = 24", "attractor_starts = 1"
    )
    result = run_case(parse_run(text, path), "linear")
    assert result.prediction.V_inv is not None
    assert result.prediction.V_inv.shape == (18, 18)
    validate(result)


def test_a_run_that_diverged_is_a_run() -> None:
    validate(awkward())
    validate(made_up(duration=1.0)[0])
    validate(made_up("three_link", 0.9, 0.7594, duration=3.0)[0])
