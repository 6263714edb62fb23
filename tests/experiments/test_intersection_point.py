"""The intersection point of ground reaction forces, against mechanics, published numbers and contact forces."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

import icmj
from icmj import Noise, Series
from icmj.engine.reaction import ground_force, reaction
from icmj.errors import AnalysisError, DataError, ModelError
from icmj.simulation.disturbance import list_terms
from icmj.study.kinds.intersection_point import _density

G = 9.81
# the double pendulum of the published code (field.md): masses, centres, inertias, length of the lower link, height of
# the whole centre of mass as it states it
M, C, J, L, H = (23.149, 37.735), (0.56538, 0.31893), (1.13577, 1.80631), 0.83228, 0.9408
FREQUENCY = np.array([5, 10, 20, 30, 40, 50, 60]) * 100 / 1024
MODEL = (2.188, 1.246, 0.821, 0.596, 0.446, 0.350, 0.288)


def mjcf(*links: tuple[float, float, float], length: float = 1.0) -> str:
    """Links (mass, centre, inertia about it) above an ankle at the ground, each with its motor."""
    text, end, motors = "", "", ""
    for i, (m, c, inertia) in enumerate(links):
        text += f'<body pos="0 0 {length if i else 0}"><joint name="q{i}" axis="0 1 0"/>'
        text += f'<inertial pos="0 0 {c}" mass="{m}" diaginertia="{inertia} {inertia} 0.1"/>'
        end += "</body>"
        motors += f'<motor name="t{i}" joint="q{i}"/>'
    return (
        f'<mujoco><compiler angle="radian"/><option gravity="0 0 -{G}" integrator="RK4" timestep="0.002"/>'
        f"<worldbody>{text}{end}</worldbody><actuator>{motors}</actuator></mujoco>"
    )


def loaded(tmp_path, *links, length=1.0):
    (tmp_path / "person.xml").write_text(mjcf(*links, length=length))
    return icmj.load_plant(tmp_path / "person.xml")


def rigid(frequency, m=60.0, c=0.9, inertia=9.0):
    """Newton and Euler: z = g/ω² + I/(m c), I about the ankle, over c."""
    return G / (c * (2 * np.pi * frequency) ** 2) + (inertia + m * c**2) / (m * c**2)


def test_the_double_pendulum_has_the_published_points(tmp_path):
    plant = loaded(tmp_path, *zip(M, C, J, strict=True), length=L)
    A, B = plant.linearisation.plant.A, plant.linearisation.plant.B
    R = 1e6 * np.diag([0.24, 1 / 0.24])
    k = np.linalg.solve(R, B.T @ solve_continuous_are(A, B, np.eye(4), R))
    ground = reaction(plant)

    def ratio(frequency):
        s = 2j * np.pi * frequency[:, None, None]
        x = np.linalg.solve(s * np.eye(4) - A + B @ k, B + 0 * s)
        response = ground.C @ x + ground.D @ (np.eye(2) - k @ x)
        return icmj.experiments.intersection_curve(frequency, response, [0.5**2, 1.0], height=H).ratio

    assert np.abs(ratio(FREQUENCY) - MODEL).max() <= 5.1e-4  # half of the last digit, and that of the inputs
    # over 0.49-7.9 Hz from the mean of 65 young people (Santos & Duarte 2016), an RMSE as published
    lines = (Path(__file__).parents[2] / "examples/young_people.csv").read_text(encoding="utf-8").splitlines()
    young = np.array([line.split(";")[1:3] for line in lines if line.startswith("intersection point")], dtype=float)
    error = ratio(young[:, 0]) - young[:, 1]
    assert np.sqrt(np.mean(error**2)) == pytest.approx(0.1222, abs=6e-5)


@pytest.mark.parametrize("gains", [(1.0, 0.1), (100.0, 1e-3)])
def test_a_rigid_person_s_point_is_mechanics_whatever_the_controller(tmp_path, gains):
    plant = loaded(tmp_path, (60.0, 0.9, 9.0))
    design = icmj.design_lq(plant.linearisation.plant, R_c=1e-6 * gains[0], R_o=1e-6 * gains[1])
    controller = icmj.Controller(design, icmj.system_matched(design), icmj.Continuous())
    f = np.array([0.3, 1.0, 3.0, 8.0])
    response = icmj.experiments.frequency_response(plant.linearisation.plant, controller, f)
    ground = reaction(plant)
    effect = ground.C @ response.x[:, :, :1] + ground.D @ response.applied[:, :, :1]
    theory = icmj.experiments.intersection_curve(f, effect, [1.0], height=0.9)
    np.testing.assert_allclose(theory.ratio, rigid(f), rtol=1e-7)  # of the differences by which the reaction is known
    np.testing.assert_allclose(theory.share, 1.0, atol=1e-12)
    noise = icmj.Gaussian(input="t0", size=1.0, seed=3)
    settings = icmj.Settings(duration=120.0, disturbance=(noise,), record_interval=0.01)
    run = icmj.simulate_plant(plant.linearisation.plant, controller, settings)
    force = icmj.experiments.force_angle(ground_force(plant, run), "force.x", "force.z")
    found = icmj.experiments.intersection_point(force, "force_angle", "cop.x", height=0.9)
    expected = rigid(found.frequency)
    assert np.abs(found.ratio / expected - 1)[found.frequency >= 1].max() < 0.01
    # what a window leaks of the large slow sway, below; the ratio of the two signals falls steeply there
    assert np.abs(found.ratio / expected - 1).max() < 0.2


def deepest(model, qpos):
    """How deep the deepest contact is in each of some poses [m]."""
    data, found = mujoco.MjData(model), []
    for data.qpos[:] in qpos[:, : model.nq]:
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        found.append(max(-contact.dist for contact in data.contact))
    return np.array(found)


def test_contacts_with_a_floor_say_the_same_as_newton(tmp_path):
    run = icmj.load_run("three-link-0.9").with_(
        **{"assumed.model": str(icmj.load_run("three-link-0.9").assumed_path.with_name("three_link_floor.xml"))}
    )
    case = icmj.prepare(run.with_(**{"simulation.duration": 1.0}))
    found = icmj.simulate(case, "mujoco")
    assert found.pressure is not None
    force = ground_force(case.model, found)
    # a soft contact is halfway between floor and sole, so that friction turns the force about a point beneath the floor
    away = np.abs(force["cop.x"] - found.pressure.centre[:, 0])
    lever = 0.5 * deepest(case.model.model, found.qpos) * np.abs(force["force.x"] / force["force.z"])
    assert (away <= lever + 1e-9).all()
    np.testing.assert_allclose(force["force.z"], found.pressure.load.sum(axis=1), rtol=1e-6)


def test_a_line_in_the_plane_of_force_and_pressure_is_found():
    t = np.arange(6000) / 100
    random = np.random.default_rng(1)
    theta = np.convolve(random.standard_normal(6000), np.ones(5) / 5, "same")
    series = Series(t, np.column_stack([np.degrees(theta), 100 * 0.7 * theta]), ("a", "p"), ("deg", "cm"))
    found = icmj.experiments.intersection_point(series, "a", "p", height=0.9, band=(0.4, 40.0))
    np.testing.assert_allclose(found.z, 0.7, rtol=1e-12)
    np.testing.assert_allclose(found.share, 1.0, atol=1e-12)
    assert found.windows == 23  # of 512 rows from the first to the last, half of them or more shared with the next
    assert found.frequency[1] - found.frequency[0] == pytest.approx(100 / 1024)
    assert found.crossing() != found.crossing()  # nowhere


def test_what_cannot_be_told_is_refused_in_one_line(tmp_path):
    t, two = np.arange(600) / 100, np.random.default_rng(0).standard_normal((600, 2))
    good = Series(t, two, ("force_angle", "cop"), ("rad", "m"))
    for wrong, words in (
        (Series(t, two, ("force_angle", "cop")), "has no unit"),
        (Series(t, two, ("force_angle", "cop"), ("rad", "kg")), "is in 'kg'"),
        (Series(t[:400], two[:400], ("force_angle", "cop"), ("rad", "m")), "at least one window"),
        (Series(t, 0 * two, ("force_angle", "cop"), ("rad", "m")), "does not move"),
    ):
        with pytest.raises(DataError, match=words):
            icmj.experiments.intersection_point(wrong)
    with pytest.raises(DataError, match="widen the band"):
        icmj.experiments.intersection_point(good, band=(70.0, 80.0))
    with pytest.raises(DataError, match="height of the centre of mass is not known"):
        _ = icmj.experiments.intersection_point(good).ratio
    with pytest.raises(DataError, match="upward force"):
        icmj.experiments.force_angle(Series(t, -abs(two), ("x", "z"), ("N", "N")), "x", "z")
    with pytest.raises(AnalysisError, match="do not fit"):
        icmj.experiments.intersection_curve([1.0], np.zeros((1, 3, 1)), [1.0])
    with pytest.raises(ModelError, match="x or y"):
        reaction(loaded(tmp_path, (60.0, 0.9, 9.0)), "z")


@pytest.mark.parametrize("edge", [{"corner": 0.2}, {"corner": 1.0}, {"bandwidth": 3.0}])
def test_theory_gives_a_noise_the_power_of_its_sinusoids_and_none_beyond_the_last(edge):
    """Power below each of many frequencies, against that of the terms that are drawn, one in each stratum."""
    count = 2000
    noise = Noise(input="u", size=0.7, seed=3, terms=count, **edge)
    a, omega = np.array([term[:2] for term in list_terms(noise)]).T
    f = np.linspace(0, 30, 300_001)
    density = _density(noise, f) ** 2
    below = np.append(0, np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(f)))
    at = np.geomspace(0.05, 30, 40)
    drawn = [(a[omega <= 2 * np.pi * each] ** 2).sum() / 2 for each in at]
    np.testing.assert_allclose(np.interp(at, f, below), drawn, rtol=0, atol=2 * noise.size**2 / count)
