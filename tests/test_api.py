"""The public surface: few names at the top and the others in rooms; each loads, has one home, and costs nothing."""

import importlib
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import icmj

# sub-packages whose names are public, and two modules that are rooms by themselves
ROOMS = (
    *("case", "controller", "cycle", "engine", "experiments", "fits", "identification", "log", "measurement"),
    *("plant", "series", "simulation", "study", "theory"),
)
MODULES = ("errors", "plots")
TOP = tuple(name for name in icmj.__all__ if name not in (*ROOMS, *MODULES))
NAMES = {room: tuple(importlib.import_module(f"icmj.{room}").__all__) for room in ROOMS}
EVERYWHERE = [("icmj", name) for name in TOP] + [(f"icmj.{room}", name) for room in ROOMS for name in NAMES[room]]


def run(script: str) -> str:
    """What a program prints, in a process of its own."""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_what_people_meet_first_is_at_most_eighty_names():
    """This number may only fall."""
    assert set(ROOMS) | set(MODULES) <= set(icmj.__all__)
    assert len(TOP) <= 80


def test_every_public_name_is_a_class_or_a_function_even_after_all_are_loaded():
    for _ in range(2):  # importing a submodule could put it in the place of a function of its name
        for home, name in EVERYWHERE:
            thing = getattr(sys.modules[home], name)
            assert inspect.isclass(thing) or inspect.isfunction(thing), f"{home}.{name}"
            assert (inspect.getdoc(thing) or "").strip(), f"{home}.{name} is not documented"


def test_every_public_name_has_one_home_and_lies_in_it():
    names = [name for _, name in EVERYWHERE]
    assert not [name for name in names if names.count(name) > 1]
    for home, name in EVERYWHERE:
        thing = getattr(sys.modules[home], name)
        assert thing.__name__ == name
        assert thing.__module__.startswith(f"{home}."), f"{home}.{name} is of {thing.__module__}"


def test_no_name_of_a_room_is_that_of_a_module_in_it():
    """Importing the module would put it in the place of the name."""
    for room, names in NAMES.items():
        folder = Path(icmj.__file__).parent / room
        assert not {path.stem for path in folder.glob("*.py")} & set(names), room
    assert not set(TOP) & set(ROOMS)


def test_a_room_says_what_it_is_for():
    for room in (*ROOMS, *MODULES):
        thing = getattr(icmj, room)
        assert inspect.ismodule(thing), room
        assert (thing.__doc__ or "").strip(), room


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match=r"^icmj has no attribute 'nonsense'$"):
        _ = icmj.nonsense
    assert not hasattr(icmj, "__wrapped__")


@pytest.mark.parametrize("room", ROOMS)
def test_a_name_of_a_room_is_not_at_the_top_and_the_error_says_where_it_is(room):
    for name in NAMES[room]:
        with pytest.raises(AttributeError) as caught:
            getattr(icmj, name)
        assert str(caught.value) == f"icmj has no attribute {name!r}; it is icmj.{room}.{name}"


def test_importing_icmj_imports_nothing_heavy():
    script = "import icmj, sys; print(*{'numpy', 'mujoco', 'rerun', *(f'icmj.{r}' for r in %r)} & set(sys.modules))"
    assert run(script % (ROOMS,)) == ""


def test_rooms_are_there_without_being_imported_and_import_nothing_heavy():
    script = """
import sys, icmj
for room in %r:
    getattr(icmj, room).__doc__
print(f"heavy: {' '.join({'numpy', 'scipy', 'mujoco', 'rerun', 'pydantic'} & set(sys.modules))}")
print(icmj.theory.DelayLoop.__name__, icmj.plots.style.__name__, icmj.errors.RunFileError.__name__)
"""
    assert run(script % (ROOMS,)).split("\n") == ["heavy: ", "DelayLoop style RunFileError"]


def test_way_from_a_python_control_system():
    import control

    assumed = icmj.LinearPlant.from_statespace(control.ss(control.tf([1], [1, 0, -1])))
    design = icmj.design_lq(assumed, R_c=0.1, R_o=0.01)
    trigger = icmj.EventTrigger(icmj.output_weight(design), q_t=0.01)
    prediction = icmj.predict(icmj.error_system(assumed.scaled(0.8), design), trigger)
    assert prediction.delta_crit == pytest.approx(1.8065, abs=5e-5)


def test_way_from_a_run_file(root):
    case = icmj.prepare(icmj.load_run(root / "runs" / "simple-0.8.toml"))
    simulation = icmj.simulate(case, "linear")
    motion = icmj.measure(simulation, T_hat=case.system.T_hat)
    assert motion.interval == pytest.approx(case.prediction.delta_crit, rel=1e-9)
