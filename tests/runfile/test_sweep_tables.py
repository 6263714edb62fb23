"""A bad sweep file is one line that names what is wrong, before anything runs."""

from pathlib import Path

import pytest
from sweep_cases import GRID, PENDULUM, sweep_file
from terminal_cases import told

from icmj.cli.main import main
from icmj.errors import IcmjError
from icmj.study.chunk import meanings
from icmj.study.sweep import make_plan

B = '[[vary]]\nfield = "actual.gain"\n'
WRONG = {
    f"{B}values = [0.8]\ncount = 3": "values have no count",
    f"{B}low = 1": "low must be given and be less than high",
    f"{B}low = 2\nhigh = 1\ncount = 3": "low must be given and be less than high",
    f"{B}low = 0\nhigh = 1\ncount = 3\nspacing = 'log'": "a log spacing needs a low greater than 0",
    f"{B}low = 0.5\nhigh = 1": "gain is drawn between low and high: sweep.samples says how often",
    f"{B}": "give either values, or low and high",
    f"{B}values = []": "at least 1",
    f"{B}values = [0.8]\n{B}values = [0.9]": "two things that vary are called 'gain'",
    **{
        f"{B}name = '{name}'\nvalues = [0.8]": f"called '{name}', which the table calls what comes out"
        for name in ("point", "status", "Words", "predicted_delta_crit", "mujoco_error", "attractors", "attractor_p")
    },
    f"{B}values = [0.8]\n[set]\nsimulation.duration = -1": "set: .*simulation.duration: must be greater than 0",
    "[[vary]]\nvalues = [1]": "give one of field and change",
    "[[vary]]\nfield = 'case.name'\nvalues = ['x']": "'case.name' is no field that varies",
    "[[vary]]\nfield = 'actual.gian'\nvalues = [1]": "actual.gian: no such key; did you mean gain?",
    "[[vary]]\nfield = 'controller.q_t'\nvalues = [0.01, -1]": "with q_t = -1, .*must be greater than 0",
    "[[vary]]\nfield = 'simulation.disturbance[0].size'\nvalues = [1]": "has no entry",
    "[[vary]]\nfield = 'actual.gain'\nvalues = ['much']": "with gain = 'much', ",
    "[[vary]]\nchange = {what = 'mass', of = 'nobody'}\nvalues = [1.1]": "nobody",
    "[[vary]]\nchange = {what = 'charm'}\nvalues = [1.1]": "vary\\[0\\].change.what",
    "[[vary]]\nfield = 'assumed.model'\nvalues = ['nothing.xml']": "nothing.xml",
}


@pytest.mark.parametrize("vary", WRONG)
def test_what_is_wrong_is_named(tmp_path: Path, vary: str) -> None:
    with pytest.raises(IcmjError, match=WRONG[vary]) as raised:
        make_plan(sweep_file(tmp_path, vary))
    assert "\n" not in str(raised.value)
    assert str(tmp_path / "sweep.toml") in str(raised.value)


def test_on_the_command_line_it_is_one_line_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = sweep_file(tmp_path, GRID.format(count=1))
    assert main(["sweep", str(file), "--out", str(tmp_path / "out")]) == 2
    assert len(told(capsys.readouterr().err)) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.toml"]
    good = sweep_file(tmp_path, GRID.format(count=3))
    assert main(["sweep", str(good), "--jobs", "0"]) == 2
    assert main(["sweep", str(good), "--jobs", "1", "--dask", "tcp://127.0.0.1:1"]) == 2
    assert main(["sweep", str(good), "--dry-run", "--out", str(tmp_path / "out")]) == 0
    assert "3 points in 1 chunks of 7" in capsys.readouterr().out
    assert not (tmp_path / "out").exists()


def test_the_run_file_is_found_beside_the_sweep_file(tmp_path: Path) -> None:
    (tmp_path / "sweep.toml").write_text(f'[sweep]\nname = "x"\nrun = "none.toml"\n{GRID.format(count=2)}')
    with pytest.raises(IcmjError, match=r"none\.toml: cannot be read"):
        make_plan(tmp_path / "sweep.toml")
    assert make_plan(sweep_file(tmp_path, GRID.format(count=2))).file.base.path == PENDULUM


def test_every_column_of_what_comes_out_is_refused_as_a_name_of_what_varies(tmp_path: Path) -> None:
    ask = 'motion = ["linear", "mujoco"]\ncycle = ["linear", "mujoco"]\nattractors = 3'
    noise = "[[set.simulation.disturbance]]\nkind = 'noise'\ninput = 'torque'\nsize = 1e-3\nbandwidth = 3\nseed = 1"
    plan = make_plan(sweep_file(tmp_path, GRID.format(count=3), ask=f"{ask}\n{noise}"))
    computed = [name for name in meanings(plan) if name not in plan.points.names]
    assert len(computed) > 60
    for name in computed:
        with pytest.raises(IcmjError, match=f"called '{name}'"):
            make_plan(sweep_file(tmp_path, f"{B}name = '{name}'\nvalues = [0.8]"))
