"""Branches of cycles against the theory, closed forms, and a plant written by hand on SciPy's integrator and solver."""

import numpy as np
import pytest
from cycle_cases import RUNS, branch, case, return_map
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

import icmj
from icmj import branch_off, follow, load_run
from icmj.cycle.branch import Branch, SpecialPoint, pack, unpack
from icmj.cycle.cycle import find_cycle
from icmj.cycle.family import ReturnMaps
from icmj.cycle.guess import Guess
from icmj.cycle.jacobian import difference_jacobian
from icmj.cycle.parameter import find_parameter
from icmj.errors import CycleError, RunFileError


def the(of: Branch, kind: str) -> SpecialPoint:
    """The one special point of a kind."""
    found = [special for special in of.specials if special.kind == kind]
    assert len(found) == 1, of.specials
    return found[0]


def test_on_the_linear_plant_it_is_the_prediction_at_every_gain() -> None:
    found = branch("simple-0.8", "b", 0.6, plant="linear", points=6)
    assert found.value[0] == 0.8
    assert found.value[-1] == 0.6
    assert found.closure.max() <= 1e-10
    for i in range(len(found)):
        predicted = case("simple-0.8", actual__gain=float(found.value[i])).prediction
        assert found.interval[i] == pytest.approx(predicted.delta_crit, rel=1e-9)
        np.testing.assert_allclose(found.y_peak[i], predicted.orbit.y_peak, rtol=1e-9)
        np.testing.assert_allclose(found.multipliers[i], predicted.multipliers, atol=1e-9)


@pytest.mark.parametrize("plant", ["linear", pytest.param("mujoco", marks=pytest.mark.slow)])
@pytest.mark.parametrize("delay", [0.0, 0.03])
def test_on_a_family_nothing_bifurcates_and_every_cycle_says_that_it_is_one_of_them(plant: str, delay: float) -> None:
    """With a zero-order hold one multiplier of a mirrored cycle is +1 at every gain, up to rounding.

    A delay that the controller does not know of changes nothing in that.
    """
    changes = {"design.R_c": 0.01, "design.R_o": 1e-4, "controller.Q_t": "identity", "controller.hold": "zero-order"}
    late = {"actual.delay": delay, "assumed.delay": 0.0} if delay else {}
    run = load_run(RUNS / "simple-1.2.toml").with_(**changes, **late, **{"actual.gain": 1.3})
    found = follow(run, "b", 1.4, plant=plant, points=4)
    assert found.specials == ()
    assert found.alternating.all()
    assert found.attracting.all()
    off = np.abs(found.multipliers - 1).min(axis=1)
    assert (
        off[[0, -1]].max() < 1e-9
    )  # computed there, and between them interpolated, as accurately as docs/cycles.md says
    assert off.max() < (3e-4 if delay else 1e-5)
    alone = find_cycle(icmj.prepare(run), plant)
    assert (alone.attracting, alone.alternating, len(alone.isolated)) == (True, True, 5 if delay else 3)
    assert alone.verdict == "family"
    assert alone.words.startswith("A mirrored period-2 cycle")
    assert "settles" in alone.words
    assert found.largest[0] == pytest.approx(np.abs(alone.isolated).max(), abs=1e-4)
    np.testing.assert_array_equal(unpack(*pack(found)).alternating, found.alternating)


@pytest.mark.parametrize(("start", "end"), [(0.0, 0.04), (0.04, 0.0)])
@pytest.mark.parametrize("plant", ["linear", pytest.param("mujoco", marks=pytest.mark.slow)])
def test_a_family_that_a_predicted_delay_ends_is_one_at_no_delay_alone(plant: str, start: float, end: float) -> None:
    """Each cycle against Newton's at its delay; the multiplier at +1 that leaves the circle at 0 is no bifurcation."""
    changes = {"design.R_c": 0.01, "design.R_o": 1e-4, "controller.Q_t": "identity", "controller.hold": "zero-order"}
    run = load_run(RUNS / "simple-1.2.toml").with_(**changes, **{"actual.gain": 1.3})
    found = follow(run, "delay", end, start_at=start, plant=plant, points=4)
    np.testing.assert_array_equal(found.alternating, found.value == 0)
    assert found.alternating.sum() == 1
    for i in (0, -1):
        alone = find_cycle(icmj.prepare(find_parameter("delay").put(run, float(found.value[i]))), plant)
        assert (alone.alternating, alone.attracting) == (found.alternating[i], found.attracting[i])
        assert found.largest[i] == pytest.approx(np.abs(alone.isolated).max(), abs=1e-4)
    assert found.specials == ()


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
@pytest.mark.parametrize(("start", "end"), [(0.0, 0.06), (0.06, 0.0)])
def test_a_branch_in_the_delay_begins_or_ends_without_one(start: float, end: float, plant: str) -> None:
    """Where z has no hold of its own; the cycles at both ends are those that Newton finds with and without a delay."""
    found = branch("three-link-0.9", "delay", end, start_at=start, plant=plant, points=5)
    assert (found.value[0], found.value[-1]) == (start, end)
    assert found.closure.max() <= 1e-10
    for i in (0, -1):
        delay = float(found.value[i])
        alone = find_cycle(case("three-link-0.9", assumed__delay=delay, actual__delay=delay), plant)
        assert found.interval[i] == pytest.approx(alone.interval, rel=1e-9)
        np.testing.assert_allclose(found.y_peak[i], alone.y_peak, rtol=1e-7)
        N = len(alone.multipliers)  # along a branch they are right to some 1e-4
        np.testing.assert_allclose(np.abs(found.multipliers[i][:N]), np.abs(alone.multipliers), atol=3e-4)
        np.testing.assert_allclose(found.multipliers[i][N:], 0, atol=1e-9)  # what is forgotten


@pytest.mark.slow
def test_a_closed_branch_is_walked_once() -> None:
    """Between a mirrored cycle's loss of symmetry and the flip of a cycle of one interval, halves change places."""
    straight = branch("three-link-1.1", "gravity", 1.123, start_at=1.1, points=4)
    round_ = branch_off(straight, the(straight, "symmetry breaking"), to=1.2, points=4)
    assert round_.end.startswith("is closed: it came back to where it began, 1.12181")
    assert len(round_) < 60
    assert round_.attracting.all()
    far = int(round_.value.argmax())
    assert round_.value[far] == pytest.approx(1.12226, abs=1e-5)
    loop = ReturnMaps(round_.run, find_parameter("gravity")).at(float(round_.value[far]))
    one = np.linalg.eigvals(difference_jacobian(loop, round_.states[far, 0], round_.scale).J)
    assert np.abs(one + 1).min() < 1e-2  # of one interval's map: it is the flip's other side
    gap = round_.intervals[:, 0] - round_.intervals[:, 1]
    # once round it has been the cycle and its mirror image, begun at either half
    assert (np.diff(np.sign(gap)) != 0).sum() == 4
    start, before, after = (round_.states[i, 0] / round_.scale for i in (0, -2, -1))
    part = (start - before) @ (after - before) / ((after - before) @ (after - before))
    assert 0 < part <= 1
    assert np.abs(before + part * (after - before) - start).max() < 0.02  # a chord of a curve


def pendulum_interval(of: icmj.Case, z: np.ndarray) -> tuple[float, np.ndarray]:
    """One interval of θ'' = sin θ + b u under the controller's equations, written down and integrated by DOP853."""
    d, rule = of.controller.design, of.rule
    P, b = d.plant, of.run.actual.gain
    A_c = P.A - P.B @ d.k

    def rhs(t: float, w: np.ndarray) -> np.ndarray:
        x, x_o, x_h = np.split(w, 3)
        u = float(-d.k[0] @ x_h)
        slope = P.A @ x_o + P.B[:, 0] * u + d.L[:, 0] * (x[0] - float(P.C[0] @ x_o))
        return np.concatenate([[x[1], np.sin(x[0]) + b * u], slope, A_c @ x_h])

    def E(t: float, w: np.ndarray) -> float:
        e = w[4:] - w[2:4]
        return float(e @ rule.Q_t @ e - rule.q_t**2)

    E.terminal, E.direction = True, 1
    run = solve_ivp(rhs, (0, 20), np.append(z, z[2:]), events=E, method="DOP853", rtol=1e-12, atol=1e-14)
    assert run.status == 1
    return float(run.t[-1]), run.y[:4, -1]


def test_ten_points_of_a_pendulum_written_by_hand() -> None:
    found = branch("simple-0.8", "b", 0.6, start_at=0.9, points=10)
    assert len(found) >= 10
    for i in np.linspace(0, len(found) - 1, 10).astype(int):
        of = case("simple-0.8", actual__gain=float(found.value[i]))
        z0, scale = found.states[i, 0], found.scale
        off = z0 / scale * (1 + 1e-3)

        def gap(w: np.ndarray, of: icmj.Case = of, scale: np.ndarray = scale) -> np.ndarray:
            return pendulum_interval(of, w * scale)[1] / scale - w

        solved = root(gap, off, tol=1e-12)
        interval, _ = pendulum_interval(of, solved.x * scale)
        assert found.interval[i] == pytest.approx(interval, rel=1e-8)
        np.testing.assert_allclose(z0, solved.x * scale, atol=1e-8 * np.abs(z0).max())


def test_without_a_model_error_the_interval_is_infinite_and_the_branch_says_so() -> None:
    for name, value in (("simple-0.8", 0.8), ("simple-1.2", 1.2)):
        found = branch(name, "b", 1.0 + 0.1 * (1.0 - value), plant="linear", points=15)
        end = the(found, "homoclinic")
        assert end.value == pytest.approx(1.0, abs=1e-6)
        assert "1 rad/s" in end.words  # the pendulum's own unstable pole
        assert len(found) < 40
        # Δ = c − ln|1 − b|, in its last points
        law = found.interval + np.log(np.abs(1 - found.value))
        assert np.ptp(law[-3:]) < 1e-3


def test_where_the_mirrored_cycle_loses_its_symmetry_the_other_attractor_is_born() -> None:
    found = branch("simple-1.7", "b", 1.5, plant="linear", points=8)
    born = the(found, "symmetry breaking")

    def largest(b: float) -> float:
        values = case("simple-1.7", actual__gain=b).prediction.multipliers
        return float(values[np.argmin(np.abs(values - 1))].real) - 1

    assert born.value == pytest.approx(brentq(largest, 1.52, 1.54, xtol=1e-9), abs=1e-6)
    assert born.multiplier == pytest.approx(1, abs=1e-6)
    assert (found.attracting == (found.value < born.value)).all()
    other = branch_off(found, born, points=10)
    assert other.events == 2
    assert not other.mirrored
    assert other.value[-1] == pytest.approx(1.7)
    np.testing.assert_allclose(np.sort(other.intervals[-1]), [0.776, 1.788], atol=6e-4)
    assert other.attracting.all()


@pytest.mark.parametrize(("name", "points"), [("simple-0.8", 8), ("three-link-0.9", 12)])
def test_an_interval_that_falls_to_the_refractory_period_ends_the_branch(name: str, points: int) -> None:
    """And nothing else does: beyond it multipliers are those of a clock, which is no crossing."""
    found = branch(name, "delta_min", 2.5, plant="linear", points=points)
    assert len(found.specials) == 1
    np.testing.assert_allclose(found.largest, found.largest[0], rtol=1e-6)
    end = the(found, "least interval")
    predicted = case(name).prediction.delta_crit  # which knows no Δ_min
    assert end.value == pytest.approx(predicted, abs=1e-6)
    np.testing.assert_allclose(found.interval, predicted, rtol=1e-9)


def test_a_body_that_falls_ends_the_branch_where_it_reaches_the_limit() -> None:
    found = branch("simple-0.8", "q_t", 0.5, limit=0.2, points=10)
    end = the(found, "fall")
    # θ itself is the output
    slope = float(found.y_peak[-1, 0]) / end.value
    assert found.y_peak[-1, 0] == pytest.approx(0.2, abs=slope * 2e-6)


def test_an_event_function_that_grazes_ends_the_branch() -> None:
    found = branch("simple-1.2", "b", 4.0, plant="linear", points=10)
    end = the(found, "grazing")

    def admissible(b: float) -> bool:
        return case("simple-1.2", actual__gain=b).prediction.orbit.admissible

    assert admissible(end.value - 2e-6)
    assert not admissible(end.value + 2e-6)


@pytest.mark.slow
def test_the_three_link_person_with_strong_muscles_turns_quasi_periodic_and_then_the_branch_folds() -> None:
    found = branch("three-link-1.1", "b", 1.6, points=12)
    first = found.specials[0]
    assert first.kind == "Neimark–Sacker"
    assert first.value == pytest.approx(1.384448, abs=2e-6)
    of = case("three-link-1.1", actual__gain=first.value)
    loop = return_map(of)
    J = difference_jacobian(loop, first.state, found.scale).J  # by differences of flights, not by variation
    values = np.linalg.eigvals(J)
    assert np.abs(values).max() == pytest.approx(1, abs=2e-6)
    fold = next(special for special in found.specials if special.kind == "fold")
    assert fold.value == pytest.approx(1.5120616, abs=2e-6)
    with pytest.raises(CycleError):  # beyond it this cycle is no more
        icmj.find_cycle(
            case("three-link-1.1", actual__gain=fold.value + 1e-3),
            start=Guess(fold.state, found.scale, 1, -1, float(fold.intervals.max())),
        )


@pytest.mark.slow
def test_the_three_link_person_sways_up_to_half_a_radian_of_threshold() -> None:
    found = branch("three-link-0.9", "q_t", 0.5, start_at=1e-4, points=12)
    assert found.value[-1] == 0.5
    assert found.attracting.all()
    gap = np.abs(found.interval / case("three-link-0.9").prediction.delta_crit - 1)
    small = (found.value > 2e-3) & (found.value < 3e-2)
    slope = np.polyfit(np.log(found.value[small]), np.log(gap[small]), 1)[0]
    assert slope == pytest.approx(2, abs=0.05)


@pytest.mark.parametrize(("name", "to", "error", "words"), [
    ("strength", 1.0, CycleError, "no parameter 'strength'"),
    ("b", 0.8, CycleError, "two different values"),
    ("controller.hold", 1.0, CycleError, "a parameter is one number"),
    ("controller.q_tt", 1.0, CycleError, "has no key 'controller.q_tt' that is one number"),
    ("actual.delay", 1.0, CycleError, "does not set actual.delay; say where to begin, with --from"),
    ("q_t", -1.0, RunFileError, "q_t"),
])  # fmt: skip
def test_what_is_no_parameter_is_refused(name: str, to: float, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        follow(load_run(RUNS / "simple-0.8.toml"), name, to, plant="linear", points=5)


@pytest.mark.parametrize(("name", "parameter", "to"), [("three-link-0.9", "b", 0.85), ("neglected-0.5", "q_t", 0.2)])
def test_multipliers_that_are_interpolated_are_those_of_the_cycles(name: str, parameter: str, to: float) -> None:
    """At every fifth cycle of a branch on MuJoCo, against differences of flights."""
    found = branch(name, parameter, to, points=30)
    assert found.closure.max() <= 1e-10
    for i in range(3, len(found), 5):
        key = {"b": "actual__gain", "q_t": "controller__q_t"}[parameter]
        loop = return_map(case(name, **{key: float(found.value[i])}), "mujoco")
        scale = found.scale * (found.value[i] / found.value[0] if parameter == "q_t" else 1.0)
        values = np.linalg.eigvals(difference_jacobian(loop, found.states[i, 0], scale).J)
        largest = np.sort(np.abs(values))[::-1]
        np.testing.assert_allclose(np.abs(found.multipliers[i])[:2], largest[:2], atol=2e-4)
