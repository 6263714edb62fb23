"""The set-point alone: its shapes over time, and the steady states that it takes."""

import engine_cases
import linear_cases
import numpy as np
import pytest

from icmj.controller.setpoint import Target, pulse, ramp, setpoint, sines, step, ternary
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant

THREE_LINK = engine_cases.design("three_link").plant
T = np.linspace(0, 10, 4001)


def of_angle(*terms):
    return setpoint(linear_cases.PENDULUM, [Target({"angle": 1.0}, part) for part in terms])


def test_shapes_are_what_their_words_say() -> None:
    both = of_angle(step(2.0), pulse(1.0, 3.0, 2.0), ramp(4.0, 1.0, 2.0))
    expected = 2.0 + 1.0 * ((T >= 3) & (T < 5)) + np.interp(T, [1, 3], [0, 4])
    np.testing.assert_allclose(both(T)[:, 0], expected, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(both.edges, [1.0, 3.0, 5.0])
    assert both(0.0) == 2.0

    a, f, phi = [0.3, 0.2], [0.1, 0.7], [1.0, -2.0]
    waves = of_angle(sines(a, f, phi, 2.5))(T)[:, 0]
    parts = [a[i] * np.sin(2 * np.pi * f[i] * (T - 2.5) + phi[i]) for i in range(2)]
    np.testing.assert_allclose(waves, sum(parts) * (T >= 2.5), rtol=0, atol=1e-13)


def test_a_ternary_sequence_is_one_of_full_length() -> None:
    interval = 0.25
    r = of_angle(ternary(0.7, interval, 1.0, 1.0 + 3 * 242 * interval))
    at = 1.0 + interval * np.arange(3 * 242 + 1)
    path = r(at)[:, 0]
    velocity = np.round(np.diff(path) / np.abs(np.diff(path)).max()).astype(int)
    first = velocity[:242]
    np.testing.assert_array_equal(velocity, np.tile(first, 3))
    # a sequence of full length goes through every state of its register but the one of zeros
    rounds = np.concatenate([first, first[:4]]) % 3
    assert len({tuple(rounds[i : i + 5]) for i in range(242)}) == 242
    assert sorted((first == value).sum() for value in (-1, 0, 1)) == [80, 81, 81]
    assert np.ptp(path) == pytest.approx(0.7, rel=1e-12)
    np.testing.assert_allclose(path[242::242], 0, atol=1e-14)


@pytest.mark.parametrize("seed", range(8))
def test_the_assumed_plant_rests_in_its_steady_states(seed) -> None:
    random = np.random.default_rng(seed)
    n, n_u = int(random.integers(2, 7)), int(random.integers(1, 4))
    plant = LinearPlant(*(random.standard_normal(shape) for shape in ((n, n), (n, n_u), (n_u, n))))
    targets = [Target({name: 1.0}, step(1.0)) for name in plant.outputs]
    found = setpoint(plant, targets)
    scale = 1e-9 * (1 + np.abs(found.x_ss).max() + np.abs(found.u_ss).max())
    assert np.abs(plant.A @ found.x_ss + plant.B @ found.u_ss).max() < scale
    np.testing.assert_allclose(plant.C @ found.x_ss, np.eye(n_u), atol=scale)


def test_a_combination_takes_the_least_command() -> None:
    weights = dict(zip(THREE_LINK.outputs, (0.5, 0.3, 0.2), strict=True))
    found = setpoint(THREE_LINK, [Target(weights, step(0.01), "mass")])
    assert found.names == ("mass",)
    row = np.array(list(weights.values())) @ THREE_LINK.C
    assert row @ found.x_ss[:, 0] == pytest.approx(1.0, rel=1e-9)
    # every other posture that does it: move along what changes neither the sum nor the balance
    whole = np.block([[THREE_LINK.A, THREE_LINK.B], [row[None, :], np.zeros((1, 3))]])
    free = np.linalg.svd(whole)[2][np.linalg.matrix_rank(whole, tol=1e-9 * np.linalg.norm(whole)) :]
    assert len(free) == 2
    along = free[:, THREE_LINK.n :] @ found.u_ss[:, 0]
    assert np.abs(along).max() < 1e-8 * np.linalg.norm(found.u_ss) * np.abs(free).max()


def test_parts_of_one_name_are_added_and_others_are_channels() -> None:
    first, second = THREE_LINK.outputs[:2]
    parts = [
        Target({first: 1.0}, step(0.1, 1.0)),
        Target({second: 1.0}, step(0.3, 2.0)),
        Target({first: 1.0}, step(0.2, 3.0)),
    ]
    found = setpoint(THREE_LINK, parts)
    assert found.names == (first, second)
    np.testing.assert_allclose(found([0.0, 1.5, 2.5, 4.0]), [[0, 0], [0.1, 0], [0.1, 0.3], [0.3, 0.3]], atol=1e-15)


@pytest.mark.parametrize(("targets", "words"), [
    ([Target({"knee": 1.0}, step(1.0))], "outputs are angle, its states hinge, hinge_rate"),
    ([Target({"hinge_rate": 1.0}, step(1.0))], "no steady state"),
    ([Target({"angle": 1.0}, step(1.0)), Target({"angle": 2.0}, step(1.0), "twice")], "no steady state"),
    ([Target({"angle": 1.0}, step(1.0)), Target({"angle": 2.0}, step(1.0), "angle")], "is given twice"),
    ([Target({"angle": 0.0}, step(1.0))], "no steady state"),
    ([Target({"angle": 1.0, "hinge": 1.0}, step(1.0))], "needs a name"),
    ([Target({"angle": 1.0}, step(float("nan")))], "must be finite"),
    ([Target({"angle": 1.0}, step(1.0, -2.0))], "not negative"),
])  # fmt: skip
def test_what_it_cannot_be_is_refused(targets, words) -> None:
    with pytest.raises(AnalysisError, match=words):
        setpoint(linear_cases.PENDULUM, targets)


def neutral_plant(seed: int) -> tuple[LinearPlant, np.ndarray]:
    """A random plant at rest anywhere along a coordinate that its output does not see; and that coordinate."""
    random = np.random.default_rng(seed)
    n, n_u = int(random.integers(2, 7)), int(random.integers(2, 4))
    A, B, C = (random.standard_normal(shape) for shape in ((n, n), (n, n_u), (1, n)))
    free = random.standard_normal((n, 1))
    free /= np.linalg.norm(free)
    return LinearPlant(A - A @ free @ free.T, B * 10.0 ** random.integers(-6, 7), C - C @ free @ free.T), free


@pytest.mark.parametrize("first", [0, pytest.param(100, marks=pytest.mark.slow)])
def test_a_coordinate_that_is_at_rest_anywhere_needs_no_command(first) -> None:
    """The steady state is that of the plant without the coordinate, of least command, by Lagrange's multipliers."""
    for seed in range(first, 100 if not first else 1000):
        plant, free = neutral_plant(seed)
        found = setpoint(plant, [Target({plant.outputs[0]: 1.0}, step(1.0))])
        across = np.linalg.svd(free)[0][:, 1:]
        b = 1 / np.abs(plant.B).max()
        M = np.vstack(
            [np.hstack([plant.A @ across, plant.B * b]), np.hstack([plant.C @ across, np.zeros((1, plant.n_u))])]
        )
        rows, columns = M.shape
        KKT = np.block([[np.diag(np.arange(columns) >= plant.n - 1), M.T], [M, np.zeros((rows, rows))]])
        best = np.linalg.solve(KKT, np.eye(columns + rows)[-1])[:columns]
        x, u = across @ best[: plant.n - 1], best[plant.n - 1 :]
        largest = np.abs(best).max()
        rounding = 1e-15 * np.linalg.cond(KKT) * largest
        np.testing.assert_allclose(found.x_ss[:, 0], x, rtol=0, atol=rounding + 1e-10 * largest)
        np.testing.assert_allclose(found.u_ss[:, 0] / b, u, rtol=0, atol=rounding + 1e-10 * largest)
        rest = plant.A @ found.x_ss + plant.B @ found.u_ss
        assert np.abs(rest).max() < 1e-10 * (1 + largest)
        assert plant.C @ found.x_ss == pytest.approx(np.ones((1, 1)), abs=1e-10 * (1 + largest))


def plant_of_whole_numbers(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, B and C of up to eight states and four inputs; up to two states are coordinates on which no rate depends."""
    random = np.random.default_rng(seed)
    n, n_u = int(random.integers(1, 9)), int(random.integers(1, 5))
    n_y, free = int(random.integers(1, n_u + 1)), min(int(random.integers(0, 3)), n)
    A = random.integers(-5, 6, (n, n)) * (random.random((n, n)) < 0.7)
    B, C = random.integers(-3, 4, (n, n_u)), random.integers(-3, 4, (n_y, n))
    A[:, n - free :] = 0
    if random.random() < 0.6:
        C[:, n - free :] = 0
    if random.random() < 0.3:
        B[n - free :] = 0
    return A, B, C


@pytest.mark.parametrize("first", [0, pytest.param(100, marks=pytest.mark.slow)])
def test_a_plant_in_any_units_rests_where_exact_ranks_say_that_it_can(first: int) -> None:
    matrix = pytest.importorskip("flint", reason="exact ranks").fmpz_mat
    for seed in range(first, 100 if not first else 1000):
        A, B, C = plant_of_whole_numbers(seed)
        whole = np.block([[A, B], [C, np.zeros((len(C), B.shape[1]), int)]])
        wanted = np.vstack([np.zeros((len(A), len(C)), int), np.eye(len(C), dtype=int)])
        solvable = matrix(whole.tolist()).rank() == matrix(np.hstack([whole, wanted]).tolist()).rank()
        random = np.random.default_rng(seed)
        X, U, Y = (2.0 ** random.integers(-9, 10, size) for size in (len(A), B.shape[1], len(C)))
        hour = 2.0 ** random.integers(-10, 11)
        plant = LinearPlant(A * X / X[:, None] * hour, B * U / X[:, None] * hour, C * X / Y[:, None])
        targets = [Target({name: 1.0}, step(1.0)) for name in plant.outputs]
        if not solvable:
            with pytest.raises(AnalysisError, match="no steady state"):
                setpoint(plant, targets)
            continue
        found = setpoint(plant, targets)
        x, u = X[:, None] * found.x_ss / Y, U[:, None] * found.u_ss / Y
        size = np.maximum(np.abs(x).max(axis=0), np.abs(u).max(axis=0))
        assert (np.abs(A @ x + B @ u) <= 1e-9 * size).all(), seed
        assert (np.abs(C @ x - np.eye(len(C))) <= 1e-9 * np.maximum(size, 1)).all(), seed
