"""The tables of a run: how it is simulated, and what the study adds."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, model_validator

from icmj.base.environment import SWITCH
from icmj.errors import SimulationError
from icmj.runfile.source_tables import SourceTable
from icmj.runfile.table import (
    MOST,
    Finite,
    Positive,
    Reference,
    TomlTable,
)
from icmj.simulation.settings import Integrator, Settings

SHORTEST = 1e-6  # s
LONGEST = 1e9  # s, thirty years: the viewer counts nanoseconds in 64 bits


class SimulationTable(TomlTable):
    """Duration, initial state and accuracy of a run; see :class:`icmj.simulation.Settings`."""

    duration: Annotated[Positive, Field(ge=SHORTEST, le=LONGEST)] = 30.0
    """Duration of the run [s]."""
    initial: dict[str, Finite] = {}
    """Initial deviations of plant states from the operating point, by name; the others are zero."""
    observer: dict[str, Finite] = {}
    """Initial states of the observer, by name; the others are zero."""
    timestep: Positive | None = None
    """Timestep in MuJoCo, instead of a tolerance [s]. The linear plant needs none."""
    integrator: Integrator | None = None
    """Integrator in MuJoCo (default: that of the model)."""
    record_interval: Positive = 0.01
    """Time between recorded rows [s], which are at its multiples. Events are always recorded."""
    limit: Positive | dict[str, Positive] | None = None
    """Deviation of a position at which the run counts as fallen: one number for all [rad or m, converted to other units
    of angle or length], or positions by name, each in its own unit. Default: 1 rad or 1 m; in plants given by matrices,
    positions with other units have no limit."""
    disturbance: Annotated[list[SourceTable], Field(max_length=MOST)] = []
    """Disturbances."""
    tolerance: Positive | None = None
    """Relative error of an open-loop interval to which the steps in MuJoCo are adapted. Default, if neither
    timestep nor integrator is given: 10⁻⁸ if no contact, friction or limit can act; else the timestep of the model."""

    def settings(self) -> Settings:
        """The settings that it stands for.

        Raises:
            SimulationError: if they do not fit together.
        """
        plain = {name: getattr(self, name) for name in type(self).model_fields}
        return Settings(**plain | {"disturbance": tuple(one for table in self.disturbance for one in table.sources())})

    @model_validator(mode="before")
    @classmethod
    def _of_older_files(cls, data: Any) -> Any:
        """Accepts ``native = true`` of older files; it has no effect any more."""
        if isinstance(data, dict) and "native" in data:
            if data["native"] is not True:
                raise ValueError(f"native = {str(data['native']).lower()} is no longer a key: {SWITCH}")
            return {key: value for key, value in data.items() if key != "native"}
        return data

    @model_validator(mode="after")
    def _fits_together(self) -> SimulationTable:
        try:
            self.settings()
        except SimulationError as error:
            raise ValueError(str(error)) from error
        return self


class StudyTable(TomlTable):
    """Further results that the study adds to one run, and measures of every run.

    The study, and ``icmj run --study``, add clock-driven points for panel (a), the amplitude law, and a search for
    attractors from random starts.
    """

    growth_points: Annotated[int, Field(ge=0, le=200)] = 8
    """Number of clock-driven simulations in panel (a) of the report."""
    law_q_t: Annotated[list[Positive], Field(max_length=MOST)] = []
    """Thresholds of the amplitude law, at least two [unit of ``controller.q_t``]."""
    attractor_starts: Annotated[int, Field(ge=0, le=1000)] = 0
    """Number of random starts in the search for other attractors."""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    """Seed of these starts."""
    magnification: Positive = 10.0
    """Magnification of the sway in the second body of the viewer."""
    measures: Annotated[list[Reference], Field(max_length=MOST)] = []
    """Further measures: the ``module:name`` of functions that take a simulation and return numbers by name."""
