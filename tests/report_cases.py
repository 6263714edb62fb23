"""Results for the tests of report and comparison: every kind of case, from theory and linear simulation.

A result "of MuJoCo" is the linear run under that name with a stated small departure, so that no test here waits for
the engine; the report cannot tell.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from icmj import Controller, Design, design_lq, error_system, measure, parse_run, predict, system_matched
from icmj.case.result import AmplitudeLaw, Growth, Result
from icmj.controller.design import output_weight
from icmj.controller.rules.quadratic import EventTrigger
from icmj.controller.trigger import Continuous
from icmj.linear.run import simulate
from icmj.plant.linear_plant import LinearPlant, transformation
from icmj.report.case_runs import CaseRuns
from icmj.report.material import Material
from icmj.report.panels import PANELS
from icmj.report.picture import Drawing, Picture
from icmj.report.section import Section
from icmj.report.sections import SECTIONS
from icmj.simulation.pressure import Pressure

MODELS = Path(__file__).parents[1] / "models"
NAMES = {"states": ("hinge", "hinge_rate"), "inputs": ("torque",), "outputs": ("angle",), "output_units": ("rad",)}
PENDULUM = LinearPlant([[0, 1], [1, 0]], [[0], [1]], [[1, 0]], **NAMES)
BY_LETTER = {panel.letter: panel for panel in PANELS.collect("PANEL")}
PAPER_PANELS = tuple(BY_LETTER[letter] for letter in "abcdef")  # which every case has

# case: title, the paper's figure, its Δ_crit, λ and cycle
CASES = {
    "b0.8": ("Simple system, b = 0.8", "simple-gain=0o8", 1.8, 1, True),
    "b1.2": ("Simple system, b = 1.2", "simple-gain=1o2", 1.53, -1, True),
    "b1.7": ("Simple system, b = 1.7", "simple-gain=1o7", 1.1, -1, False),
    "three-link": ("Three-link standing, b = 0.9", "three=0o9", 0.76, 1, True),
    "neglected": ("Neglected dynamics, ζ = 0.1", "simple-neglected", 3.6, 1, True),
    "printed": ("Neglected dynamics as printed, ζ = 0.5", "simple-neglected", 3.6, 1, True),
    "exact": ("Exact model, b = 1", "", None, None, None),
}


def neglected(zeta: float) -> LinearPlant:
    """The pendulum behind ω_n²/(s² + 2ζω_n s + ω_n²), ω_n = 10, in closed form."""
    A = [[0, 1, 0, 0], [1, 0, 0, 1], [0, 0, -20 * zeta, -100], [0, 0, 1, 0]]
    states = (*NAMES["states"], "torque_act0", "torque_act1")
    return LinearPlant(A, [[0], [0], [100], [0]], [[1, 0, 0, 0]], **{**NAMES, "states": states})


@cache
def design_of(name: str) -> Design:
    """The recovered design of the second-order systems, or the three-link one."""
    if name != "three-link":
        return design_lq(PENDULUM, R_c=0.1, R_o=0.01)
    from icmj.engine.plant import load_plant

    return design_lq(load_plant(MODELS / "three_link.xml").linearisation.plant, R_c=5e-7, R_o=2e-7)


def actual_plant(name: str) -> LinearPlant:
    """The plant that is really there."""
    if name in ("neglected", "printed"):
        return neglected(0.1 if name == "neglected" else 0.5)
    gain = {"b0.8": 0.8, "b1.2": 1.2, "b1.7": 1.7, "three-link": 0.9, "exact": 1.0}[name]
    return design_of(name).plant.scaled(gain)


def run_text(name: str, q_t: float = 0.01) -> str:
    """The run file of a case."""
    title, figure, delta, sign, cycle = CASES[name]
    facts = "" if delta is None else f"delta_crit = {delta}\neigenvalue = {sign}\ncycle = {str(cycle).lower()}\n"
    initial = "{ ankle = 0.01, knee = 0.01 }" if name == "three-link" else "{ hinge = 0.02 }"
    return (
        f'[case]\nname = "{name}"\ntitle = "{title}"\n[case.paper]\nfigure = "{figure}"\n{facts}'
        f'[assumed]\nmodel = "model.xml"\n[controller]\nq_t = {q_t}\n'
        f"[simulation]\nduration = {20 if name == 'three-link' else 60}\ninitial = {initial}\n"
    )


@cache
def result(name: str, plant: str = "linear") -> Result:
    """One case on the linear plant, or the same run passed off as MuJoCo's."""
    run, design, actual = parse_run(run_text(name)), design_of(name), actual_plant(name)
    controller = Controller(design, system_matched(design), EventTrigger(output_weight(design), run.controller.q_t))
    system = error_system(actual, design)
    prediction = predict(system, controller.trigger, delta_max=4.5 if actual.n > design.plant.n else 3.0)
    simulation = simulate(actual, controller, run.simulation.settings())
    continuous = simulate(actual, controller.triggered_by(Continuous()), run.simulation.settings())
    measurement = measure(simulation, T_hat=transformation(design.plant, actual))
    delta = np.linspace(0.1, 1.3 * (prediction.delta_crit or 2.0), 8)
    largest = np.array([np.abs(np.linalg.eigvals(system.phi(d))).max() for d in delta])
    found = Result(
        run, design.plant, actual, controller, prediction, simulation, measurement, continuous=continuous,
        growth=Growth(delta, largest, largest), provenance={"icmj": "0.1.0", "python": "3.11.0"},
    )  # fmt: skip
    if plant == "linear":
        return found
    q_t = np.array([1e-2, 1e-3, 1e-4])
    departed = measurement
    if measurement.period is not None:
        departed = replace(measurement, interval=measurement.interval * 1.0002, period=measurement.period * 1.0002)
    return replace(
        found,
        simulation=replace(simulation, plant="mujoco", precision={"integrator": "RK4", "order": 4, "timestep": 0.005}),
        continuous=replace(continuous, plant="mujoco"),
        measurement=departed,
        law=AmplitudeLaw(q_t, 2.3 * q_t**2, -1.4 * q_t**2, 2.0, 2.0) if name == "three-link" else None,
    )


def swaying(found: Result) -> Result:
    """The same as of who stands on a floor, with a centre of pressure that sways by 4 mm."""
    t = found.simulation.t
    centre, none = np.column_stack([0.004 * np.sin(t), 0 * t]), np.zeros(0)
    sides = (np.zeros((len(t), 0)), none, none, np.zeros((0, 2)), np.zeros((0, 0)))
    return replace(found, simulation=replace(found.simulation, pressure=Pressure(t, centre, np.zeros(2), (), *sides)))


def everything() -> list[Result]:
    """All cases on both plants."""
    return [result(name, plant) for name in CASES for plant in ("linear", "mujoco")]


@cache
def whole_report(base: Path) -> Path:
    """The folder of a report on everything, built once under ``base`` for all tests that only look at it."""
    from icmj.report.builder import build_report

    folder = base / "whole_report"
    build_report(everything(), folder / "report.html")
    return folder


class Undrawn(Material):
    """Material whose pictures are not drawn."""

    def show(self, drawing: Drawing) -> Picture:
        return Picture(drawing.name, b"<svg/>", drawing.alt)

    draw = show


def compose(name: str, cases: list[CaseRuns]) -> Section | None:
    """A section of a report on these cases, without its pictures."""
    return SECTIONS[name].compose(Undrawn(Path(), cases))


def context_of(name: str, cases: list[CaseRuns]) -> dict:
    """What the template of a section prints, which is there."""
    section = compose(name, cases)
    assert section is not None
    return section.context
