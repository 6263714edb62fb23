"""The compiled callbacks and loop, against the plain-Python ones; and that they start without compiling."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from engine_cases import controller, plant
from linear_cases import settings_from

from icmj.controller.trigger import ClockTrigger, Continuous, Trigger
from icmj.engine import block
from icmj.engine.callbacks import installed
from icmj.engine.native import structs
from icmj.engine.native.callbacks import callbacks
from icmj.engine.native.compilation import entry
from icmj.engine.run import simulate
from icmj.errors import ModelError
from icmj.simulation.settings import Settings
from icmj.simulation.simulation import Simulation

DISTURBED = [
    {"kind": "noise", "input": "torque", "size": 0.02, "bandwidth": 6.0, "seed": 1, "start": 0.2},
    {"kind": "impulse", "input": "torque", "size": 0.02, "start": 0.5003, "duration": 0.0371},
]
CASES: list[tuple[str, str, str, Trigger | None]] = [
    ("three_link", "three_link", "RK4", None),
    ("three_link", "three_link", "RK4", ClockTrigger(0.313)),
    ("three_link", "three_link", "RK4", Continuous()),
    ("three_link", "three_link", "Euler", None),
    ("three_link", "three_link", "implicitfast", None),
    ("three_link", "three_link", "discrete", None),
    ("pendulum", "pendulum", "RK4", None),
    ("pendulum_neglected", "pendulum", "RK4", None),
]


def both(actual: str, assumed: str, trigger: Trigger | None, settings: Settings) -> list[Simulation]:
    control = controller(assumed, 0.01)
    control = control if trigger is None else control.triggered_by(trigger)
    body = plant(actual, 0.9)
    x0 = np.zeros(body.linearisation.plant.n)
    x0[0] = 0.02
    return [simulate(body, control, replace(settings, native=native), x0=x0) for native in (True, False)]


def agree(native: Simulation, python: Simulation) -> None:
    assert native.precision["implementation"] == "native"
    assert python.precision["implementation"] == "python"
    assert native.outcome.kind == python.outcome.kind
    for name in ("t", "x", "y", "u", "x_o", "x_h"):
        a, b = getattr(native, name), getattr(python, name)
        np.testing.assert_allclose(a, b, atol=1e-12 * max(1.0, np.abs(b).max()), rtol=0)
    for name in ("t", "x", "x_o", "x_h", "y_max", "y_min"):
        a, b = getattr(native.events, name), getattr(python.events, name)
        np.testing.assert_allclose(a, b, atol=1e-12 * max(1.0, np.abs(b).max(initial=0)), rtol=0)


@pytest.mark.parametrize(("actual", "assumed", "integrator", "trigger"), CASES)
def test_native_and_python_trajectories_agree(
    actual: str, assumed: str, integrator: str, trigger: Trigger | None
) -> None:
    settings = settings_from({"duration": 2.5, "timestep": 4e-3, "integrator": integrator})
    native, python = both(actual, assumed, trigger, settings)
    agree(native, python)
    assert len(native.events) >= 2 or isinstance(trigger, Continuous)


@pytest.mark.parametrize("actual", ["pendulum", "pendulum_neglected"])
def test_native_and_python_agree_when_disturbed(actual: str) -> None:
    settings = settings_from({"duration": 2.5, "timestep": 4e-3, "disturbance": DISTURBED})
    native, python = both(actual, "pendulum", None, settings)
    agree(native, python)
    free = both(actual, "pendulum", None, Settings(duration=2.5, timestep=4e-3))[0]
    assert abs(native.x[-1, 0] - free.x[-1, 0]) > 1e-4


def test_native_callbacks_leave_other_models_alone() -> None:
    control, act_dyn = callbacks()
    with installed(control, act_dyn):
        # the compiler's temporary model, models without numerics, with others, and with a lag of their own
        model = mujoco.MjModel.from_xml_path(str(Path(__file__).parents[2] / "models" / "pendulum_neglected.xml"))
        data = mujoco.MjData(model)
        data.ctrl[:], data.act[:] = 0.7, [0.1, 0.2]
        mujoco.mj_forward(model, data)
        np.testing.assert_array_equal(data.ctrl, [0.7])
        np.testing.assert_array_equal(data.act_dot, [0.0, 0.0])
        spec = plant("three_link").spec.copy()
        spec.add_numeric(name="short", data=np.ones(3), size=3)
        spec.add_numeric(name="long", data=np.ones(40), size=40)
        model = spec.compile()
        data = mujoco.MjData(model)
        data.ctrl[:] = [1.0, 2.0, 3.0]
        mujoco.mj_step(model, data)
        np.testing.assert_array_equal(data.ctrl, [1.0, 2.0, 3.0])


def test_layout_agrees_with_the_engine() -> None:
    model = plant("pendulum_neglected").spec.copy().compile()
    data = mujoco.MjData(model)
    structs.check(model, data)
    address = model._address + structs.offset("mjModel", "opt.gravity")
    np.testing.assert_array_equal((ctypes.c_double * 3).from_address(address)[:], model.opt.gravity)
    address = data._address + structs.offset("mjData", "warning")
    data.warning[2].number = 41
    assert (ctypes.c_int * 14).from_address(address)[5] == 41
    with pytest.raises(ModelError, match=r"no usable mjData\.nonsense"):
        structs.offset("mjData", "nonsense")


def test_wrong_layout_is_an_error_at_start_up(monkeypatch: pytest.MonkeyPatch) -> None:
    model = plant("pendulum").spec.copy().compile()
    shifted = {name: at + 8 for name, at in structs.offsets("mjData").items()}
    right = structs.offsets
    monkeypatch.setattr(structs, "offsets", lambda struct: shifted if struct == "mjData" else right(struct))
    with pytest.raises(ModelError, match="does not lie in memory as it declares"):
        structs.check(model, mujoco.MjData(model))


def test_code_that_does_not_compute_this_controller_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    # as with code on disk from another version: the callbacks do not know the model for one of theirs
    monkeypatch.setattr(block, "MAGIC", block.MAGIC + 1)
    with pytest.raises(ModelError, match="delete numba's cache"):
        simulate(plant("pendulum"), controller("pendulum"), Settings(duration=1.0), x_o0=[0.1, 0.0])


def test_functions_compile_where_there_is_no_folder_for_a_cache() -> None:
    scope: dict[str, object] = {}
    exec("def twice(x):\n    return 2 * x", scope)  # numba finds no source file to cache beside
    assert entry(scope["twice"])(21) == 42  # type: ignore[arg-type]


CHILD = """
import sys
sys.path.insert(0, sys.argv[1])
from engine_cases import controller, plant
from linear_cases import settings_from
from icmj.engine.native import loop as native_loop
from icmj.engine.run import simulate
from icmj.simulation.settings import Settings
run = simulate(plant("pendulum", 0.8), controller("pendulum"), Settings(duration=2.0, timestep=0.002), x0=[0.1, 0.0])
stats = native_loop.fixed_loop().stats
print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()), repr(float(run.events.t[-1])))
"""


@pytest.mark.slow
def test_second_process_starts_without_compiling(tmp_path: Path) -> None:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}

    def children(count: int) -> list[list[str]]:
        """At the same time."""
        command = [sys.executable, "-c", CHILD, str(Path(__file__).parents[1])]
        options = {"env": environment, "stdout": subprocess.PIPE, "text": True}
        started = [subprocess.Popen(command, **options) for _ in range(count)]  # type: ignore[call-overload]
        return sorted(process.communicate(timeout=300)[0].split() for process in started)

    # one compiles; the other waits for it
    compiled, waited = children(2)
    assert compiled[:2] == ["0", "1"]
    assert waited[:2] == ["1", "0"]
    written = sorted(path.name for path in (tmp_path / "cache").rglob("*.nbc"))
    (later,) = children(1)
    assert later[:2] == ["1", "0"]
    assert sorted(path.name for path in (tmp_path / "cache").rglob("*.nbc")) == written
    assert compiled[2] == waited[2] == later[2]
