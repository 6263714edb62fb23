"""A person by height and mass: Winter's table, the shipped model, and how poles scale with size."""

import numpy as np
import pytest

from icmj import load_plant, parse_run
from icmj.engine.linearisation import linearise
from icmj.engine.model import load_spec
from icmj.errors import ModelError
from icmj.plant.person import Person, Segment

RUN = """
case = { name = "person", title = "A person" }
[assumed]
model = "models/three_link.xml"
keyframe = "upright"
person = { height = 1.65, mass = 60 }
[design]
R_c = 5e-7
R_o = 2e-7
[controller]
q_t = 0.01
"""


def test_segments_are_winter_s_of_a_man_of_80_kg_and_180_cm():
    man = Person()
    table = {"shank": (7.44, 0.4428, 0.25107, 0.13305), "thigh": (16.0, 0.4410, 0.25005, 0.32464),
             "trunk": (54.24, 0.5184, 0.32452, 3.58602), "foot": (2.32, 0.2736, 0.1368, 0.03918)}  # fmt: skip
    for name, printed in table.items():
        found = man.mass_of(name), man.length_of(name), man.com_of(name), man.inertia_of(name)
        assert found == pytest.approx(printed, rel=1e-4)
    assert sum(man.mass_of(name) for name in table) == pytest.approx(80, rel=1e-12)
    np.testing.assert_allclose(man.toppling_stiffness(), [770.0, 446.6, 172.7], rtol=1e-3)


def test_the_shipped_model_is_that_man_to_the_digits_it_is_printed_with(root):
    path = root / "models" / "three_link.xml"
    printed = load_plant(path, keyframe="upright").linearisation.plant
    made = load_plant(path, keyframe="upright", person=Person()).linearisation.plant
    for letter in "ABC":
        mine, theirs = getattr(made, letter), getattr(printed, letter)
        assert np.abs(mine - theirs).max() < 1e-5 * np.abs(theirs).max()


def test_poles_scale_with_the_root_of_height_and_not_with_mass(root):
    """All torques at rest go with m g h and all inertias with m h²: time goes with √h, but for damping, left out."""

    def poles(height, mass):
        person = Person(height, mass, damping=0.0)
        plant = load_plant(root / "models" / "three_link.xml", keyframe="upright", person=person)
        return np.sort_complex(np.linalg.eigvals(plant.linearisation.plant.A))

    np.testing.assert_allclose(poles(1.8, 80), poles(1.8, 50), rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(poles(1.8, 80), poles(1.5, 50) * np.sqrt(1.5 / 1.8), rtol=1e-7, atol=1e-7)


def test_the_floor_and_the_shapes_follow_the_height(root):
    path = root / "models" / "three_link.xml"
    tall, given = (load_spec(path, person=Person(height)).compile() for height in (2.0, 1.8))
    np.testing.assert_allclose(tall.geom("floor").pos[2], -0.078)
    for name in ("head", "shin_left", "pelvis"):
        np.testing.assert_allclose(tall.geom(name).size, given.geom(name).size * 2.0 / 1.8, rtol=1e-9)
    assert tall.body("trunk").ipos[2] == pytest.approx(0.626 * 0.288 * 2.0)


def test_a_run_file_names_the_person_of_both_plants(root):
    from icmj.case.case import prepare

    def masses(more):
        case = prepare(parse_run(RUN + more, root / "run.toml"))
        return [float(plant.spec.compile().body_mass.sum()) for plant in (case.assumed, case.actual)]

    share = 1 - 2 * 0.0145
    assert masses("[actual]\ngain = 0.9") == pytest.approx([60 * share] * 2)
    assert masses("[actual.person]\nheight = 1.65\nmass = 66") == pytest.approx([60 * share, 66 * share])
    heavy = "[actual.person]\nheight = 1.65\nmass = 60\n[actual.person.segments.trunk]\nmass = 0.778"
    assert masses(heavy) == pytest.approx([60 * share, 60 * (share + 0.1)])
    run = parse_run(RUN + heavy, root / "run.toml").with_(**{"actual.gain": 0.9})
    assert parse_run(run.text, run.path).model_dump() == run.model_dump()


def test_a_written_model_is_the_same_plant(root, tmp_path, shell):

    source, out = root / "models" / "three_link.xml", tmp_path / "small.xml"
    assert "N m/rad" in shell.says(["person", str(source), "--height", "1.65", "--mass", "60", "--out", str(out)])
    written = load_plant(out, keyframe="upright").linearisation.plant
    made = linearise(load_spec(source, person=Person(1.65, 60)).compile(), "upright").plant
    np.testing.assert_allclose(written.A, made.A, rtol=1e-5, atol=1e-4)


def test_what_is_no_person_is_refused(root):
    with pytest.raises(ModelError, match="height must be positive"):
        Person(height=-1)
    with pytest.raises(ModelError, match="gyration must be positive"):
        Segment(0.1, 0.2, 0.5, 0.0)
    with pytest.raises(ModelError, match="no segment 'arm'"):
        Person().with_segment("arm", mass=0.1)
    with pytest.raises(ModelError, match=r"pendulum.xml: .* no body 'shank'"):
        load_spec(root / "models" / "pendulum.xml", person=Person())
