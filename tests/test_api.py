"""The public surface: every name loads, none hides a module, importing icmj is free, the docstring's way works."""

import inspect
import subprocess
import sys

import pytest

import icmj

MODULES = ("plots",)


def test_every_public_name_is_a_class_or_a_function_even_after_all_are_loaded():
    for _ in range(2):  # importing a submodule could put it in the place of a function of its name
        for name in icmj.__all__:
            assert callable(getattr(icmj, name)) or name in MODULES, name


def test_public_modules_are_modules():
    for name in MODULES:
        assert inspect.ismodule(getattr(icmj, name)), name


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="nonsense"):
        _ = icmj.nonsense


def test_importing_icmj_imports_nothing_heavy():
    script = "import icmj, sys; sys.exit(', '.join({'numpy', 'mujoco', 'rerun'} & set(sys.modules)) or 0)"
    subprocess.run([sys.executable, "-c", script], check=True)


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
