"""Plants by matrices in run files: the same numbers as their models give, and one line for what makes no plant."""

import json
from contextlib import redirect_stdout

import control
import numpy as np
import pytest
from model_cases import two

from icmj import load_plant, load_run, measure, parse_run, prepare, simulate
from icmj.case.matrices import read_matrices
from icmj.cli.main import main
from icmj.errors import IcmjError, RunFileError, SimulationError

TEXT = """
[case]
name = "mine"
title = "Mine"
[assumed]
{assumed}
[actual]
{actual}
[design]
R_c = 1e-1
R_o = 1e-2
[controller]
q_t = 0.01
delta_min = 0.01
[simulation]
duration = 40.0
initial = {{ hinge = 0.02 }}
"""
PENDULUM = 'A = [[0, 1], [1, 0]]\nB = [0, 1]\nC = [1, 0]\nstates = ["hinge", "hinge_rate"]\ninputs = ["torque"]'


def made(assumed: str = PENDULUM, actual: str = "gain = 0.8", folder: str = "."):
    return parse_run(TEXT.format(assumed=assumed, actual=actual), f"{folder}/mine.toml")


@pytest.fixture(scope="module")
def shipped(root):
    """The published case whose plant is 1/(s² − 1)."""
    run = load_run(root / "runs" / "simple-0.8.toml")
    return prepare(run.with_(**{"design.R_c": 1e-1, "design.R_o": 1e-2}))


def test_matrices_predict_what_the_model_of_them_does(shipped):
    case = prepare(made())
    assert case.prediction.delta_crit == pytest.approx(shipped.prediction.delta_crit, rel=1e-7)
    np.testing.assert_allclose(case.prediction.amplitude, shipped.prediction.amplitude, rtol=1e-6)
    np.testing.assert_allclose(case.actual.linearisation.plant.B, [[0], [0.8]])
    run = simulate(case, "linear")
    motion = measure(run, T_hat=case.system.T_hat)
    assert motion.interval == pytest.approx(case.prediction.delta_crit, rel=1e-8)


def test_the_engine_refuses_matrices_and_steps_a_model_that_they_are_assumed_for(shipped, root):
    with pytest.raises(SimulationError, match=r"mine.toml: the actual plant is given by matrices"):
        simulate(prepare(made()), "mujoco")
    model = f'model = "{(root / "models" / "pendulum.xml").as_posix()}"\nkeyframe = "upright"\ngain = 0.8'
    names = '\noutputs = ["angle"]'
    mixed = prepare(made(PENDULUM + names, model))
    assert mixed.prediction.delta_crit == pytest.approx(shipped.prediction.delta_crit, rel=1e-7)
    run, whole = (simulate(case, "mujoco", duration=3.0) for case in (mixed, shipped))
    np.testing.assert_allclose(run.y[-1], whole.y[-1], atol=1e-7)
    other = prepare(made(f"{model.rpartition(chr(10))[0]}", "A = [[0, 1], [1, 0]]\nB = [0, 0.8]\nC = [1, 0]"))
    assert other.actual.linearisation.plant.states == ("hinge", "hinge_rate")
    assert other.prediction.delta_crit == pytest.approx(shipped.prediction.delta_crit, rel=1e-7)


def test_actual_matrices_take_the_assumed_order_of_ports_and_rho_leads_to_them():
    """The family in ρ, and a plant whose sensors stand in another order, against a hand-made one."""
    assumed = "A = [[0, 1], [1, 0]]\nB = [0, 1]\nC = [[1, 0], [0, 1]]\noutputs = ['y', 'rate']"
    swapped = "A = [[0, 1], [2, 0]]\nB = [0, 3]\nC = [[0, 1], [1, 0]]\noutputs = ['rate', 'y']\nrho = 0.5\ngain = 0.8"
    run = made(assumed, swapped).with_(**{"simulation.initial": {"x0": 0.01}})
    plant = prepare(run).actual.linearisation.plant
    np.testing.assert_allclose(plant.A, [[0, 1], [1.5, 0]])
    np.testing.assert_allclose(plant.B, [[0], [2 * 0.9]])
    np.testing.assert_allclose(plant.C, np.eye(2))
    assert plant.outputs == ("y", "rate")


def test_files_of_matrices(tmp_path, capsys, root):
    """What ``icmj linearise --json`` prints, and what numpy saves, are plants, with names and units."""
    assert main(["linearise", str(root / "models" / "three_link.xml"), "--keyframe", "upright", "--json"]) == 0
    (tmp_path / "body.json").write_text(capsys.readouterr().out, encoding="utf-8")
    found = read_matrices(tmp_path / "body.json")
    np.savez(tmp_path / "body.npz", **{name: found[name] for name in ("A", "B", "C", "states", "inputs", "outputs")})
    shipped = load_run(root / "runs" / "three-link-0.9.toml")
    expected = prepare(shipped)
    keys = {"simulation.initial": {"ankle": 0.02}, "design": shipped.design.model_dump(exclude_defaults=True)}
    for name, unit in (("body.json", "rad"), ("body.npz", "")):
        case = prepare(made(f'matrices = "{name}"', "gain = 0.9", str(tmp_path)).with_(**keys))
        assert case.prediction.delta_crit == pytest.approx(expected.prediction.delta_crit, rel=1e-9)
        assert case.assumed.linearisation.plant.states == expected.assumed.linearisation.plant.states
        assert case.assumed.linearisation.plant.output_units == (unit,) * 3


@pytest.mark.parametrize(("assumed", "actual", "words"), [
    ("", "", "assumed: no plant; name its model, or give matrices A, B and C"),
    ("A = [[0]]", "", "assumed: a plant needs A, B and C; B and C is not there"),
    (f'{PENDULUM}\nmodel = "m.xml"', "", "assumed: a plant given by matrices has no model"),
    (f'{PENDULUM}\nkeyframe = "k"', "", "assumed: a plant given by matrices has no keyframe"),
    (f'{PENDULUM}\nmatrices = "m.npz"', "", "assumed: give either matrices or A and B and C"),
    (PENDULUM, "change = [{ what = 'gravity', factor = 2 }]", "actual: a plant given by matrices has no change"),
    (PENDULUM, "gain = [1, 2]", "actual: gain has 2 entries for 1 inputs"),
    (PENDULUM.replace("[1, 0]]", "[1]]"), "", "assumed: A is not a matrix: rows differ in length"),
    (PENDULUM.replace("B = [0, 1]", "B = [0, 1, 2]"), "", "assumed: plant matrices do not fit: A (2, 2), B (3, 1)"),
    (PENDULUM.replace('"hinge_rate"', '"hinge"'), "", "assumed: states: 'hinge' is named twice"),
    (PENDULUM.replace(', "hinge_rate"', ""), "", "assumed: plant has 2 states but 1 names"),
    (f"{PENDULUM}\nunits = {{ angle = 'rad' }}", "", "assumed: units: no 'angle' in the plant"),
    (PENDULUM, "A = [[1]]\nB = [[1, 1]]\nC = [[1]]", "actual: inputs u0, u1; expected those of the assumed plant"),
    (PENDULUM, "A = [[1]]\nB = [[1]]\nC = [[1]]\nrho = 0.5", "actual: the family in ρ needs"),
    ('matrices = "none.npz"', "", "none.npz: cannot be read (No such file"),
    ('matrices = "bad.npz"', "", "bad.npz: holds no matrices that can be read"),
    ('matrices = "bad.json"', "", "bad.json: holds no matrices that can be read"),
    ('matrices = "half.json"', "", "half.json: expected the matrices A, B and C"),
    ('matrices = "words.json"', "", "words.json: A is not a matrix"),
    ('matrices = "mine.mat"', "", "mine.mat: matrices are read from .npz and .json"),
    ('matrices = "through.json"', "", "through.json: the plant has a direct feed-through D"),
    ('model = "m.xml"\nunits = { x = "rad" }', "", "assumed: units are those of a plant given by matrices"),
])  # fmt: skip
def test_what_makes_no_plant_is_one_line(assumed, actual, words, tmp_path):
    (tmp_path / "bad.npz").write_bytes(b"PK\x03\x04 and no more")
    (tmp_path / "bad.json").write_text("[1, 2")
    (tmp_path / "half.json").write_text('{"A": [[1]]}')
    (tmp_path / "words.json").write_text('{"A": [["x"]], "B": [[1]], "C": [[1]]}')
    (tmp_path / "through.json").write_text('{"A": [[1]], "B": [[1]], "C": [[1]], "D": [[1]]}')
    with pytest.raises(RunFileError) as raised:
        prepare(made(assumed, actual, str(tmp_path)))
    assert words in str(raised.value)
    assert str(raised.value).startswith(f"{tmp_path}/")


@pytest.mark.parametrize(("beside", "words"), [
    ({"E": np.diag([1.0, 2.0])}, "descriptor system"),
    ({"dt": 0.1}, "discrete-time system, dt = 0.1"),
    ({"D": [[1.0]]}, "direct feed-through"),
    ({"A": np.array([[0, 1], [1, 1j]])}, "A is complex"),
    ({"E": np.eye(2), "dt": 0, "D": [[0.0]]}, None),
])  # fmt: skip
@pytest.mark.parametrize("kind", ["npz", "json"])
def test_what_stands_beside_the_matrices_is_not_passed_over(tmp_path, kind, beside, words):
    data = {"A": [[0, 1], [1, 0]], "B": [0, 1], "C": [1, 0]} | beside
    if kind == "npz":
        np.savez(tmp_path / "plant.npz", **data)
    elif words != "A is complex":
        plain = {name: np.asarray(value).tolist() for name, value in data.items()}
        (tmp_path / "plant.json").write_text(json.dumps(plain))
    else:
        pytest.skip("JSON knows no complex numbers")
    run = made(f'matrices = "plant.{kind}"', folder=str(tmp_path)).with_(**{"simulation.initial": {"x0": 0.02}})
    if words is None:
        assert prepare(run).actual.linearisation.plant.n == 2
        return
    with pytest.raises(RunFileError, match=words):
        prepare(run)


def test_ports_of_any_names_are_matched_by_name():
    """y1 and y2 named in another order by the actual plant: the same loop as in the same order."""
    body = 'A = [[0, 1], [1, 0]]\nB = [0, 1]\nC = {C}\nstates = ["hinge", "rate"]\noutputs = {y}'
    here, there = ("[[1, 0], [0, 1]]", '["y1", "y2"]'), ("[[0, 1], [1, 0]]", '["y2", "y1"]')
    found = [
        prepare(made(body.format(C=here[0], y=here[1]), body.format(C=C, y=y) + "\ngain = 0.8")).prediction.delta_crit
        for C, y in (here, there)
    ]
    assert found[1] == pytest.approx(found[0], rel=1e-12)


@pytest.mark.parametrize("kind", ["npz", "json"])
def test_what_a_push_does_goes_with_the_matrices_of_a_model(tmp_path, capsys, root, kind):
    """A model of gear 20 taken to where MuJoCo is not: 1 N m is 1 N m there, too."""
    model = two(tmp_path)
    (tmp_path / "plant.json").write_text("")
    with (tmp_path / "plant.json").open("w", encoding="utf-8") as out, redirect_stdout(out):
        assert main(["linearise", str(model), "--json", "--out", str(tmp_path / "plant.npz")]) == 0
    linear = load_plant(model).linearisation.plant
    run = made(f'matrices = "plant.{kind}"', folder=str(tmp_path)).with_(**{"simulation.initial": {"tilt": 0.02}})
    plant = prepare(run).actual.linearisation.plant
    np.testing.assert_allclose(plant.B_d, linear.B_d, rtol=1e-12)
    np.testing.assert_allclose(linear.B_d * [1, 20], linear.B, rtol=1e-6, atol=1e-12)
    with pytest.raises(RunFileError, match="B_d"):
        prepare(made(PENDULUM + "\nB_d = [[0, 1], [1, 0], [2, 2]]"))


def test_a_file_that_would_unpack_to_very_much_is_refused_and_no_pickle_is_opened(tmp_path):
    np.savez_compressed(tmp_path / "bomb.npz", A=np.zeros((2000, 2000)), B=np.eye(1), C=np.eye(1))
    assert (tmp_path / "bomb.npz").stat().st_size < 1e5
    with pytest.raises(RunFileError, match=r"32 MB of arrays; expected at most 10 MB"):
        read_matrices(tmp_path / "bomb.npz")
    (tmp_path / "folder.npz").mkdir()
    with pytest.raises(RunFileError, match="not a file"):
        read_matrices(tmp_path / "folder.npz")
    np.savez(tmp_path / "evil.npz", A=np.array([{"a": 1}], dtype=object), B=np.eye(1), C=np.eye(1))
    with pytest.raises(RunFileError, match="holds no matrices that can be read"):
        read_matrices(tmp_path / "evil.npz")


@pytest.mark.parametrize("kind", ["npz", "json"])
def test_mutants_of_files_are_plants_or_told_in_one_line(tmp_path, kind):
    path, random = tmp_path / f"plant.{kind}", np.random.default_rng(1)
    plant = {"A": np.array([[0.0, 1], [1, 0]]), "B": np.array([[0.0], [1]]), "C": np.array([[1.0, 0]])}
    np.savez(tmp_path / "plant.npz", **plant, states=["a", "b"])
    (tmp_path / "plant.json").write_text(json.dumps({name: M.tolist() for name, M in plant.items()}))
    whole, told = path.read_bytes(), []
    run = made(f'matrices = "{path.name}"', "", str(tmp_path)).with_(**{"simulation.initial": {}})
    for _ in range(150):
        mutant = bytearray(whole)
        for at in random.integers(len(mutant), size=random.integers(1, 4)):
            mutant[at] = random.integers(256)
        path.write_bytes(bytes(mutant))
        try:
            prepare(run)
        except IcmjError as error:
            told.append(str(error))
    assert len(told) > 20
    assert not [words for words in told if "\n" in words]


def test_a_plant_that_no_input_moves_is_told_as_of_a_model():
    stuck = "A = [[1, 0], [0, -1]]\nB = [0, 1]\nC = [1, 1]"
    with pytest.raises(IcmjError, match="no input moves x0"):
        prepare(made(stuck, "").with_(**{"simulation.initial": {}}))


def test_gains_and_hold_of_one_s_own(shipped):
    """Those of the LQ design, given as numbers, make the same case; others make what python-control says."""
    design = shipped.controller.design
    own = made().with_(**{
        "design": {"k": design.k[0].tolist(), "L": design.L[:, 0].tolist()},
        "controller.hold": "own",
        "controller.A_h": design.A_c.tolist(),
    })  # fmt: skip
    assert prepare(own).prediction.delta_crit == pytest.approx(shipped.prediction.delta_crit, rel=1e-9)
    assert own.fingerprint != own.with_(**{"controller.A_h": [[0, 0], [0, 0]]}).fingerprint

    k = control.place([[0, 1], [1, 0]], [[0], [1]], [-1, -2])
    case = prepare(made().with_(design={"k": k.tolist(), "R_o": 1e-2}))
    np.testing.assert_allclose(np.sort(np.linalg.eigvals(case.controller.design.A_c)), [-2, -1], atol=1e-9)
    np.testing.assert_allclose(case.controller.design.L, design.L, rtol=1e-7)


@pytest.mark.parametrize(("keys", "words"), [
    ({"design.k": [1, 2]}, "design: give either k or R_c"),
    ({"design": {"k": [1, 2, 3]}}, "gains do not fit the plant"),
    ({"design": {"L": [[1, 2], [3]]}}, "L is not a matrix"),
    ({"controller.hold": "own"}, 'A_h is the matrix of hold = "own"'),
    ({"controller.A_h": [[0, 0], [0, 0]]}, 'A_h is the matrix of hold = "own"'),
    ({"controller.hold": "own", "controller.A_h": [[0]]}, "A_h does not fit"),
])  # fmt: skip
def test_what_is_no_gain_or_hold_is_one_line(keys, words):
    with pytest.raises(IcmjError, match=words):
        prepare(made().with_(**keys))


@pytest.mark.slow
def test_run_study_report_and_log_without_a_model(tmp_path, monkeypatch, shell):
    from icmj.log.reader import read_log

    monkeypatch.chdir(tmp_path)
    short = {"study.growth_points": 2, "study.attractor_starts": 2}
    run = made().with_(**short)
    (tmp_path / "mine.toml").write_text(run.text, encoding="utf-8")
    assert shell.answers(["analyse", "mine.toml", "--json"])["cycle"] is True
    assert "--plant linear" in shell.refuses(["run", "mine.toml", "--plant", "mujoco"])
    assert not (tmp_path / "runs").exists()
    assert "1 log, " in shell.says(["study", "mine.toml", "--jobs", "1"])
    out = tmp_path / "runs" / "out"
    assert {path.name for path in out.glob("*.rrd")} == {"mine.linear.rrd"}
    assert "Mine" in (out / "report.html").read_text(encoding="utf-8")
    result = read_log(out / "mine.linear.rrd")
    assert result.run.text == run.text
    assert result.scene is None
    np.testing.assert_array_equal(result.actual.B, [[0], [0.8]])
    assert result.measurement.interval == pytest.approx(result.prediction.delta_crit, rel=1e-4)
