"""MuJoCo's callbacks, of which a process has one of each kind: those of others are taken off, and always put back.

A callback of one's own acts in nothing that icmj computes and breaks nothing, whoever set it and when; and any number
of threads compile and simulate at once.
"""

import ctypes
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np
import pytest
from engine_cases import MODELS, plant
from patience import PATIENCE

from icmj import Person, Step, find_cycle, load_plant, load_run, prepare, simulate
from icmj.engine.dynamics import Dynamics
from icmj.engine.inventory import list_inventory
from icmj.engine.isolation import isolate_engine
from icmj.engine.library import find_library
from icmj.engine.native.field import callbacks
from icmj.engine.planar_chain import find_chain
from icmj.engine.plant import shape_to_person
from icmj.engine.reaction import ground_force, reaction
from icmj.plant import Activation, OperatingRule, Selection

RUNS = MODELS.parent / "runs"
CASES = ("three-link-0.9.toml", "neglected-0.1.toml", "rivals/three-link-switching.toml", "three-link-0.9-delay.toml")
KINDS = ["mju_user_warning", *(name[4:] for name in dir(mujoco) if name.startswith("set_mjcb_"))]
LIBRARY = ctypes.CDLL(str(find_library()))


def now() -> dict[str, tuple[object, int | None]]:
    """Every callback as Python and as C has it."""
    return {name: (getattr(mujoco, f"get_{name}")(), ctypes.c_void_p.in_dll(LIBRARY, name).value) for name in KINDS}


@pytest.fixture(autouse=True)
def as_before() -> Iterator[None]:
    """Whatever a test sets in MuJoCo is taken off after it."""
    time = ctypes.c_void_p.in_dll(LIBRARY, "mjcb_time").value  # that of MuJoCo's bindings
    yield
    for name in KINDS:
        getattr(mujoco, f"set_{name}")(None)
        ctypes.c_void_p.in_dll(LIBRARY, name).value = time if name == "mjcb_time" else None


def refuse(*arguments: object) -> float:
    """A callback in Python that must not be called."""
    raise AssertionError(arguments)


class Native:
    """A callback in machine code that counts its calls, for Python to set, or for C."""

    def __init__(self) -> None:
        self.calls = 0
        self.function = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)(self._count)

    def _count(self, *arguments: object) -> float:
        self.calls += 1
        return 0.0


def of_python(native: Native) -> None:
    for name in KINDS:
        getattr(mujoco, f"set_{name}")(refuse)


def of_machine_code(native: Native) -> None:
    for name in KINDS:
        if name != "mju_user_warning":  # which Python alone can set
            getattr(mujoco, f"set_{name}")(native.function)


def of_c(native: Native) -> None:
    for name in KINDS:
        ctypes.c_void_p.in_dll(LIBRARY, name).value = ctypes.cast(native.function, ctypes.c_void_p).value


def everything() -> list[np.ndarray]:
    """What icmj has MuJoCo compute, of each kind of it: plants, forces, runs, flights, systems of python-control."""
    person, lag = Person(mass=60.0, height=1.6), Activation(2, time_constant=0.05)
    push = Step(body="trunk", force=(1.0, 0.0, 0.0))
    body = load_plant(MODELS / "three_link.xml", person=person, activation=lag, operating=OperatingRule("balance"))
    floor = load_plant(MODELS / "three_link_floor.xml", keyframe="upright", selection=Selection(outputs="joints"))
    found = [
        body.linearisation.plant.A,
        floor.linearisation.plant.A,
        body.quality.residual,
        *reaction(body).__dict__.values(),
    ]
    found += [
        *body.pushed([push]).pushes.values(),
        *Dynamics(body)(0.01 * np.ones(12), np.ones(3)),
    ]
    for name in CASES:
        case = prepare(load_run(RUNS / name))
        run = simulate(case, duration=2.0)
        found += [run.qpos, run.y, run.events.t, ground_force(case.model, run).values]
    found += [find_cycle(prepare(load_run(RUNS / CASES[0]))).multipliers]
    assert "trunk" in list_inventory(MODELS / "three_link_floor.xml").bodies
    assert "trunk" in shape_to_person(MODELS / "three_link.xml", person)
    assert find_chain(body)[0]
    return found


@pytest.fixture(scope="module")
def undisturbed() -> list[np.ndarray]:
    return everything()


@pytest.mark.parametrize("install", [of_python, of_machine_code, of_c])
def test_callbacks_of_others_act_in_nothing_break_nothing_and_are_put_back(
    undisturbed: list[np.ndarray], install: Callable[[Native], None]
) -> None:
    """Also such as are set after a first run."""
    native = Native()
    install(native)
    before = now()
    for found, expected in zip(everything(), undisturbed, strict=True):
        np.testing.assert_array_equal(found, expected)
    assert native.calls == 0
    assert now() == before
    data = mujoco.MjData(plant("three_link").model)
    if install is of_python:
        with pytest.raises(AssertionError):
            mujoco.mj_forward(data.model, data)
    else:
        mujoco.mj_forward(data.model, data)
        assert native.calls > 0


def test_threads_compile_and_simulate_at_once_what_they_would_one_after_another() -> None:
    """Nothing of it is shared: each thread has cases of its own, compiled while others run."""

    def work(name: str) -> list[np.ndarray]:
        case = prepare(load_run(RUNS / name))
        run = simulate(case, duration=2.0)
        return [run.t, run.qpos, run.u, run.events.t]

    names = CASES * 4
    expected = {name: work(name) for name in CASES}
    filters = list(warnings.filters)
    with ThreadPoolExecutor(4) as pool:
        for name, found in zip(names, pool.map(work, names), strict=True):
            for one, other in zip(found, expected[name], strict=True):
                np.testing.assert_array_equal(one, other)
    assert warnings.filters == filters


def test_the_engine_is_given_back_whatever_happens_and_blocks_nest() -> None:
    before = now()
    with isolate_engine(*callbacks()):
        assert mujoco.get_mjcb_control() is callbacks()[0]
        with pytest.raises(ZeroDivisionError), isolate_engine():
            raise ZeroDivisionError
        assert mujoco.get_mjcb_act_dyn() is callbacks()[1]
    assert now() == before


def test_threads_share_the_engine_until_the_last_has_left() -> None:
    mujoco.set_mjcb_passive(refuse)
    before, inside, leave = now(), threading.Barrier(3), [threading.Event(), threading.Event()]

    def work(of: tuple[object, ...], event: threading.Event) -> None:
        with isolate_engine(*of):
            inside.wait(PATIENCE)
            event.wait(PATIENCE)

    threads = [threading.Thread(target=work, args=each) for each in zip([callbacks(), ()], leave, strict=True)]
    for thread in threads:
        thread.start()
    inside.wait(PATIENCE)
    for thread, event in zip(threads, leave, strict=True):
        assert mujoco.get_mjcb_passive() is None
        event.set()
        thread.join(PATIENCE)
    assert now() == before
