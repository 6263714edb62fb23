"""The compiled callbacks and loop: the same source interpreted says the same; and they start without compiling."""

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from engine_cases import controller, plant
from engine_runs import CHOSEN, FIXED, OTHERS, RUNS
from patience import PATIENCE

from icmj.engine import block
from icmj.engine.isolation import isolate_engine
from icmj.engine.native import memory as structs
from icmj.engine.native.field import callbacks
from icmj.engine.native.memory import entry
from icmj.engine.run import simulate
from icmj.errors import ModelError
from icmj.simulation.settings import Settings

TESTS = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def interpreted(tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    """All of ``engine_runs`` in a process where MuJoCo's structs are not declared and numba is not installed."""
    out, environment = tmp_path_factory.mktemp("interpreted") / "runs.npz", os.environ | {"ICMJ_INTERPRETED": "1"}
    command = [sys.executable, str(TESTS / "engine_runs.py"), str(out)]
    subprocess.run(command, env=environment, check=True, timeout=PATIENCE)
    with np.load(out) as held:
        return dict(held)


def agree(interpreted: dict[str, np.ndarray], name: str, seconds: float, relative: float) -> None:
    """Event times apart by at most ``seconds``, everything else by ``relative`` times the largest of its kind."""
    compiled = RUNS[name]()
    others = {key.rpartition("/")[2]: value for key, value in interpreted.items() if key.startswith(f"{name}/")}
    assert compiled.keys() == others.keys()
    for key, found in compiled.items():
        if found.dtype.kind not in "f":
            np.testing.assert_array_equal(found, others[key], err_msg=key)
            continue
        timely = key.endswith("t")
        atol = seconds if timely else relative * np.abs(found).max(initial=0.0)
        np.testing.assert_allclose(found, others[key], atol=atol, rtol=0, err_msg=key)


# Both are the same operations, but compiled code sums in another order (`icmj.base.compilation.summing`), and has
# cosines of its own. The step that is chosen is rounded, so that it is the same.
@pytest.mark.parametrize("name", FIXED)
def test_interpreted_and_compiled_steps_agree(interpreted: dict[str, np.ndarray], name: str) -> None:
    # what a push moves is read again a delay later, through polynomials of polynomials: 1.8e-13 s there
    agree(interpreted, name, 5e-13 if name == "tapped and pushed" else 1e-13, 1e-12)


@pytest.mark.parametrize("name", CHOSEN)
def test_interpreted_and_compiled_chosen_steps_agree(interpreted: dict[str, np.ndarray], name: str) -> None:
    agree(interpreted, name, 2e-13, 1e-11)


@pytest.mark.parametrize("name", OTHERS)
def test_what_else_is_asked_of_the_engine_is_the_same_interpreted(
    interpreted: dict[str, np.ndarray], name: str
) -> None:
    agree(interpreted, name, 1e-13, 1e-12)


def test_the_runs_compared_do_what_they_are_for(interpreted: dict[str, np.ndarray]) -> None:
    for name in FIXED | CHOSEN:
        assert interpreted[f"{name}/t"].shape[0] >= 2
        assert "continuous" in name or name in ("balls", "flights") or len(interpreted[f"{name}/events.t"]), name
    assert interpreted["diverging/outcome"] == interpreted["given up/outcome"] == "diverged"
    assert interpreted["due at once/events.t"][0] == 0.02


def test_a_run_tells_how_it_was_computed() -> None:
    run = simulate(plant("pendulum"), controller("pendulum"), Settings(duration=0.2), x_o0=[0.1, 0.0])
    assert run.precision["implementation"] == "compiled"


def test_native_callbacks_leave_other_models_alone() -> None:
    control, act_dyn = callbacks()
    with isolate_engine(control, act_dyn):
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
    with pytest.raises(ModelError, match=r"does not lie in memory as it declares.*set .* ICMJ_INTERPRETED=1"):
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
from icmj.cli.terminal import Terminal
from icmj.cli.progress import Working
from icmj.engine.native import steps as native_loop
from icmj.engine.run import simulate
from icmj.simulation.settings import Settings
settings = Settings(duration=2.0, timestep=0.002)
with Working("pendulum", Terminal(file=sys.stderr)):
    run = simulate(plant("pendulum", 0.8), controller("pendulum"), settings, x0=[0.1, 0.0])
stats = native_loop.compile_steps().stats
print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()), repr(float(run.events.t[-1])))
"""


@pytest.mark.slow
def test_second_process_starts_without_compiling(tmp_path: Path) -> None:
    """And whoever compiles, or waits for a process that does, is told that it happens once."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}

    def children(count: int) -> list[list[str]]:
        """At the same time; the last word of each is what it said of compiling."""
        command = [sys.executable, "-c", CHILD, str(Path(__file__).parents[1])]
        options = {"env": environment, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        started = [subprocess.Popen(command, **options) for _ in range(count)]  # type: ignore[call-overload]
        ended = [process.communicate(timeout=PATIENCE) for process in started]
        return sorted([*out.split(), err] for out, err in ended)

    # one compiles; the other waits for it
    compiled, waited = children(2)
    assert compiled[:2] == ["0", "1"]
    assert waited[:2] == ["1", "0"]
    written = sorted(path.name for path in (tmp_path / "cache").rglob("*.nbc"))
    (later,) = children(1)
    assert later[:2] == ["1", "0"]
    assert sorted(path.name for path in (tmp_path / "cache").rglob("*.nbc")) == written
    assert compiled[2] == waited[2] == later[2]
    assert "icmj: pendulum, compiling (first run only" in compiled[3]
    assert "icmj: pendulum, compiling (first run only" in waited[3]
    assert "compiling" not in later[3]
