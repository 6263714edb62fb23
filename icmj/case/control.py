"""The controller that a run file describes.

Its gains are designed by LQ weights or given. Its delay and its set-point belong to it.
"""

from __future__ import annotations

import numpy as np

from icmj.base.array import Array
from icmj.controller.delay import Delay
from icmj.controller.design import Design, design_lq
from icmj.controller.law import Law
from icmj.controller.setpoint import Setpoint, setpoint
from icmj.errors import DesignError
from icmj.plant.linear_plant import LinearPlant
from icmj.plant.quality import uncontrollable
from icmj.runfile.control_tables import Parts, Weights
from icmj.runfile.schema import RunFile
from icmj.runfile.target import make_targets


def controller_of(run: RunFile, assumed: LinearPlant, design: Design | None = None) -> Law:
    """The controller of a run file, for its assumed plant; with a ``design`` that is at hand.

    The set-point is part of it, so that whatever simulates the controller follows the set-point.

    Raises:
        DesignError, AnalysisError: if the weights give none, or rule, delay or set-point do not fit.
        RunFileError: if a file of the set-point cannot be read, or a controller of one's own may not be made, or
            cannot be.
    """
    return run.controller.law(parts_of(run, assumed, design))


def parts_of(run: RunFile, assumed: LinearPlant, design: Design | None = None) -> Parts:
    """What the table of the controller takes, with a ``design`` that is at hand."""
    known = assumed if design is None else design.plant
    return Parts(
        assumed, delay_of(run), run.code,
        design=lambda: design or make_design(assumed, run.design), setpoint=lambda: setpoint_of(run, known),
    )  # fmt: skip


def setpoint_of(run: RunFile, assumed: LinearPlant) -> Setpoint | None:
    """The set-point of a run file, until the end of its run; ``None`` if it has none.

    Raises:
        RunFileError, AnalysisError: if a file of it cannot be read, or the assumed plant has no such set-point.
    """
    return setpoint(assumed, make_targets(run.resolve().setpoint, run.simulation.duration, run.path))


def make_design(plant: LinearPlant, weights: Weights) -> Design:
    """Gains for the assumed plant: given ones as they are, the others by LQ design.

    Raises:
        DesignError: if a gain or weight does not fit the plant, or there is no LQ design.
    """
    k, L = (None if given is None else _gain(given, name) for given, name in ((weights.k, "k"), (weights.L, "L")))
    if k is not None and L is not None:
        return Design(plant, k, L)

    def square(weight: str | list, named: Array) -> Array | list | float:
        if weight == "identity":
            return 1.0
        return named if isinstance(weight, str) else weight

    # rounding may make a Riccati equation solvable that has no solution
    if any(not mode.stable for mode in uncontrollable(plant)):
        raise DesignError("no LQ design for this plant, which has a mode that the inputs do not reach")
    design = design_lq(
        plant,
        Q_c=square(weights.Q_c, plant.C.T @ plant.C),
        R_c=weights.R_c,
        Q_o=square(weights.Q_o, plant.B @ plant.B.T),
        R_o=weights.R_o,
    )
    return Design(plant, design.k if k is None else k, design.L if L is None else L)


def _gain(given: list, name: str) -> Array:
    try:
        gain = np.array(given, dtype=float)
    except ValueError as error:
        raise DesignError(f"{name} is not a matrix: its rows differ in length") from error
    if gain.ndim == 1:  # of a single input, or output
        return gain[None, :] if name == "k" else gain[:, None]
    return gain


def delay_of(run: RunFile) -> Delay:
    """The assumed delay, and the actual one, which departs from it by ρ of what the run file says."""
    assumed = run.assumed.delay
    actual = assumed if run.actual.delay is None else assumed + run.actual.rho * (run.actual.delay - assumed)
    return Delay(actual, assumed)
