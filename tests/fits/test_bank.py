"""Families and their banks: the public path's bits, whatever the chunks and processes, and after being killed."""

import shutil
from dataclasses import replace
from functools import partial

import numpy as np
import pyarrow.parquet as pq
import pytest
from tampering import reseal

import icmj
from icmj.case.case import prepare, simulate
from icmj.errors import FitError, RunFileError
from icmj.fits.bank import DRAWS, read_bank, simulate_bank
from icmj.fits.family import WARM_UP, load_family
from icmj.fits.summaries import SUMMARIES, measures
from icmj.simulation.settings import reseed
from icmj.work.shipped import FAMILIES


def same(one, other):
    for name in ("theta", "summaries", "fell"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize("name", sorted(FAMILIES.files))
def test_each_shipped_family_stands_in_the_middle_of_its_prior_and_a_bank_has_its_summaries(name):
    family = load_family(name)
    assert family.name == name
    member = family.member(family.prior.from_normal(np.zeros((1, len(family.prior))))[0], 30.0)
    cop = member.trial(1)
    assert cop.shape == (3000,)
    assert 1e-4 < cop.std() < 0.05


@pytest.mark.parametrize("name", ["event", "switching"])
def test_a_trial_is_that_of_the_public_path_bit_for_bit(name):
    family = load_family(name)
    member = family.member(family.prior.from_normal(np.full((1, len(family.prior)), 0.2))[0], 30.0)
    if not member.run.has_events:
        trial = prepare(member.run)
        run = simulate(replace(trial, settings=reseed(trial.settings, 5)), "linear")
    else:
        case = icmj.prepare(member.run)
        run = icmj.simulate(replace(case, settings=reseed(case.settings, 5)), "linear")
    at = np.searchsorted(run.t, WARM_UP + np.arange(3000) / 100 - 1e-9)
    states = run.labels.states
    stiffness = 770.015 - member.plant.A[1, 0] / 0.0109426
    torque = run.x[:, states.index("ankle_torque_act")] - stiffness * run.x[:, 0] - 3.850 * run.x[:, 1]
    np.testing.assert_array_equal(member.trial(5), run.x[at] @ member.weights)
    np.testing.assert_allclose(member.trial(5), -torque[at] / 762.04, rtol=0, atol=1e-12)


def test_a_bank_is_the_same_whatever_the_chunks_and_goes_on_where_it_was_killed(tmp_path):
    family = load_family("clock")
    whole = simulate_bank(family, 7, seed=4, trials=2, duration=30.0, jobs=1)
    assert whole.summaries.shape == (7, 2, len(SUMMARIES))
    assert np.isfinite(whole.stood.summaries).all()
    assert 0 < measures(whole.stood.summaries)[..., 0].max() < 0.5
    first = simulate_bank(family, 5, seed=4, trials=2, duration=30.0, jobs=1, folder=tmp_path, chunk=2)
    same(first, replace(whole, theta=whole.theta[:5], summaries=whole.summaries[:5], fell=whole.fell[:5]))
    kept = (tmp_path / DRAWS / "00000000.parquet").stat().st_mtime_ns
    # a chunk that somebody changed is refused until it is removed; one that is missing is simulated
    (tmp_path / DRAWS / "00000002.parquet").write_bytes(b"PAR1")
    go_on = partial(simulate_bank, family, 7, seed=4, trials=2, duration=30.0, jobs=1, folder=tmp_path, chunk=2)
    for use in (lambda: read_bank(tmp_path), go_on):
        with pytest.raises(FitError, match=r"00000002.parquet: cannot be read \(.* not as it was written.*; remove it"):
            use()
    (tmp_path / DRAWS / "00000002.parquet").unlink()
    seen = []
    same(go_on(progress=seen.append), whole)
    assert seen == [0.5, 0.75, 1.0]  # only the first chunk is as it was: the last had one row of two
    assert (tmp_path / DRAWS / "00000000.parquet").stat().st_mtime_ns == kept
    same(read_bank(tmp_path), whole)
    for other, words in (({"seed": 5}, "holds another bank"), ({"trials": 3}, "holds another bank")):
        with pytest.raises(FitError, match=words):
            simulate_bank(family, 7, **{"seed": 4, "trials": 2, **other}, duration=30.0, jobs=1, folder=tmp_path)
    with pytest.raises(FitError, match="holds another bank"):
        simulate_bank(load_family("event"), 7, seed=4, trials=2, duration=30.0, jobs=1, folder=tmp_path)
    shutil.rmtree(tmp_path / DRAWS)
    with pytest.raises(FitError, match="no draw is finished"):
        read_bank(tmp_path)


@pytest.mark.slow
def test_processes_compute_the_same_bits(tmp_path):
    family = load_family("delayed-pd")
    alone = simulate_bank(family, 6, seed=1, trials=1, duration=30.0, jobs=1)
    same(simulate_bank(family, 6, seed=1, trials=1, duration=30.0, jobs=2, chunk=2, folder=tmp_path), alone)
    assert pq.read_table(tmp_path / DRAWS / "00000002.parquet")["draw"].to_pylist() == [2, 3]


def test_what_falls_is_told_and_left_out():
    family = load_family("delayed-pd")
    bank = simulate_bank(family, 12, seed=0, trials=1, duration=30.0, jobs=1)
    assert 0 < bank.fell.sum() < 12
    assert np.isnan(bank.summaries[bank.fell]).all()
    assert len(bank.stood) == 12 - bank.fell.sum()
    assert f"{100 * bank.fell.mean():.1f} % fell" in bank.words
    np.testing.assert_allclose(bank.prior.from_normal(bank.z), bank.theta, rtol=1e-9)


def grows(theta) -> bool:
    """Of delayed feedback of one link with muscles: by det Δ(s) as it is written down, along a large half circle."""
    topples, P, D, delay, muscle = theta[:5]
    arc = 1000 * np.exp(1j * np.linspace(-np.pi / 2, np.pi / 2, 20_001))
    axis = 1j * np.concatenate([np.linspace(1000, 1, 40_001), np.linspace(1, -1, 4001), np.linspace(-1, -1000, 40_001)])
    s = np.concatenate([arc, axis])
    torque = (P + D * s) * np.exp(-s * delay) / (muscle * s + 1) - topples
    turned = np.unwrap(np.angle((muscle * s + 1) * (s**2 + 0.04213 * s + 0.0109426 * torque)))
    return round((turned[-1] - turned[0]) / (2 * np.pi)) > 0


def test_a_continuous_member_whose_loop_grows_is_left_out_though_it_stood():
    family = load_family("delayed-pd")
    bank = simulate_bank(family, 12, seed=0, trials=1, duration=30.0, jobs=1)
    grow = np.array([grows(theta) for theta in bank.theta])
    assert bank.fell[grow].all()
    at = 11  # by its loop alone
    member = family.member(bank.theta[at], 30.0)
    assert grow[at]
    assert member.trial(1) is None
    assert simulate(prepare(member.run), "linear").outcome.kind == "completed"
    assert not bank.fell[~grow].all()
    assert "or stood with an unstable loop" in bank.words


@pytest.mark.parametrize("name", ["event", "clock", "switching"])
def test_a_member_that_cycles_is_not_judged_by_its_loop(name):
    member = load_family(name)._middle
    assert not member.has_one_loop
    assert not member.unstable


def test_a_family_file_that_is_wrong_is_one_line(tmp_path):
    text = FAMILIES.files["event"].read_text(encoding="utf-8")
    shutil.copytree(FAMILIES.folder / "runs", tmp_path / "runs")
    wrong = {
        'keys = { "design.R_c" = 1.0 }': ('keys = { "design.R_d" = 1.0 }', RunFileError, "R_d"),
        "low = 0.06, high = 0.2": ("low = 0.2, high = 0.06", RunFileError, "low 0.2 is not below high 0.06"),
        'kind = "log-uniform", low = 3e-4': ('kind = "log-uniform", low = 0.0', RunFileError, "of positive numbers"),
        'name = "q_t"': ('name = "R_c"', RunFileError, "two parameters are called R_c"),
        "lean_rate = -3.850": ("lean_rat = -3.850", FitError, "names 'lean_rat', which is no state"),
        'run = "runs/standing-intermittent.toml"': ('run = "nowhere.toml"', RunFileError, "nowhere.toml"),
        'prior = { kind = "uniform", low = 0.1, high = 0.4 }': (
            'prior = { kind = "normal", median = 0.1 }', RunFileError, "a normal prior needs deviation",
        ),
    }  # fmt: skip
    for there, (instead, error, words) in wrong.items():
        assert there in text, there
        (tmp_path / "f.toml").write_text(text.replace(there, instead), encoding="utf-8")
        with pytest.raises(error, match=words):
            load_family(tmp_path / "f.toml")
    with pytest.raises(RunFileError, match="did you mean event"):
        load_family("evnt")


def test_a_number_that_changed_before_its_digest_was_taken_is_noticed(tmp_path):
    """One bit of a number made another bank, if the digest was that of the changed file: each page has its own."""
    bank = simulate_bank(load_family("clock"), 3, seed=4, trials=1, duration=30.0, jobs=1, folder=tmp_path)
    path = tmp_path / DRAWS / "00000000.parquet"
    content = bytearray(path.read_bytes())
    content[content.index(bank.theta[1, 0].tobytes()) + 3] ^= 1
    path.write_bytes(content)
    reseal(tmp_path)
    with pytest.raises(FitError, match=r"00000000\.parquet: cannot be read \(.*checksum"):
        read_bank(tmp_path)
