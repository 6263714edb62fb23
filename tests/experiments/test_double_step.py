"""Double steps: reaction times by definition of each kind of controller, to rounding and to the sampling interval."""

from dataclasses import replace

import double_step_cases as cases
import numpy as np
import pytest
from double_step_cases import D_OL, D_S, T_D
from scipy.signal import lfilter

from icmj.controller.step_pairs import StepPairs, double_steps, find_step_pairs
from icmj.errors import AnalysisError, DataError
from icmj.experiments.reconstruction import fit_response, own_response, reconstruct_steps
from icmj.experiments.refractoriness import KINDS, explain_reactions, refractoriness
from icmj.series.series import Series

ROWS = 0.01  # s
ISI = (0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 1.0)


@pytest.fixture(scope="module")
def pairs():
    return double_steps(ISI, 4, recovery=(1.5, 2.0), seed=3)


@pytest.fixture(scope="module")
def found(pairs):
    """What the loop's own model finds in records of each kind without noise."""
    records = {kind: cases.recorded(cases.controller(kind, pairs), pairs) for kind in KINDS}
    own = own_response(cases.controller("event", pairs))
    return {kind: reconstruct_steps(series, "joystick", pairs, response=own) for kind, series in records.items()}


@pytest.mark.parametrize("kind", KINDS)
def test_reaction_times_of_each_kind_are_those_of_its_definition(kind, pairs, found) -> None:
    assert np.abs(found[kind].rt - cases.expected(kind, pairs)).max() < ROWS


@pytest.mark.parametrize("plant", cases.PLANTS)
def test_a_sampling_delay_makes_the_control_that_its_definition_makes(plant) -> None:
    pairs = double_steps((0.05, 0.2, 0.3, 0.5), 2, recovery=(1.5, 2.0), seed=9)
    of = cases.controller("sampling", pairs, plant)
    found, expected = cases.recorded(of, pairs)["joystick"], cases.sampled_late(pairs, plant)["joystick"]
    # between the definition's two steps in one sample are 1e-9 s; commands are of some 10, and 100/s fast
    np.testing.assert_allclose(found, expected[: len(found)], rtol=0, atol=1e-6)


def test_a_continuous_loop_without_delay_reacts_at_once_and_leaves_nothing(pairs) -> None:
    of = cases.controller("no delay", pairs)
    seen = reconstruct_steps(cases.recorded(of, pairs), "joystick", pairs, response=own_response(of))
    np.testing.assert_allclose(seen.rt, 0, atol=1e-9)
    np.testing.assert_allclose(seen.fit, seen.u, rtol=0, atol=1e-9)


@pytest.mark.parametrize("plant", cases.PLANTS)
def test_what_an_exact_model_with_a_matched_hold_does_is_a_linear_response_to_moved_steps(plant) -> None:
    pairs = double_steps((0.1, 0.3, 0.5), 1, recovery=(1.5, 2.0), seed=8)
    of = cases.controller("event", pairs, plant)
    seen = reconstruct_steps(cases.recorded(of, pairs), "joystick", pairs, response=own_response(of))
    # events are exact to 1e-12 s, and the command's fastest rate is less than 100/s
    np.testing.assert_allclose(seen.rt, cases.expected("event", pairs), rtol=0, atol=1e-9)
    np.testing.assert_allclose(seen.fit, seen.u, rtol=0, atol=1e-9)
    assert seen.explained.min() > 1 - 1e-6


@pytest.mark.parametrize("plant", cases.PLANTS)
def test_a_fitted_model_finds_the_same_but_for_what_all_have_in_common(plant) -> None:
    pairs = double_steps((0.1, 0.25, 0.4, 0.6), 3, recovery=(2.0, 3.0), seed=4)
    of = cases.controller("event", pairs, plant)
    seen = reconstruct_steps(cases.recorded(of, pairs), "joystick", pairs)
    wrong = seen.rt - cases.expected("event", pairs)
    assert np.abs(wrong).max() < 2 * ROWS
    assert np.abs(wrong - wrong.mean()).max() < ROWS
    assert seen.explained.min() > 0.99


def test_a_fitted_response_is_that_of_the_model_that_made_the_record() -> None:
    random = np.random.default_rng(5)
    r = np.repeat(random.choice([-1.0, 0.0, 2.0], 60), 50)
    u = np.zeros(len(r))
    for k in range(2, len(r)):
        u[k] = 1.6 * u[k - 1] - 0.68 * u[k - 2] + 0.5 * r[k] - 0.42 * r[k - 1]
    model = fit_response(u + 0.02 * random.standard_normal(len(u)), r, ROWS)
    assert (len(model.a), len(model.b)) == (2, 2)
    np.testing.assert_allclose(np.append(model.a, model.b), [1.6, -0.68, 0.5, -0.42], rtol=0.05)


@pytest.mark.parametrize("seed", range(6))
def test_the_times_of_a_control_that_jumps_stand_at_rows_where_noise_moves_them_alike_to_either_side(seed) -> None:
    """Steps of 1 and 2 are answered by jumps that fade, by definition 0.14 s late, wherever in a row; noise is slow."""
    random, rows, P = np.random.default_rng(seed), 0.02, 40
    first = 1.0 + 2.5 * np.arange(P) + 0.5 * random.random(P)
    pairs = StepPairs(np.column_stack([first, first + 0.6]), np.outer(random.choice([-1.0, 1.0], P), [1.0, -2.0]))
    t = rows * np.arange(round((pairs.t[-1, 1] + 2.0) / rows))
    since = t[:, None] - pairs.t.ravel() - T_D
    u = np.where(since >= 0, 1 + 1.4 * np.exp(-28 * np.maximum(since, 0)), 0) @ pairs.sizes.ravel()
    slow = np.exp(-2 * np.pi * 3 * rows)
    noise = lfilter([0.1 * np.sqrt(1 - slow**2)], [1, -slow], random.standard_normal(len(t)))
    seen = reconstruct_steps(Series(t, (u + noise)[:, None], ("u",), ("m",)), "u", pairs)
    turned = np.exp(2j * np.pi * (pairs.t + seen.rt) / rows).mean()
    assert np.abs(turned) > 0.5  # a jump between two rows hardly says where between them
    # rows; noise, some 0.1 a time, leaves the mean of 80 a fifth of it
    assert abs(np.angle(turned)) / (2 * np.pi) < 0.06
    assert np.ptp(seen.rt) < 2 * rows


def test_an_event_rule_is_refractory_for_its_interval_and_no_other_kind_is(pairs, found) -> None:
    told = {kind: refractoriness(pairs.isi, of.rt) for kind, of in found.items()}
    event = told["event"]
    np.testing.assert_allclose([event.free.value, event.fixed.value], D_OL, atol=1e-6)
    assert event.slope.value == pytest.approx(-1, abs=1e-5)
    assert event.largest.value == pytest.approx(0.3)
    assert event.range.value == pytest.approx(D_OL - ISI[0], abs=1e-6)
    np.testing.assert_allclose(event.rt2, T_D + np.maximum(0, D_OL - np.array(ISI)), atol=1e-6)
    assert told["continuous"].largest.value == told["clock"].largest.value == 0
    assert abs(told["continuous"].rt2 - told["continuous"].rt1).max() < ROWS
    saw = refractoriness(pairs.isi, found["sampling"].rt, shortest=0.15)
    assert saw.fixed.value == pytest.approx(D_OL, abs=1e-5)
    assert saw.largest.value == pytest.approx(0.3)


def test_what_differs_within_one_sample_is_no_part_of_any_estimate_beyond_it() -> None:
    """RT1 of pairs in one sample, however wrong, moves neither line nor largest interval: 1 s and 0.3506 s it did."""
    isi = np.repeat([0.1, 0.2, 0.3, 0.4, 0.6, 1.0], 16)
    rt = 0.29 + np.column_stack([0 * isi, np.where(isi < 0.15, -isi, np.maximum(0, D_OL - isi))])
    rt += 2e-5 * np.tile([[1, 1], [-1, 1], [1, -1], [-1, -1]], (24, 1))  # a scatter whose means are zero
    rt[isi < 0.15, 0] -= 0.0036
    found = refractoriness(isi, rt, shortest=0.15)
    assert found.largest.value == pytest.approx(0.3)
    np.testing.assert_allclose([found.free.value, found.fixed.value], D_OL, atol=5e-5)


def test_a_clock_makes_both_late_by_half_its_interval_and_neither_later_than_the_other() -> None:
    pairs = double_steps((0.1, 0.2, 0.3, 0.5), 15, recovery=(1.2, 2.0), seed=1)
    seen = reconstruct_steps(
        cases.recorded(cases.controller("clock", pairs), pairs), "joystick", pairs,
        response=own_response(cases.controller("clock", pairs)),
    )  # fmt: skip
    error = D_OL / np.sqrt(12 * len(pairs))
    np.testing.assert_allclose(seen.rt.mean(axis=0), T_D + D_OL / 2, atol=3 * error)
    assert np.diff(seen.rt.mean(axis=0))[0] < 3 * np.sqrt(2) * error


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_is_told_by_its_reaction_times(kind, pairs, found) -> None:
    told = explain_reactions(pairs.isi, found[kind].rt, ROWS)
    assert told.kind == kind
    numbers = told.parameters[kind]
    assert numbers["c"] == pytest.approx(T_D + D_S * (kind == "sampling"), abs=ROWS)
    if kind != "continuous":
        assert told.intermittent
        assert numbers["D"] == pytest.approx(D_OL, abs=ROWS)


def test_estimates_of_drawn_reaction_times_are_where_they_were_drawn() -> None:
    """Coverage of the confidence intervals: a binomial count of 80 people, within four deviations from 95 %."""
    random, isi, many = np.random.default_rng(2), np.repeat([0.1, 0.15, 0.25, 0.4, 0.6, 1.0], 40), 80
    inside = np.zeros(2)
    for person in range(many):
        rt = T_D + np.column_stack([0 * isi, np.maximum(0, D_OL - isi)]) + 0.04 * random.standard_normal((len(isi), 2))
        told = refractoriness(isi, rt, seed=person, resamples=300)
        inside += D_OL in told.free, D_OL in told.fixed
    assert inside.min() >= 0.95 * many - 4 * np.sqrt(0.95 * 0.05 * many)


def test_reversals_of_equal_size_that_are_sampled_at_once_have_no_reaction_time() -> None:
    t = np.array([[2.0, 2.08], [5.03, 5.8], [8.0, 8.6], [11.0, 11.5]])
    pairs = StepPairs(t, [[1.0, -1.0]] * 4)
    of = cases.controller("clock", pairs)  # it ticks at 2.1 s, and sees both
    seen = reconstruct_steps(cases.recorded(of, pairs), "joystick", pairs, response=own_response(of))
    assert np.isnan(seen.rt[0]).all()
    assert np.isfinite(seen.rt[1:]).all()
    with pytest.raises(DataError, match="expected at least 3"):
        refractoriness(pairs.isi, seen.rt)


def test_pairs_are_found_again_where_they_were_put(pairs) -> None:
    series = cases.recorded(cases.controller("no delay", pairs), pairs)
    again = find_step_pairs(series, "target")
    late = again.t - pairs.t
    assert late.min() > -1e-9
    assert late.max() < ROWS + 1e-9
    np.testing.assert_allclose(again.sizes, pairs.sizes, atol=1e-12)


def test_every_interval_and_direction_comes_as_often_in_an_order_of_its_seed() -> None:
    made = double_steps((0.1, 0.5), 6, 2.0, recovery=(1.0, 1.5), seed=7)
    for isi in (0.1, 0.5):
        of = np.isclose(made.isi, isi)
        assert (of & made.same).sum() == (of & ~made.same).sum() == 6
    between = made.t[1:, 0] - made.t[:-1, 1]
    assert between.min() >= 1.0
    assert between.max() <= 1.5
    assert np.abs(np.cumsum(made.sizes.ravel())).max() <= 6.0
    assert (double_steps((0.1, 0.5), 6, 2.0, recovery=(1.0, 1.5), seed=7).t == made.t).all()
    assert (double_steps((0.1, 0.5), 6, 2.0, recovery=(1.0, 1.5), seed=8).t != made.t).any()


def test_the_shortest_interval_takes_part_whatever_the_times_of_its_steps_make_of_it() -> None:
    """An interval is the difference of two times: of 0.1 s it is a bit more or less, as the seed has it."""
    below = 0
    for seed in range(6):
        pairs = double_steps((0.1, 0.2, 0.3, 0.5), 3, seed=seed)
        rt = 0.2 + np.column_stack([0 * pairs.isi, np.maximum(0, 0.35 - pairs.isi)])
        at, under = (refractoriness(pairs.isi, rt, shortest=s, resamples=200).fixed for s in (0.1, 0.09))
        assert at == under
        below += refractoriness(pairs.isi, rt, resamples=200).isi[0] < 0.1
    assert below > 0


def test_a_record_that_just_suffices_is_taken_on_every_grid() -> None:
    """From 0.2 s before the first step to ``latest`` after the last, and ``latest`` between pairs, in random rows."""
    random, response, naive = np.random.default_rng(1), None, 0
    for _ in range(30):
        step = random.integers(5, 50) / 1000
        early, latest, begin = -(-0.2 // step), random.integers(10, 20) * step, random.integers(0, 99) * step
        at = early + np.cumsum([0, *(4, round(latest / step)) * 3, 4])
        series = series_of(steps(*at.astype(int), rows=int(at[-1] + round(latest / step)) + 1), step=step)
        series = replace(series, t=begin + series.t)
        pairs = find_step_pairs(series, "r")
        response = response or own_response(cases.controller("event", pairs))
        earliest = 0.2 - early * step  # from the first row on
        reconstruct_steps(series, "u", pairs, response=response, earliest=earliest, latest=latest)
        naive += pairs.t[-1, 1] + latest > series.t[-1] or (pairs.t[1:, 0] - pairs.t[:-1, 1]).min() < latest
    assert naive > 0


def series_of(r, u=None, step=0.01):
    r = np.asarray(r, dtype=float)
    return Series(step * np.arange(len(r)), np.column_stack([r, r if u is None else u]), ("r", "u"))


def steps(*at, rows=1000):
    r = np.zeros(rows)
    for k in at:
        r[k:] += 1
    return r


CLOSE = StepPairs([[1 + 2 * i, 1.015 + 2 * i] for i in range(4)], [[1.0, 1.0]] * 4)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: double_steps((0.1, -0.2), 3), "must be positive, each once"),
    (lambda: double_steps((0.1,), 0), "0 repetitions"),
    (lambda: double_steps((0.1,), 1, directions=("up",)), "expected some of same, reversal"),
    (lambda: double_steps((0.1,), 1, directions=("same", "same")), "each once"),
    (lambda: double_steps((0.1,), 1, recovery=(2.0, 1.0)), "recovery of 2 to 1 s"),
    (lambda: StepPairs([[1.0, 0.5]], [[1.0, 1.0]]), "rise from step to step"),
    (lambda: StepPairs([[1.0, 1.5]], [[1.0, 0.0]]), "not zero"),
    (lambda: find_step_pairs(series_of(np.zeros(50)), "r"), "never moves"),
    (lambda: find_step_pairs(series_of(np.arange(50.0)), "r"), "moves from row to row at 0.01 s"),
    (lambda: find_step_pairs(series_of(steps(100, 200, 300)), "r"), "3 steps, so one has no partner"),
    (lambda: find_step_pairs(series_of([0.0, np.nan, 1.0]), "r"), "1 values are missing"),
    (lambda: find_step_pairs(series_of(steps(1)), "target"), "no column 'target'"),
    (lambda: tried(100, 120), "1 pairs of steps; expected at least 4"),
    (lambda: tried(100, 120, 300, 320, 500, 520, 950, 970), "the record is from 0 to 9.99 s"),
    (lambda: tried(100, 120, 200, 220, 500, 520, 700, 720), "a pair at 2 s begins before"),
    (lambda: reconstruct_steps(series_of(steps(100, 102)), "u", CLOSE), "steps 0.015 s apart"),
    (lambda: tried(100, 120, 300, 320, 500, 520, 700, 720, u=np.ones(1000)), "does not move"),
    (lambda: refractoriness([0.1, 0.2], [[0.1, 0.2]]), r"expected \(P,\) and \(P, 2\)"),
    (lambda: refractoriness([0.1] * 9 + [0.5] * 9, np.ones((18, 2))), "2 inter-step intervals"),
    (lambda: refractoriness([0.1] * 3, np.ones((3, 2)), resamples=3), "3 resamples"),
    (lambda: explain_reactions([0.1] * 3, np.ones((3, 2)), 0.01), "3 pairs with reaction times"),
    (lambda: explain_reactions([0.1] * 3, np.ones((3, 2)), 0.0), "resolution of 0 s"),
])  # fmt: skip
def test_what_cannot_be_told_is_refused_in_one_line(call, words) -> None:
    with pytest.raises((DataError, AnalysisError), match=words):
        call()


def tried(*at, u=None):
    series = series_of(steps(*at), u)
    return reconstruct_steps(series, "u", find_step_pairs(series, "r"))


@pytest.mark.slow
def test_refractory_durations_put_in_come_out_with_noise_and_a_continuous_person_is_called_so() -> None:
    """Few of the people of ``docs/double_step.md``: of 3 intervals of 95 % one may miss, more in 1 % of times."""
    isi = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0)
    missed = 0
    for person, delta in enumerate((0.25, 0.35, 0.55, None)):  # each of another noise: those of one miss together
        pairs = double_steps(isi, 20, recovery=(1.2, 1.7), seed=person)
        of = cases.controller("event" if delta else "continuous", pairs, delta=delta or 1.0, q_t=0.4)
        series = cases.recorded(of, pairs, interval=0.02, noise=0.2, seed=person)
        seen = reconstruct_steps(series, "joystick", pairs)
        told = explain_reactions(pairs.isi, seen.rt, 0.02)
        assert told.kind == ("event" if delta else "continuous")
        missed += bool(delta) and delta not in refractoriness(pairs.isi, seen.rt, seed=person).fixed
    assert missed <= 1


def test_a_control_that_stays_as_it_is_has_no_model_of_a_response():
    """The logarithm of its power, 0, was taken: a warning, and a criterion of −∞."""
    r = np.where(np.arange(200) < 20, 0.0, 1.0)
    for u in (np.full(200, 0.3), 1e-200 * r):  # squares of the latter underflow
        with pytest.raises(DataError, match="no stable linear model fits the record"):
            fit_response(u, r, ROWS)
