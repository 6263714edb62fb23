"""A continuation parameter: a common name or a key of the run file, how its value is set, and the loops along it.

Each loop reuses the parts of the previous one that have not changed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, get_args

import numpy as np

from icmj.case.case import Case, expect_prediction
from icmj.case.designs import designed, parts_of
from icmj.case.plants import AnyPlant, actual_plant, assumed_plant, linear_plant
from icmj.cycle.return_map import PlantKind, ReturnMap
from icmj.engine.open_loop import OpenLoops
from icmj.engine.plant import MujocoPlant
from icmj.errors import CycleError
from icmj.plant.change import What
from icmj.runfile.schema import RunFile

KEYS = {
    "b": ("actual.gain",),
    "q_t": ("controller.q_t",),
    "delay": ("assumed.delay", "actual.delay"),
    "delta_min": ("controller.delta_min",),
    "rho": ("actual.rho",),
}
"""What the names stand for."""

_UNITS = {"delay": "s", "delta_min": "s"}  # that of q_t is the controller's
ROWS = 4800  # that the longest flight would keep; intervals last a twelfth to a fiftieth of it


def unit_of(name: str) -> str:
    """The unit of a parameter where it has one that is known."""
    return _UNITS.get(name, "")


def with_unit(name: str) -> str:
    """The name of a parameter, with its unit in brackets where it has one that is known."""
    return f"{name} ({_UNITS[name]})" if name in _UNITS else name


@dataclass(frozen=True)
class Parameter:
    """One number of a run file.

    Attributes:
        name: as it was asked for: one of :data:`KEYS`; a named change such as ``mass:trunk``, whose value is a factor;
            or a dotted key.
        keys: of the run file that take its value; none for a named change.
    """

    name: str
    keys: tuple[str, ...]

    def put(self, run: RunFile, value: float) -> RunFile:
        """The run file with this value.

        Raises:
            RunFileError: if it does not allow it.
        """
        if self.keys:
            return run.with_(**dict.fromkeys(self.keys, value))
        what, _, of = self.name.partition(":")
        changes = [entry.model_dump(exclude_none=True) for entry in run.actual.change]
        mine = {"what": what, **({"of": of} if of else {})}
        others = [entry for entry in changes if {k: entry.get(k) for k in mine} != mine or "value" in entry]
        return run.with_(**{"actual.change": [*others, {**mine, "factor": value}]})

    def value(self, run: RunFile) -> float:
        """The run file's own value.

        Raises:
            CycleError: if it has none, or not one number.
        """
        if not self.keys:
            what, _, of = self.name.partition(":")
            for entry in run.actual.change:
                if entry.what == what and (entry.of or "") == of and entry.factor is not None:
                    return float(entry.factor)
            return 1.0
        found: Any = run
        for part in self.keys[0].split("."):
            if not isinstance(found, dict) and not hasattr(found, part):
                raise CycleError(f"{run.path}: has no key {self.keys[0]!r} that is one number")
            found = found.get(part) if isinstance(found, dict) else getattr(found, part)
        if found is None:
            raise CycleError(f"{run.path}: does not set {self.name}; say where to begin, with --from")
        if isinstance(found, bool) or not isinstance(found, int | float):
            raise CycleError(f"{run.path}: {self.name} is {found!r} there; a parameter is one number")
        return float(found)


def parameter(name: str) -> Parameter:
    """The parameter of a name.

    Raises:
        CycleError: if there is none.
    """
    if name in KEYS:
        return Parameter(name, KEYS[name])
    if name.partition(":")[0] in get_args(What):
        return Parameter(name, ())
    if "." in name:
        return Parameter(name, (name,))
    known = ", ".join(KEYS)
    raise CycleError(
        f"no parameter {name!r}; expected one of {known}, a change such as mass:trunk, or a key such as design.R_c"
    )


class Family:
    """Return maps of a run file as a function of a parameter, without the prediction, which would cost time.

    Attributes:
        run, parameter, plant: what of.
        built: how many loops were built.
    """

    def __init__(
        self, run: RunFile, parameter: Parameter, plant: PlantKind = "mujoco", like: Case | None = None
    ) -> None:
        """Create the family; plants and design of the case ``like`` are reused."""
        self.run, self.parameter, self.plant = run, parameter, plant
        self.built = 0
        self.held = any(key.endswith(".delay") for key in parameter.keys)  # one z along the branch, whatever the delay
        self._loops = OpenLoops()
        self._known: dict[str, tuple[Any, Any]] = {}
        if like is not None and like.run == run and like.run.path == run.path:
            self._known = {
                "assumed": (self._bare(run), like.assumed),
                "actual": (self._bodies(run), like.actual),
                "design": ((self._bare(run), run.design), expect_prediction(like, "a branch").controller.design),
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
        self.built += 1
        assumed = self._assumed(run)
        actual: AnyPlant = self._once(
            "actual", self._bodies(run), lambda: self._regained(run) or actual_plant(run, assumed)
        )
        weights = (self._bare(run), run.design)
        design = self._once("design", weights, lambda: designed(assumed.linearisation.plant, run.design))
        controller = replace(run.intermittent.law(parts_of(run, assumed.linearisation.plant, design)), setpoint=None)
        settings = run.drawn().simulation.settings()
        if longest is not None:
            settings = replace(settings, duration=longest)
        if self.plant == "linear":
            return ReturnMap(linear_plant(actual, settings), controller, settings, held=self.held)
        if not isinstance(actual, MujocoPlant):
            raise CycleError(f"{run.path}: the actual plant is given by matrices; take the linear plant")
        every = np.inf if longest is None else longest / ROWS
        return ReturnMap(actual, controller, settings, every, self._loops, self.held)

    def _regained(self, run: RunFile) -> MujocoPlant | None:
        """The last actual plant with another input gain, if that is all that differs: its point and model stay."""
        if "actual" not in self._known:
            return None
        (assumed, actual), plant = self._known["actual"]
        before, after = actual.gain, run.actual.gain
        same = assumed == run.assumed and actual == run.actual.model_copy(update={"delay": None, "gain": before})
        plain = isinstance(before, float) and isinstance(after, float) and before != 0 and run.actual.rho == 1.0
        gains = any(entry.what == "input_gain" for entry in run.actual.change)
        if not (same and plain and not gains and isinstance(plant, MujocoPlant)):
            return None
        here, factor = plant.linearisation, after / before
        turned = replace(here, plant=here.plant.scaled(factor), ports=replace(here.ports, b=here.ports.b * factor))
        return replace(plant, linearisation=replace(turned, D=here.D * factor))

    def _assumed(self, run: RunFile) -> AnyPlant:
        plant: AnyPlant = self._once("assumed", self._bare(run), lambda: assumed_plant(run))
        return plant

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
