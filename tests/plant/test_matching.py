"""Inputs and outputs are matched by name in everything that takes two plants, and the closed loop is the same."""

from dataclasses import replace

import numpy as np
import pytest
from model_cases import two

from icmj import Controller, Impulse, Settings, error_system, load_plant, predict, simulate_plant
from icmj.controller.design import design_lq, output_weight
from icmj.controller.hold import system_matched
from icmj.controller.rules.quadratic import EventTrigger
from icmj.errors import AnalysisError
from icmj.experiments.coexisting_motions import attractors
from icmj.plant.linear_plant import LinearPlant, deviate, match_ports, pick

RNG = np.random.default_rng(3)
NAMED = LinearPlant(
    RNG.normal(size=(4, 4)), RNG.normal(size=(4, 3)), RNG.normal(size=(2, 4)), (), ("a", "b", "c"), ("left", "right"),
    (), ("N", "N m", ""), ("m", "rad"),
)  # fmt: skip
TURNED = pick(NAMED, np.array([2, 0, 1]), np.array([1, 0]))


def test_an_order_is_a_permutation_of_columns_rows_names_and_units():
    assert TURNED.inputs == ("c", "a", "b")
    assert TURNED.input_units == ("", "N", "N m")
    assert TURNED.output_units == ("rad", "m")
    np.testing.assert_array_equal(TURNED.B[:, 0], NAMED.B[:, 2])
    back = match_ports(TURNED, NAMED)
    for letter in "ABC":
        np.testing.assert_array_equal(getattr(back, letter), getattr(NAMED, letter))
    assert (back.inputs, back.outputs, back.output_units) == (NAMED.inputs, NAMED.outputs, NAMED.output_units)


def test_the_error_system_does_not_depend_on_the_order():
    design = design_lq(NAMED)
    np.testing.assert_array_equal(error_system(TURNED, design).A_C, error_system(NAMED, design).A_C)
    crossed = error_system(TURNED, design, match="position").A_C
    assert np.abs(crossed - error_system(NAMED, design).A_C).max() > 0.1
    assert error_system(TURNED, design).actual.inputs == NAMED.inputs


@pytest.mark.parametrize("names", [("u0", "u1", "u2"), ("u[0]", "u[1]", "u[2]"), ()])
def test_who_has_no_names_is_matched_by_position(names):
    unnamed = replace(NAMED, inputs=names, outputs=())
    assert match_ports(unnamed, NAMED) is unnamed
    assert match_ports(NAMED, unnamed) is NAMED


@pytest.mark.parametrize("names", [("y1", "y2"), ("y0", "y1"), ("y[0]", "y[1]")])
def test_the_same_names_are_matched_by_name_whatever_they_are(names):
    """Names that look like generated ones, or are: who names them in another order means another order."""
    here = replace(NAMED, inputs=("u1", "u2", "u3"), outputs=names)
    there = pick(here, np.array([2, 0, 1]), np.array([1, 0]))
    for match in (match_ports(there, here), deviate(here, there, 1.0)):
        for letter in "ABC":
            np.testing.assert_array_equal(getattr(match, letter), getattr(here, letter))
    design = design_lq(here)
    np.testing.assert_array_equal(error_system(there, design).A_C, error_system(here, design).A_C)


@pytest.mark.parametrize("names", [("y1", "y2"), ("y1", "y0"), ("y[1]", "y[0]")])
def test_only_names_that_nobody_gave_count_as_none(names):
    with pytest.raises(AnalysisError, match="name them alike"):
        match_ports(replace(NAMED, outputs=names), NAMED)


def test_other_names_stop_with_one_line_that_says_how_to_go_on():
    other = replace(NAMED, inputs=("a", "b", "d"))
    design = design_lq(NAMED)
    says = 'inputs a, b, d, the assumed one a, b, c; name them alike, or match them by position: match="position"'
    with pytest.raises(AnalysisError) as caught:
        error_system(other, design)
    assert says in str(caught.value)
    np.testing.assert_array_equal(error_system(other, design, match="position").A_C, error_system(NAMED, design).A_C)
    with pytest.raises(AnalysisError, match="must agree"):
        match_ports(LinearPlant([[0]], [[1]], [[1]]), NAMED)


def test_what_is_no_linear_plant_is_refused_with_what_to_give(controller, tmp_path):
    on_engine = load_plant(two(tmp_path))
    for give in (lambda plant: error_system(plant, controller.design), design_lq):
        with pytest.raises(AnalysisError, match=r"a MujocoPlant; expected a LinearPlant; give its linearisation.plant"):
            give(on_engine)
    with pytest.raises(AnalysisError, match="the plant to simulate is a str; expected a LinearPlant"):
        simulate_plant("two.xml", controller, SETTINGS)
    with pytest.raises(AnalysisError, match="the rule is a float; expected an event rule"):
        predict(error_system(controller.design.plant, controller.design), 0.01)


def test_the_family_in_rho_matches_by_name():
    np.testing.assert_allclose(deviate(NAMED, TURNED, 0.3).B, NAMED.B)


SETTINGS = Settings(duration=3.0, disturbance=(Impulse("turn", 0.4, 0.5, 0.05),))


@pytest.fixture(scope="module")
def controller(tmp_path_factory):
    plant = load_plant(two(tmp_path_factory.mktemp("two"))).linearisation.plant
    design = design_lq(plant, R_c=0.1, R_o=0.01)
    return Controller(design, system_matched(design), EventTrigger(output_weight(design), 0.01))


@pytest.mark.parametrize("kind", ["linear", "mujoco"])
def test_a_run_does_not_depend_on_the_order_of_sensors_and_actuators(controller, tmp_path, kind):
    """The same cart and pole, its actuators and sensors written down the other way round."""
    runs = []
    for order in (1, -1):
        plant = load_plant(two(tmp_path, order, f"{order}.xml"))
        used = plant.linearisation.plant if kind == "linear" else plant
        runs.append(simulate_plant(used, controller, SETTINGS, x0=[0.0, 0.02, 0.0, 0.0]))
    here, there = runs
    assert len(here.events) > 2
    np.testing.assert_allclose(there.events.t, here.events.t, rtol=1e-6)
    for key in ("x", "y", "u", "applied"):
        np.testing.assert_allclose(getattr(there, key), getattr(here, key), rtol=1e-5, atol=1e-8)


def test_attractors_do_not_depend_on_the_order(controller, tmp_path):
    plants = [load_plant(two(tmp_path, order, f"{order}.xml")).linearisation.plant for order in (1, -1)]
    settings = Settings(duration=3.0, initial={"tilt": 0.02})
    here, there = (attractors(plant, controller, settings, starts=1) for plant in plants)
    assert [found.measurement.kind for found in here] == [found.measurement.kind for found in there]
    np.testing.assert_allclose(here[0].measurement.amplitude, there[0].measurement.amplitude, rtol=1e-6)


def test_ports_of_the_engine_go_with_their_names(controller, tmp_path):
    plant = load_plant(two(tmp_path, -1))
    turned = plant.matched(controller.design.plant)
    assert plant.linearisation.plant.inputs == ("turn", "push")
    assert turned.linearisation.plant.inputs == ("push", "turn")
    np.testing.assert_array_equal(turned.linearisation.ports.actuators, [1, 0])
    np.testing.assert_array_equal(turned.linearisation.y, plant.linearisation.y[::-1])
    assert turned.matched(controller.design.plant) is turned
