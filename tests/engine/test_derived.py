"""A change of a model changes what it names: everything that the compiler derives of other numbers is as before it."""

import mujoco
import numpy as np
import pytest
from model_cases import pendulum, written
from mujoco.introspect.structs import STRUCTS

from icmj import Deviation, load_plant
from icmj.engine.model import load_model
from icmj.engine.model_edits import ANCHOR
from icmj.plant.body import Change
from icmj.plant.person import Person

# a body of segments with whatever the compiler derives: springs and dampers of joints, rest and range of a rope, peak
# forces, damping ratios, inherited ranges, a weld and connections
DERIVED = """<mujoco>
  <compiler angle="radian" boundmass="0.3" boundinertia="0.01" balanceinertia="true"/>
  <worldbody>
    <body name="shank" pos="0 0 0.2"><joint name="ankle" axis="0 1 0" springdamper="0.1 0.8" range="-1 1"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.4" size="0.05"/><site name="calf" pos="-0.1 0 0.3"/>
      <body name="thigh" pos="0 0 0.4"><joint name="knee" axis="0 1 0" range="-1 1"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.4" size="0.05"/><site name="ham" pos="-0.1 0 0.3"/>
        <body name="trunk" pos="0 0 0.4"><joint name="hip" axis="0 1 0"/>
          <geom type="box" pos="0 0 0.3" size="0.1 0.2 0.3"/>
          <body name="head" pos="0 0 0.7"><joint name="neck" type="ball"/><geom size="0.1"/></body></body></body></body>
    <body name="load" pos="0 1 1"><freejoint align="true"/><geom type="box" pos="0.1 0 0.2" size="0.1 0.2 0.3"/></body>
    <body name="pebble" pos="0 2 1"><joint name="roll"/><geom size="0.01"/></body>
  </worldbody>
  <tendon>
    <spatial name="rope" stiffness="30" range="0.1 0.9"><site site="calf"/><site site="ham"/></spatial>
    <spatial name="band" stiffness="30" springlength="0.2 0.3"><site site="calf"/><site site="ham"/></spatial>
  </tendon>
  <equality>
    <weld name="held" body1="load" body2="trunk"/>
    <connect name="bound" body1="thigh" body2="load" anchor="0.1 0.2 0.3"/>
    <connect name="hung" body1="load" anchor="0.1 0.2 0.3"/><joint name="even" joint1="knee" joint2="hip"/>
  </equality>
  <actuator>
    <position name="servo" joint="knee" kp="30" dampratio="0.7" inheritrange="1"/>
    <intvelocity name="drive" joint="knee" kp="30" dampratio="0.7" inheritrange="0.5"/>
    <pid name="pid" joint="ankle" kp="900" dampratio="0.3" ki="50" inheritrange="0.5"/>
    <orientation name="nod" joint="neck" kp="20" dampratio="1"/>
    <muscle name="hamstrings" tendon="rope"/><muscle name="soleus" joint="ankle" scale="300"/>
    <muscle name="given" joint="knee" force="500" lengthrange="-1 1"/>
    <motor name="hip" joint="hip"/>
  </actuator>
</mujoco>"""

MASS = {"body_mass", "body_inertia"}
PLACES = {"body_pos", "body_ipos", "site_pos", "geom_pos", "geom_size", "jnt_pos", "site_size"}
PASSIVE = {"jnt_stiffness", "dof_damping"}
CHANGES = {
    "mass": (Change("mass", factor=1.5), MASS),
    "little mass": (Change("mass", factor=0.01), MASS),
    "inertia": (Change("inertia", "trunk", 1.3), {"body_inertia"}),
    "centre of mass": (Change("centre_of_mass", "trunk", 0.8), {"body_ipos"}),
    "length": (Change("length", "thigh", 1.2), PLACES | {"body_inertia"}),
    "armature": (Change("armature", factor=2.0), {"dof_armature"}),
    "a new armature": (Change("armature", value=0.1), {"dof_armature"}),
    "stiffness": (Change("stiffness", "ankle", 2.0), {"jnt_stiffness"}),
    "damping": (Change("damping", "ankle", 2.0), {"dof_damping"}),
    "stiffness of a rope": (Change("stiffness", "rope", 2.0), {"tendon_stiffness"}),
    "gain": (Change("gainprm", "servo", 2.0), {"actuator_gainprm"}),
    "gravity": (Change("gravity", factor=0.5), set()),
}
# what is no parameter of a force or motion by itself, what says how things lie in the reference configuration, and how
# soft constraints are, which the engine defines relative to inertia
FOLLOWS = {
    "body_subtreemass", "dof_M0", "dof_length", "body_invweight0", "dof_invweight0", "tendon_invweight0",
    "actuator_acc0",
    "tendon_length0", "actuator_length0", "body_sameframe", "body_simple", "dof_simplenum", "geom_rbound", "geom_aabb",
    "bvh_aabb", "geom_sameframe", "site_sameframe", "eq_data", "eq_objtype", "eq_obj1id", "eq_obj2id", "names_map",
    "body_bvhadr", "body_bvhnum", "bvh_child", "bvh_depth", "bvh_nodeid",
}  # fmt: skip
ARRAYS = [field.name for field in STRUCTS["mjModel"].fields if getattr(field, "array_extent", None)]
ARRAYS = [name for name in ARRAYS if not name.startswith(("name", "paths", "text"))]


def edit(spec, rho):
    """A change in code that names what others name."""
    for body in spec.bodies[1:]:
        body.mass *= 1.5
        body.inertia = np.asarray(body.inertia) * 1.5


KINDS = {
    **{name: ({"deviation": Deviation(changes=(change,))}, named) for name, (change, named) in CHANGES.items()},
    "edit": ({"deviation": Deviation(edit=edit)}, MASS),
    "person": ({"person": Person(1.6, 60)}, MASS | PLACES | PASSIVE | {"body_quat", "body_iquat"}),
    "person and mass": (
        {"person": Person(1.6, 60), "deviation": Deviation(changes=(Change("mass", factor=1.5),))},
        MASS | PLACES | PASSIVE | {"body_quat", "body_iquat"},
    ),
}


def values(model, name):
    """An array of the model: with the peak force of muscles as the engine takes it, without the places of anchors."""
    found = np.array(getattr(model, name))
    if name in ("actuator_gainprm", "actuator_biasprm"):
        for i in np.flatnonzero((model.actuator_gaintype == mujoco.mjtGain.mjGAIN_MUSCLE) & (found[:, 2] < 0)):
            found[i, 2] = found[i, 3] / model.actuator_acc0[model.actuator_outadr[i]]
    if name.startswith("site_"):
        found = found[[not model.site(i).name.startswith(ANCHOR) for i in range(model.nsite)]]
    if name == "wrap_objid":
        found = [model.site(i).name for i in found]
    return found


def differ(old, new):
    if isinstance(old, list):
        return old != new
    return old.shape != new.shape or not np.allclose(new, old, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("kind", KINDS)
def test_a_change_leaves_what_is_derived_as_it_was(tmp_path, kind):
    """Each array of the model but those that the change names, and how the body moves by itself."""
    path = written(tmp_path, DERIVED)
    arguments, named = KINDS[kind]
    before, after = load_model(path)[1], load_model(path, **arguments)[1]
    others = [name for name in ARRAYS if name not in FOLLOWS | named]
    assert [name for name in others if differ(values(before, name), values(after, name))] == []
    assert not any(differ(after.actuator_lengthrange[i], before.actuator_lengthrange[i]) for i in range(before.nout))


@pytest.mark.parametrize("kind", KINDS)
def test_welds_and_connections_hold_where_they_held(tmp_path, kind):
    path = written(tmp_path, DERIVED)
    before, after = load_model(path)[1], load_model(path, **KINDS[kind][0])[1]
    np.testing.assert_allclose(after.eq("held").data[:11], before.eq("held").data[:11], rtol=1e-12, atol=1e-14)
    np.testing.assert_array_equal(after.eq("even").data, before.eq("even").data)
    for name in ("bound", "hung"):
        i = before.eq(name).id
        ends = np.split(before.eq_data[i, :6], 2)
        bodies, sites = ((model.eq_obj1id[i], model.eq_obj2id[i]) for model in (before, after))
        assert after.eq_objtype[i] == mujoco.mjtObj.mjOBJ_SITE
        for site, end, body in zip(sites, ends, bodies, strict=True):
            np.testing.assert_allclose(after.site_pos[site], end, rtol=1e-12, atol=1e-14)
            assert after.site_bodyid[site] == body


@pytest.mark.parametrize("compiler", ["", 'settotalmass="50"', 'inertiafromgeom="true"'])
def test_a_change_by_nothing_is_none(tmp_path, compiler):
    """The body moves as before, also where free bodies are aligned with their inertia."""
    path = written(tmp_path, DERIVED.replace("<compiler", f"<compiler {compiler}"))
    ends = []
    for deviation in (None, Deviation(changes=(Change("mass", factor=1.0),))):
        model = load_model(path, deviation)[1]
        data = mujoco.MjData(model)
        data.qpos[:3], data.ctrl[:] = [0.1, -0.2, 0.3], np.linspace(0.1, 0.9, model.nu)
        data.qvel[:] = np.linspace(-1, 1, model.nv)
        mujoco.mj_forward(model, data)
        ends.append(data.qacc.copy())
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-6, atol=1e-6 * np.abs(ends[0]).max())


J = 70 * 0.9**2 + 6
GIVEN = '<muscle name="ankle" joint="lean" range="0.75 1.05" lengthrange="-1 1" tausmooth="0.2"{}/>'
KEY = 'qpos="0" act="0.3" ctrl="0.3"'


def test_a_heavier_body_has_the_same_muscles(tmp_path):
    """B of a muscle is F r / J: with a peak force of the compiler's, scale · J, as with one in the file."""
    heavier = Deviation(changes=(Change("mass", "rod", 1.1),))
    files = [written(tmp_path, pendulum(GIVEN.format(force), key=KEY), f"{i}.xml")
             for i, force in enumerate(["", f' force="{200 * J}"'])]  # fmt: skip
    plain, heavy, known = (
        load_plant(path, deviation, keyframe="stand").linearisation.plant.A[1, 2]
        for path, deviation in ((files[0], None), (files[0], heavier), (files[1], heavier))
    )
    assert heavy == pytest.approx(plain / 1.1, rel=1e-8)
    assert heavy == pytest.approx(known, rel=1e-9)


def test_a_heavier_body_has_the_same_servo(tmp_path):
    """Damping over inertia falls with inertia, and not with its root."""
    path = written(tmp_path, pendulum('<position name="ankle" joint="lean" kp="900" dampratio="0.7"/>'))
    plain, heavy = (
        load_plant(path, deviation).linearisation.plant.A[1, 1]
        for deviation in (None, Deviation(changes=(Change("mass", "rod", 1.5),)))
    )
    assert plain == pytest.approx(-2 * 0.7 * np.sqrt(900 / J), rel=1e-8)
    assert heavy / plain == pytest.approx(1 / 1.5, rel=1e-8)
