"""Controllers of users with memory, mixtures and sums go every way that a case can go."""

import numpy as np
import pytest
from hybrid_cases import FOLDER, NAMES

import icmj
from icmj.cli.main import main


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_run_file_is_run_logged_read_and_reported(name, tmp_path, shell) -> None:
    for plant in ("linear", "mujoco"):
        line = ["run", str(FOLDER / f"{name}.toml"), "--plant", plant, "--allow-code", "--out", str(tmp_path)]
        line += ["--set", "simulation.duration=5"]
        assert "fell" not in shell.says(line)
        result = icmj.read_log(tmp_path / f"{name}.{plant}.rrd")
        run = icmj.load_run(FOLDER / f"{name}.toml", allow_code=True)
        case = icmj.prepare(run.with_(**{"simulation.duration": 5.0}))
        again = icmj.simulate(case, plant)
        assert np.array_equal(result.simulation.x, again.x)
        assert np.array_equal(result.simulation.events.t, again.events.t)
        real, kept = case.controller.realisation, result.controller.realisation
        assert real.watched == kept.watched
        assert real.after == kept.after
        assert (real.wait, real.clock, real.sampling, real.taps) == (kept.wait, kept.clock, kept.sampling, kept.taps)
        assert np.array_equal(result.to_series(100.0)["y.lean"], again.to_series(100.0)["y.lean"]) or name == "reflex"
    logs = sorted(map(str, tmp_path.glob("*.rrd")))
    assert main(["report", *logs, "--out", str(tmp_path / "report.html")]) == 0
    assert case.run.case.title in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_an_experiment_identifies_plain_feedback(tmp_path, shell) -> None:
    """Of 900 N m/rad and 300 N m s/rad a tenth is lost; nothing is delayed, and 0.7 of the surface's tilt is felt."""
    shipped = (FOLDER.parents[1] / "experiments" / "perturbed-stance.toml").read_text(encoding="utf-8")
    head = shipped.split("[[case]]")[0].replace("periods = 4", "periods = 2")
    case = f'[[case]]\nrun = "{FOLDER / "plain-pd.toml"}"\nname = "plain"\ntitle = "Plain PD"\n'
    case += "set.simulation.initial = {}\nset.simulation.disturbance = []\n"
    file = tmp_path / "experiment.toml"
    file.write_text(head + case, encoding="utf-8")
    printed = shell.says(["experiment", str(file), "--allow-code", "--out", str(tmp_path / "out")])
    for value in ("810", "270", "0.7"):
        assert value in printed


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "events", "interval"),
    # an event rule that remembers fires where it fires without memory: its cycle is that of the event rule
    [("hysteresis", 1, None), ("saturating", 1, None), ("reflex", 2, 1.29248), ("alert", 1, 0.324621)],
)
def test_their_cycles_are_found_by_simulation(name, events, interval, shell) -> None:
    """What a run settles on is told from its events, whatever the controller is."""
    line = ["cycle", str(FOLDER / f"{name}.toml"), "--allow-code", "--plant", "linear", "--json"]
    found = shell.answers([*line, "--set", "simulation.disturbance=[]", "--set", "simulation.duration=240"])
    assert (found["verdict"], found["p"], found["mirrored"]) == ("cycle", events, name == "reflex")
    if interval is None:
        run = icmj.load_run(FOLDER.parents[1] / "runs" / "rivals" / "one-link-event.toml")
        interval = icmj.prepare(run.with_(**{"controller.delta_min": 0.0})).prediction.delta_crit
    assert found["interval"] == pytest.approx(interval, rel=1e-5)
