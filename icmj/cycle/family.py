"""The loops of a run file over a parameter; each takes up the parts of the one before that have not changed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from icmj.case.case import Case, expect_theory
from icmj.case.control import make_design, parts_of
from icmj.case.iosystem import AnyPlant
from icmj.case.plants import actual_plant, assumed_plant, linear_plant
from icmj.cycle.parameter import Parameter
from icmj.cycle.return_map import PlantKind, ReturnMap
from icmj.engine.open_loop import OpenLoops
from icmj.engine.plant import MujocoPlant
from icmj.errors import CycleError
from icmj.runfile.schema import RunFile

ROWS = 4800  # that the longest flight would keep; intervals last a twelfth to a fiftieth of it


class ReturnMaps:
    """Return maps of a run file as a function of a parameter, without the prediction, which would cost time.

    Attributes:
        run, parameter, plant: what of.
    """

    def __init__(
        self, run: RunFile, parameter: Parameter, plant: PlantKind = "mujoco", like: Case | None = None
    ) -> None:
        """Create the family; plants and design of the case ``like`` are reused."""
        self.run, self.parameter, self.plant = run, parameter, plant
        self.held = any(key.endswith(".delay") for key in parameter.keys)  # one z along the branch, whatever the delay
        self._loops = OpenLoops()
        self._known: dict[str, tuple[Any, Any]] = {}
        if like is not None and like.run == run and like.run.path == run.path:
            self._known = {
                "assumed": (self._bare(run), like.assumed),
                "actual": (self._bodies(run), like.actual),
                "design": ((self._bare(run), run.design), expect_theory(like, "a branch").system.design),
            }

    def at(self, value: float, longest: float | None = None) -> ReturnMap:
        """The return map at a value.

        Args:
            value: of the parameter.
            longest: flight [s]; the run file's duration by default.

        Raises:
            IcmjError: if the run file does not allow the value, or there is no loop of it.
        """
        run = self.parameter.put(self.run, value)
        assumed: AnyPlant = self._once("assumed", self._bare(run), lambda: assumed_plant(run))
        actual: AnyPlant = self._once(
            "actual", self._bodies(run), lambda: self._regain(run) or actual_plant(run, assumed)
        )
        weights = (self._bare(run), run.design)
        design = self._once("design", weights, lambda: make_design(assumed.linearisation.plant, run.design))
        controller = replace(run.intermittent.law(parts_of(run, assumed.linearisation.plant, design)), setpoint=None)
        settings = run.resolve().simulation.settings()
        if longest is not None:
            settings = replace(settings, duration=longest)
        if self.plant == "linear":
            return ReturnMap(linear_plant(actual, settings), controller, settings, held=self.held)
        if not isinstance(actual, MujocoPlant):
            raise CycleError(f"{run.path}: the actual plant is given by matrices; take the linear plant")
        every = np.inf if longest is None else longest / ROWS
        return ReturnMap(actual, controller, settings, every, self._loops, self.held)

    def _regain(self, run: RunFile) -> MujocoPlant | None:
        """The last actual plant with another input gain, if that is all that differs: its point and model stay."""
        if "actual" not in self._known:
            return None
        (assumed, actual), plant = self._known["actual"]
        before, after = actual.gain, run.actual.gain
        same = assumed == run.assumed and actual == run.actual.model_copy(update={"delay": None, "gain": before})
        plain = isinstance(before, float) and isinstance(after, float) and before != 0 and run.actual.rho == 1.0
        gains = any(entry.what == "input_gain" for entry in run.actual.changes)
        if not (same and plain and not gains and isinstance(plant, MujocoPlant)):
            return None
        here, factor = plant.linearisation, after / before
        turned = replace(here, plant=here.plant.scaled(factor), ports=replace(here.ports, b=here.ports.b * factor))
        return replace(plant, linearisation=replace(turned, D=here.D * factor))

    @staticmethod
    def _bare(run: RunFile) -> Any:
        return run.assumed.model_copy(update={"delay": 0.0})

    @staticmethod
    def _bodies(run: RunFile) -> Any:
        return run.assumed, run.actual.model_copy(update={"delay": None})

    def _once(self, what: str, made_of: Any, make: Any) -> Any:
        if what not in self._known or self._known[what][0] != made_of:
            self._known[what] = made_of, make()
        return self._known[what][1]
