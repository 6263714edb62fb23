"""icmj: event-driven intermittent control, from linear eigen-analysis to a standing human in MuJoCo.

One way through::

    run = load_run("runs/three-link-0.9.toml")
    case = prepare(run)                      # plants, linearisation, design, error system, prediction
    simulation = simulate(case, "mujoco")    # or "linear"
    motion = measure(simulation, T_hat=case.system.T_hat)

or without a run file, from python-control systems::

    assumed = LinearPlant.from_statespace(system)
    design = design_lq(assumed, R_c=0.1, R_o=0.01)
    prediction = predict(error_system(assumed.scaled(0.8), design), EventTrigger(output_weight(design), q_t=0.01))

Names below are loaded on first use, so that importing icmj costs nothing.
"""

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from icmj.case import Case, prepare, simulate
    from icmj.comparison import Comparison, compare
    from icmj.controller import ClockTrigger, Continuous, Controller, EventTrigger, output_weight
    from icmj.design import Design, design_lq
    from icmj.engine.plant import MujocoPlant, load_plant
    from icmj.errors import IcmjError
    from icmj.linear_plant import LinearPlant
    from icmj.log import read_log, write_log
    from icmj.measurement import Measurement, measure
    from icmj.report import build_report
    from icmj.result import Result
    from icmj.runfile import RunFile, load_run
    from icmj.simulation import Simulation
    from icmj.study import run_case, run_study
    from icmj.theory.error_system import ErrorSystem, error_system
    from icmj.theory.prediction import Prediction, predict

_HOMES = {
    "icmj.case": ("Case", "prepare", "simulate"),
    "icmj.comparison": ("Comparison", "compare"),
    "icmj.controller": ("ClockTrigger", "Continuous", "Controller", "EventTrigger", "output_weight"),
    "icmj.design": ("Design", "design_lq"),
    "icmj.engine.plant": ("MujocoPlant", "load_plant"),
    "icmj.errors": ("IcmjError",),
    "icmj.linear_plant": ("LinearPlant",),
    "icmj.log": ("read_log", "write_log"),
    "icmj.measurement": ("Measurement", "measure"),
    "icmj.report": ("build_report",),
    "icmj.result": ("Result",),
    "icmj.runfile": ("RunFile", "load_run"),
    "icmj.simulation": ("Simulation",),
    "icmj.study": ("run_case", "run_study"),
    "icmj.theory.error_system": ("ErrorSystem", "error_system"),
    "icmj.theory.prediction": ("Prediction", "predict"),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}

try:
    __version__ = version("icmj")
except PackageNotFoundError:  # a source tree that is not installed
    __version__ = "0+unknown"


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'icmj' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])


__all__ = [
    "Case",
    "ClockTrigger",
    "Comparison",
    "Continuous",
    "Controller",
    "Design",
    "ErrorSystem",
    "EventTrigger",
    "IcmjError",
    "LinearPlant",
    "Measurement",
    "MujocoPlant",
    "Prediction",
    "Result",
    "RunFile",
    "Simulation",
    "build_report",
    "compare",
    "design_lq",
    "error_system",
    "load_plant",
    "load_run",
    "measure",
    "output_weight",
    "predict",
    "prepare",
    "read_log",
    "run_case",
    "run_study",
    "simulate",
    "write_log",
]
