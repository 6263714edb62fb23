"""A continuation parameter: one number of a run file, by a common name or its key, and how its value is set."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, get_args

from icmj.errors import CycleError
from icmj.plant.body import What
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


def get_unit(name: str) -> str:
    """The unit of a parameter where it has one that is known."""
    return _UNITS.get(name, "")


def name_with_unit(name: str) -> str:
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
            for entry in run.actual.changes:
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


def find_parameter(name: str) -> Parameter:
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
