"""The tables of a run: how long and how it is simulated, what disturbs it, and what the study adds to it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, model_validator

from icmj.base.array import MOST_ENTRIES, Positive, Seed
from icmj.base.process import SWITCH
from icmj.runfile.shapes import SHAPES
from icmj.runfile.table import Reference, TomlTable, check_by, keys_of, make, one_of
from icmj.simulation.settings import Duration, Settings

if TYPE_CHECKING:
    from icmj.runfile.place import DisturbanceTable as SourceTable
else:
    SourceTable = one_of(SHAPES.collect("DISTURBANCE"))  # by its kind


@keys_of(Settings)
class SimulationTable(TomlTable):
    """Duration, initial state and accuracy of a run; see :class:`icmj.Settings`."""

    duration: Duration = 30.0
    disturbance: Annotated[list[SourceTable], Field(max_length=MOST_ENTRIES)] = []
    """Disturbances."""

    def settings(self) -> Settings:
        """The settings that it stands for.

        Raises:
            SimulationError: if they do not fit together.
        """
        return make(Settings, self, disturbance=tuple(one for table in self.disturbance for one in table.sources()))

    _fits_together = check_by("settings")

    @model_validator(mode="before")
    @classmethod
    def _of_older_files(cls, data: Any) -> Any:
        """Accepts ``native = true`` of older files; it has no effect any more."""
        if isinstance(data, dict) and "native" in data:
            if data["native"] is not True:
                raise ValueError(f"native = {str(data['native']).lower()} is no longer a key: {SWITCH}")
            return {key: value for key, value in data.items() if key != "native"}
        return data


class StudyTable(TomlTable):
    """Further results that the study adds to one run, and measures of every run.

    The study, and ``icmj run --study``, add clock-driven points for panel (a), the amplitude law, and a search for
    attractors from random starts.
    """

    growth_points: Annotated[int, Field(ge=0, le=200)] = 8
    """Number of clock-driven simulations in panel (a) of the report."""
    law_q_t: Annotated[list[Positive], Field(max_length=MOST_ENTRIES)] = []
    """Thresholds of the amplitude law, at least two [unit of ``controller.q_t``]."""
    attractor_starts: Annotated[int, Field(ge=0, le=1000)] = 0
    """Number of random starts in the search for other attractors."""
    seed: Seed = 0
    """Seed of these starts."""
    magnification: Positive = 10.0
    """Magnification of the sway in the second body of the viewer."""
    measures: Annotated[list[Reference], Field(max_length=MOST_ENTRIES)] = []
    """Further measures: the ``module:name`` of functions that take a simulation and return numbers by name."""
