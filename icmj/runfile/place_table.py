"""The keys of a disturbance that say where it acts: on an input, a body, or by the support surface."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

from icmj.errors import SimulationError
from icmj.plant.push import ZERO
from icmj.runfile.table import Finite, TomlTable
from icmj.simulation.sources import On, Source
from icmj.simulation.surface import tilted

Vector = tuple[Finite, Finite, Finite]


class PlaceTable(TomlTable):
    """Where a disturbance acts: on an input, or at any point of any body of a model."""

    input: str | None = None
    """Name of the input that is disturbed; give either ``input`` or ``body``."""
    on: On | None = None
    """For an input: ``"body"`` acts on the body itself, 1 N m about a hinge whatever gain, gear and dynamics the
    actuator has, in the direction in which its length grows (default of impulses and steps); ``"command"`` is added to
    the command and passes through all these (default of noise)."""
    body: str | None = None
    """Name of the body that is pushed; needs a model."""
    force: Vector = ZERO
    """Force on the body in world axes, multiplied by ``size`` [N]."""
    torque: Vector = ZERO
    """Torque on the body in world axes, multiplied by ``size`` [N m]."""
    point: Vector | None = None
    """Point of application in the frame of the body [m] (default: its centre of mass). For a tilt, a point of its axis
    in the world (default: the origin)."""
    surface: Literal["translation", "tilt", "gravity", "turning"] | None = None
    """Instead of an input or body, the support surface moves: ``"translation"`` with an acceleration of this ``size``
    [m/s²], or ``"tilt"`` by an angle of this ``size`` [rad], of sums of sinusoids only. A tilt is ``"gravity"``, which
    turns by this angle, and ``"turning"`` with its angular acceleration [rad/s²]. Needs a model."""
    axis: Vector | None = None
    """Direction of a translation (default: x, forwards), or axis of a tilt (default: y; positive leans forwards)."""
    vertical: dict[str, Finite] = {}
    """Of a tilt: share of it that is added to the observer's reading of an output, by name: 0 (default) of an angle to
    the surface, as a joint senses it; 1 of an angle to the vertical."""
    vertical_rate: dict[str, Finite] = {}
    """The same of its rate, for outputs that are rates."""

    @property
    def placed(self) -> dict[str, Any]:
        """The keys of the place that are given, as :class:`icmj.simulation.sources.Placed` takes them."""
        if self.surface is not None:
            axis = self.axis or ((1.0, 0.0, 0.0) if self.surface == "translation" else (0.0, 1.0, 0.0))
            moves = "gravity" if self.surface == "tilt" else self.surface
            return {"surface": moves, "axis": axis, "point": self.point, "on": "body"}
        keys = ("on", "body", "force", "torque", "point")
        return {
            key: getattr(self, key) for key in keys if key in self.model_fields_set and getattr(self, key) is not None
        }

    def source(self) -> Source | None:
        """The source that it stands for; ``None`` before code of the user's own has drawn it."""
        raise NotImplementedError

    def sources(self) -> Iterator[Source]:
        """The sources that it stands for: of a tilt, the angle, its acceleration, and what is read of it.

        Raises:
            SimulationError: if they do not fit, or a tilt has no acceleration.
        """
        given = {"axis": any(self.axis or ()), "vertical": self.vertical, "vertical_rate": self.vertical_rate}
        of_surface = [key for key, there in given.items() if there]
        if of_surface and self.surface is None:
            raise SimulationError(f"{of_surface[0]} is of a motion of the support surface; give surface")
        if self.surface is not None and (self.on == "command" or any(self.force) or any(self.torque)):
            raise SimulationError("a command, force and torque are not of a motion of the support surface")
        found = self.source()
        if self.surface == "tilt" and found is not None:
            yield from tilted(found, self.vertical, self.vertical_rate, self.point)
        elif self.vertical or self.vertical_rate or (self.surface not in (None, "turning") and self.point):
            raise SimulationError("vertical and point are of a tilt of the support surface")
        elif found is not None:
            yield found

    def sized(self, size: float | None) -> float:
        """The size; 1 where force and torque are given and it is left out."""
        if size is None and self.body is None and self.surface is None:
            raise SimulationError("size is required")
        return 1.0 if size is None else size
