"""icmj: event-driven intermittent control, from linear eigen-analysis to a standing human in MuJoCo.

One way through::

    run = load_run("runs/three-link-0.9.toml")
    case = prepare(run)                      # plants, linearisation, design, error system, prediction
    simulation = simulate(case, "mujoco")    # or "linear"
    motion = measure(simulation, T_hat=case.system.T_hat)

or without a run file, from python-control systems::

    assumed = LinearPlant.from_statespace(system)
    design = design_lq(assumed, R_c=0.1, R_o=0.01)
    rule = EventTrigger(output_weight(design), q_t=0.01)
    prediction = predict(error_system(assumed.scaled(0.8), design), rule)
    controller = Controller(design, system_matched(design), rule)
    simulation = simulate_plant(assumed.scaled(0.8), controller, Settings(duration=20.0), x0=[0.02, 0.0])

Names below are loaded on first use, so that importing icmj costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from icmj.base.version import VERSION

if TYPE_CHECKING:
    from icmj.case.case import Case, open_loop, prepare, simulate, simulate_plant
    from icmj.case.iosystem import to_iosystem
    from icmj.comparison.comparison import Comparison, compare
    from icmj.controller.controller import Controller, continuous_limit
    from icmj.controller.delay import Delay
    from icmj.controller.design import Design, design_lq
    from icmj.controller.hold import Hold, system_matched, zero_order
    from icmj.controller.trigger import ClockTrigger, Continuous, EventRule, EventTrigger, output_weight
    from icmj.cycle.branch import Branch, SpecialPoint
    from icmj.cycle.cycle import Cycle, find_cycle
    from icmj.cycle.follow import branch_off, follow
    from icmj.cycle.storage import read_branch, write_branch
    from icmj.engine.accuracy import choose_timestep
    from icmj.engine.deviation import Deviation
    from icmj.engine.plant import MujocoPlant, load_plant
    from icmj.engine.pressure import centre_of_pressure
    from icmj.errors import IcmjError
    from icmj.experiment.amplitude_law import measure_law
    from icmj.experiment.attractors import attractors
    from icmj.experiment.growth import measure_growth
    from icmj.identification.identification import Identification, identify
    from icmj.identification.observed import Observed
    from icmj.identification.unknown import Unknown
    from icmj.log import read_log, write_log
    from icmj.measurement.measurement import Measurement, measure
    from icmj.measurement.stabilogram import Diffusion, diffusion
    from icmj.measurement.statistics import Statistics, statistics
    from icmj.measurement.sway import Sway, measure_sway
    from icmj.plant.change import Change
    from icmj.plant.linear_plant import LinearPlant
    from icmj.plant.notice import Notice
    from icmj.plant.operating import OperatingRule
    from icmj.plant.person import Person
    from icmj.plant.push import Push
    from icmj.plant.quality import Quality
    from icmj.plant.selection import Selection
    from icmj.report import build_report, plots
    from icmj.result.result import Result
    from icmj.runfile.composing import compose_run
    from icmj.runfile.reading import load_run, parse_run
    from icmj.runfile.schema import RunFile
    from icmj.series.reading import read_series
    from icmj.series.series import Series
    from icmj.series.writing import write_series
    from icmj.simulation.interval import OpenLoop, OpenLoopInterval
    from icmj.simulation.pressure import Pressure
    from icmj.simulation.settings import Bias, Impulse, Noise, Settings, Step
    from icmj.simulation.simulation import Simulation
    from icmj.study.study import run_case, run_study
    from icmj.sweeps.dataset import read_sweep
    from icmj.sweeps.sweep import sweep
    from icmj.theory.error_system import ErrorSystem, error_system
    from icmj.theory.prediction import Prediction, predict

_HOMES = {
    "icmj.case.case": (
        "Case",
        "open_loop",
        "prepare",
        "simulate",
        "simulate_plant",
    ),
    "icmj.case.iosystem": ("to_iosystem",),
    "icmj.comparison.comparison": (
        "Comparison",
        "compare",
    ),
    "icmj.controller.controller": ("Controller", "continuous_limit"),
    "icmj.controller.delay": ("Delay",),
    "icmj.controller.design": (
        "Design",
        "design_lq",
    ),
    "icmj.controller.hold": (
        "Hold",
        "system_matched",
        "write_branch",
        "zero_order",
    ),
    "icmj.controller.trigger": (
        "ClockTrigger",
        "Continuous",
        "EventRule",
        "EventTrigger",
        "output_weight",
    ),
    "icmj.cycle.branch": ("Branch", "SpecialPoint"),
    "icmj.cycle.cycle": ("Cycle", "find_cycle"),
    "icmj.cycle.follow": ("branch_off", "follow"),
    "icmj.cycle.storage": ("read_branch", "write_branch"),
    "icmj.engine.accuracy": ("choose_timestep",),
    "icmj.engine.deviation": ("Deviation",),
    "icmj.engine.plant": (
        "MujocoPlant",
        "load_plant",
    ),
    "icmj.engine.pressure": ("centre_of_pressure",),
    "icmj.errors": ("IcmjError",),
    "icmj.experiment.amplitude_law": ("measure_law",),
    "icmj.experiment.attractors": ("attractors",),
    "icmj.experiment.growth": ("measure_growth",),
    "icmj.identification.identification": ("Identification", "identify"),
    "icmj.identification.observed": ("Observed",),
    "icmj.identification.unknown": ("Unknown",),
    "icmj.log": (
        "read_log",
        "write_log",
    ),
    "icmj.measurement.measurement": (
        "Measurement",
        "measure",
    ),
    "icmj.measurement.stabilogram": ("Diffusion", "diffusion"),
    "icmj.measurement.statistics": (
        "Statistics",
        "statistics",
    ),
    "icmj.measurement.sway": ("Sway", "measure_sway"),
    "icmj.plant.change": ("Change",),
    "icmj.plant.linear_plant": ("LinearPlant",),
    "icmj.plant.notice": ("Notice",),
    "icmj.plant.operating": ("OperatingRule",),
    "icmj.plant.person": ("Person",),
    "icmj.plant.push": ("Push",),
    "icmj.plant.quality": ("Quality",),
    "icmj.plant.selection": ("Selection",),
    "icmj.report": ("build_report",),
    "icmj.result.result": ("Result",),
    "icmj.runfile.composing": ("compose_run",),
    "icmj.runfile.reading": (
        "load_run",
        "parse_run",
    ),
    "icmj.runfile.schema": ("RunFile",),
    "icmj.series.reading": ("read_series",),
    "icmj.series.series": ("Series",),
    "icmj.series.writing": ("write_series",),
    "icmj.simulation.interval": (
        "OpenLoop",
        "OpenLoopInterval",
    ),
    "icmj.simulation.pressure": ("Pressure",),
    "icmj.simulation.settings": (
        "Bias",
        "Impulse",
        "Noise",
        "Settings",
        "Step",
    ),
    "icmj.simulation.simulation": ("Simulation",),
    "icmj.study.study": (
        "run_case",
        "run_study",
    ),
    "icmj.sweeps.dataset": ("read_sweep",),
    "icmj.sweeps.sweep": ("sweep",),
    "icmj.theory.error_system": (
        "ErrorSystem",
        "error_system",
    ),
    "icmj.theory.prediction": (
        "Prediction",
        "predict",
    ),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}
# a module is public as a whole
_MODULES = {"plots": "icmj.report.plots"}
# a rule is public by standing in its home's list of names
_OPEN_HOME = "icmj.controller.trigger"

__version__ = VERSION


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    if name in _MODULES:
        return import_module(_MODULES[name])
    if not name.startswith("_") and name in (home := import_module(_OPEN_HOME)).__all__:
        return getattr(home, name)
    raise AttributeError(f"module 'icmj' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME, *_MODULES])


__all__ = [
    "Bias",
    "Branch",
    "Case",
    "Change",
    "ClockTrigger",
    "Comparison",
    "Continuous",
    "Controller",
    "Cycle",
    "Delay",
    "Design",
    "Deviation",
    "Diffusion",
    "ErrorSystem",
    "EventRule",
    "EventTrigger",
    "Hold",
    "IcmjError",
    "Identification",
    "Impulse",
    "LinearPlant",
    "Measurement",
    "MujocoPlant",
    "Noise",
    "Notice",
    "Observed",
    "OpenLoop",
    "OpenLoopInterval",
    "OperatingRule",
    "Person",
    "Prediction",
    "Pressure",
    "Push",
    "Quality",
    "Result",
    "RunFile",
    "Selection",
    "Series",
    "Settings",
    "Simulation",
    "SpecialPoint",
    "Statistics",
    "Step",
    "Sway",
    "Unknown",
    "attractors",
    "branch_off",
    "build_report",
    "centre_of_pressure",
    "choose_timestep",
    "compare",
    "compose_run",
    "continuous_limit",
    "design_lq",
    "diffusion",
    "error_system",
    "find_cycle",
    "follow",
    "identify",
    "load_plant",
    "load_run",
    "measure",
    "measure_growth",
    "measure_law",
    "measure_sway",
    "open_loop",
    "output_weight",
    "parse_run",
    "plots",
    "predict",
    "prepare",
    "read_branch",
    "read_log",
    "read_series",
    "read_sweep",
    "run_case",
    "run_study",
    "simulate",
    "simulate_plant",
    "statistics",
    "sweep",
    "system_matched",
    "to_iosystem",
    "write_branch",
    "write_log",
    "write_series",
    "zero_order",
]
