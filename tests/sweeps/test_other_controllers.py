"""Sweeps of controllers that are not intermittent: characteristic roots, and what the runs did."""

import numpy as np
import pytest

import icmj
from icmj import load_run, prepare, simulate
from icmj.errors import RunFileError
from icmj.experiments.switching_rounds import rounds_of
from icmj.report.sections.swept_maps import pictures
from icmj.runfile.sweep_tables import load_sweep

SWEEP = """
[sweep]
name = "gains"
run = "one-link-switching"
[[vary]]
field = "controller.P"
values = [100.0, 147.15, 300.0]
[[vary]]
field = "controller.D"
values = [10.0, 40.0]
[ask]
motion = ["linear"]
[set]
simulation.duration = 30.0
"""


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    folder = tmp_path_factory.mktemp("swept")
    (folder / "gains.toml").write_text(SWEEP)
    icmj.sweep(folder / "gains.toml", folder / "out", jobs=1)
    return icmj.read_sweep(folder / "out")


def test_each_row_has_the_root_that_is_known_and_what_the_run_does(swept):
    rows = swept.table.to_pylist()
    assert len(rows) == 6
    assert {row["status"] for row in rows} == {"ok"}
    # printed gains of Asai (2009) held on: 0.126600 ± 0.683274j
    printed = next(row for row in rows if (row["P"], row["D"]) == (147.15, 10.0))
    assert (printed["root_real"], printed["root_imag"]) == pytest.approx((0.126600, 0.683274), abs=1e-6)
    assert all(row["root_real"] > 0 for row in rows if row["P"] < 117)  # below (1 − 0.8) mgh
    for row in (printed, rows[-1]):
        gains = {f"controller.{name}": row[name] for name in "PD"}
        run = load_run("one-link-switching").with_(**gains, **{"simulation.duration": 30.0})
        alone = simulate(prepare(run), "linear")
        late = alone.y[alone.t >= alone.t[-1] / 2]
        assert row["linear_outcome"] == alone.outcome.kind
        assert row["linear_switches"] == len(alone.events)
        assert row["linear_peak_lean"] == np.abs(late[:, 0]).max()
        assert row["linear_rms_lean"] == pytest.approx(late[:, 0].std(), rel=1e-12)
        found = rounds_of(alone)
        told = [row["linear_growth"], row["linear_factor"] or np.nan]
        assert told == pytest.approx([found.growth, found.factor], nan_ok=True)


def test_the_report_draws_the_size_of_the_sway(swept, tmp_path):
    drawn = list(pictures(swept))
    assert [picture.name for picture in drawn] == ["sway_linear"]
    words = [text.get_text() for text in drawn[0].draw().axes[0].get_legend().get_texts()]
    assert words == ["falls", "limit of stability, feedback always on"]
    icmj.build_report([], tmp_path / "report.html", sweeps=[swept])
    page = (tmp_path / "report.html").read_text()
    assert "Size of the sway in the second half" in page
    assert "fell" in page


def test_what_only_intermittent_control_has_is_refused(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(SWEEP.replace('motion = ["linear"]', "attractors = 5"))
    with pytest.raises(RunFileError, match="cycle and attractors are for intermittent control"):
        load_sweep(path)


@pytest.mark.parametrize(("name", "said"), [
    ("one-link-delayed-pd", "-1.28323 ± 5.20022j, -2.05914"),  # printed gains of Asai (2009)
    ("one-link-switching", "1.36778, -1.43444"),  # the saddle without feedback
    ("one-link-switching", "0.73140938: stands"),
])  # fmt: skip
def test_analyse_tells_the_roots_of_each_mode(name, said, shell):
    assert said in " ".join(shell.says(["analyse", name]).split())
