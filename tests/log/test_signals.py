"""The series for the eye, against the run that they are of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from log_cases import made_up, standing

from icmj.controller.design import Design
from icmj.controller.trigger import ClockTrigger, EventRule, Faces
from icmj.log.groups import list_groups

CASES = {
    "+1": ("pendulum", 0.8, 1.807, 40.0),
    "-1": ("pendulum", 1.2, 1.528, 40.0),
    "three-link": ("three_link", 0.9, 0.7594, 20.0),
}


@pytest.mark.parametrize("case", CASES)
def test_the_predicted_orbit_lies_on_the_run_that_has_reached_it(case: str) -> None:
    result, _ = made_up(*CASES[case])
    simulation = result.simulation
    late = simulation.t > 0.7 * simulation.t[-1]
    late &= ~np.isin(simulation.t, simulation.events.t)  # there the run has the value before the jump
    found = {group.path: group for group in list_groups(result)}
    y, u = (found[f"{where}/predicted"].values[late] for where in ("outputs", "inputs"))
    np.testing.assert_array_equal(found["outputs/predicted"].t, simulation.t)
    # a straight line over 1/200 of the orbit, and what is left of the approach
    np.testing.assert_allclose(y, simulation.y[late], atol=5e-3 * np.abs(simulation.y[late]).max())
    np.testing.assert_allclose(u, simulation.u[late], atol=5e-2 * np.abs(simulation.u[late]).max())


@pytest.mark.parametrize("case", CASES)
def test_the_critical_mode_is_gamma_at_the_last_events(case: str) -> None:
    """Eq. gamma: χ_k1 = ±γ at the events of the limit cycle, and all other modes vanish there."""
    result, _ = made_up(*CASES[case])
    found, gamma = {group.path: group for group in list_groups(result)}, result.prediction.gamma
    critical, others, at = (found[f"modes/{part}"] for part in ("critical", "others", "events"))
    assert gamma is not None
    np.testing.assert_allclose(np.abs(at.values[-4:, 0]), gamma, rtol=1e-3)
    rows = np.searchsorted(critical.t, at.t[-4:])
    np.testing.assert_array_equal(critical.values[rows, 0], at.values[-4:, 0])
    assert np.abs(others.values[rows]).max() < 1e-2 * gamma


def test_series_are_left_out_where_they_do_not_exist() -> None:
    result, _ = made_up(*CASES["+1"])
    everything = {group.path for group in list_groups(result)}
    nothing = dict.fromkeys(("delta_crit", "eigenvalue", "period", "gamma", "amplitude", "orbit", "V_inv"))
    none = replace(result, prediction=replace(result.prediction, cycle=False, **nothing))
    gone = {"outputs/predicted", "inputs/predicted", "interval/delta_crit"}
    gone |= {"modes/critical", "modes/others", "modes/gamma", "modes/events"}
    assert everything - {group.path for group in list_groups(none)} == gone
    ticking = replace(result.simulation, control="clock", E=np.full_like(result.simulation.E, np.nan))
    clock = replace(result, controller=result.controller.triggered_by(ClockTrigger(0.5)), simulation=ticking)
    assert everything - {g.path for g in list_groups(clock)} == {"trigger/E", "trigger/threshold", "trigger/events"}


class Box(EventRule):
    """A rule with a face for each state, which the viewer has never heard of."""

    size = 0.02

    def resized(self, size: float) -> Box:
        raise NotImplementedError

    def faces(self, design: Design) -> Faces:
        n = design.plant.n
        return Faces(np.eye(n) / self.size, np.arange(n + 1), unit=self.size**2)

    def facts(self) -> dict[str, float]:
        return {"half_width": self.size}


def test_the_event_function_of_any_rule_is_shown_against_its_threshold() -> None:
    result, _ = made_up(*CASES["+1"])
    simulation, rule = result.simulation, Box()
    e = simulation.x_h - simulation.x_o
    E = np.abs(e).max(axis=1) ** 2 - rule.size**2
    boxed = replace(result, controller=result.controller.triggered_by(rule), simulation=replace(simulation, E=E))
    shown = next(group for group in list_groups(boxed) if group.path == "trigger/E")
    before = np.searchsorted(shown.t, simulation.t)
    expected = np.abs(e).max(axis=1) / rule.size
    np.testing.assert_allclose(shown.values[before, 0], expected, atol=1e-7)
    after = np.searchsorted(shown.t, simulation.events.t, side="right") - 1
    np.testing.assert_array_equal(shown.values[after, 0], 0)


def test_what_is_named_a_ratio_reaches_one_at_its_threshold() -> None:
    """Beneath the title "E / threshold²" the threshold lay at 0, and on the live page the same thing crosses 1."""
    result, _ = made_up(*CASES["three-link"])
    found = {group.path: group for group in list_groups(result)}
    share, events = found["trigger/E"], result.simulation.events
    assert share.names == ("hold error / threshold",)
    for path in ("trigger/threshold", "trigger/events"):
        np.testing.assert_array_equal(found[path].values, 1)
    e = result.assumed.C @ (events.x_h - events.x_o).T
    size = np.linalg.norm(e, axis=0) / result.controller.trigger.q_t
    at = np.searchsorted(share.t, events.t)
    np.testing.assert_allclose(share.values[at, 0], size, rtol=1e-6)
    np.testing.assert_allclose(size, 1, rtol=1e-6)


def test_every_series_has_a_name_and_a_colour() -> None:
    result, _ = made_up(*CASES["three-link"])
    for group in list_groups(result):
        assert len(group.t) == len(group.values), group.path
        assert group.values.shape[1] == len(group.names) == len(group.colours), group.path
        assert (np.diff(group.t) >= 0).all(), group.path


def test_what_acts_is_drawn_where_it_is_not_the_command() -> None:
    """An actuator that passes half of what is asked for, and one that passes all but for rounding."""
    result, _ = made_up(*CASES["three-link"])
    u = result.simulation.u
    most = 0.5 * np.abs(u[:, 0]).max()
    applied = u * (1 + 1e-15)
    applied[:, 0] = np.clip(u[:, 0], -most, most)
    cut = replace(result, simulation=replace(result.simulation, applied=applied))
    group = next(group for group in list_groups(cut) if group.path == "inputs/what_acts")
    assert group.names == (f"{result.actual.inputs[0]}, what acts",)
    np.testing.assert_array_equal(group.values[:, 0], applied[:, 0])
    for whole in (result, replace(result, simulation=replace(result.simulation, applied=u))):
        assert "inputs/what_acts" not in {group.path for group in list_groups(whole)}


def test_pressure_is_drawn_with_its_jumps_at_events() -> None:
    result = standing()
    simulation, pressure = result.simulation, result.simulation.pressure
    assert pressure is not None
    found = {group.path: group for group in list_groups(result)}
    for path, before, after, names in (
        ("pressure/centre", pressure.centre[:, :1], pressure.centre_after[:, :1], ("x",)),
        ("load/borne", pressure.load, pressure.load_after, ("heel", "toe")),
    ):
        group = found[path]
        assert group.names == names
        np.testing.assert_array_equal(group.values[np.searchsorted(group.t, simulation.t)], before)
        late = np.searchsorted(group.t, simulation.events.t, side="right") - 1
        np.testing.assert_array_equal(group.values[late], after)
    np.testing.assert_array_equal(found["pressure/at_rest"].values, [[0.055], [0.055]])
