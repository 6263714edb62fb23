"""What every disturbance of a run file shares: the place where it acts, and what it is made of.

It acts on an input or its command, at a point of a body, by a motion of the support surface, or on an output as the
observer reads it. Its course over time is its shape, of the shelf :mod:`icmj.runfile.shapes`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar, cast

from icmj.base.array import Finite
from icmj.errors import SimulationError
from icmj.plant.linear_plant import ZERO
from icmj.runfile.table import LISTED, TomlTable, make
from icmj.simulation.sources import On, Source
from icmj.simulation.tilt import make_tilt_sources
from icmj.work.own_code import Code

Kind = TypeVar("Kind", bound=Source)
Vector = Annotated[tuple[Finite, Finite, Finite], LISTED]


class DisturbanceTable(TomlTable):
    """A disturbance of any kind."""

    kind: str
    """Kind of the disturbance."""

    unknown_size: ClassVar[bool] = False
    """Whether a first family file takes its size for unknown."""

    def sources(self) -> Iterator[Source]:
        """The sources that it stands for.

        Raises:
            SimulationError: if they do not fit.
        """
        raise NotImplementedError

    @property
    def files(self) -> tuple[str, ...]:
        """The files that it reads, relative to the run file."""
        return ()

    def resolve(self, code: Code, folder: Path, duration: float) -> dict[str, Any] | None:
        """The same as numbers alone, for a run of ``duration`` [s] whose run file lies in ``folder``.

        ``None`` if it is made of numbers as it is; else the table of another kind, which a log keeps.

        Raises:
            RunFileError: if the code may not be run, fails, or draws nothing, or a file cannot be read.
        """
        return None


class PlaceTable(DisturbanceTable):
    """The place at which a disturbance acts: an input, any point of any body of a model, or the support surface."""

    input: str | None = None
    """Name of the input that is disturbed; give either ``input`` or ``body``."""
    on: On | None = None
    """For an input: with ``"body"``, the disturbance acts on the body itself, in the direction in which the length of
    the actuator increases, independent of its gain, gear and dynamics: 1 N m about a hinge (default for impulses and
    steps). With ``"command"``, it is added to the command, before gain, gear and dynamics (default for noise)."""
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
    [m/s²], or ``"tilt"`` by an angle of this ``size`` [rad], which must be a sum of sinusoids. A tilt consists of
    ``"gravity"``, whose direction turns by this angle, and ``"turning"`` with its angular acceleration [rad/s²]. Needs
    a model."""
    axis: Vector | None = None
    """Direction of a translation (default: x, forwards), or axis of a tilt (default: y; positive angles tilt the
    surface forwards)."""
    vertical: dict[str, Finite] = {}
    """For a tilt: share of the tilt that is added to the observer's reading of an output, by name: 0 (default) for an
    angle to the surface, as joint receptors sense it; 1 for an angle to the vertical."""
    vertical_rate: dict[str, Finite] = {}
    """The same share of the rate of the tilt, for outputs that are rates."""

    def source(self) -> Source | None:
        """The source that it stands for; ``None`` before code of the user's own has drawn it."""
        return self.make_source(
            cast(Callable[..., Source], self.setting), **({"size": self.full_size} if hasattr(self, "size") else {})
        )

    def make_source(self, source: Callable[..., Kind], **more: Any) -> Kind:
        """The source of this class that acts at this place, with its keys that the table has and ``more``."""
        if self.surface is not None:
            axis = self.axis or ((1.0, 0.0, 0.0) if self.surface == "translation" else (0.0, 1.0, 0.0))
            moves = "gravity" if self.surface == "tilt" else self.surface
            more |= {"surface": moves, "axis": axis, "on": "body", "body": None}
        return make(source, self, **more)

    def sources(self) -> Iterator[Source]:
        """The sources that it stands for: of a tilt, the angle, its acceleration, and what is read of it.

        Raises:
            SimulationError: if they do not fit, or a tilt has no acceleration.
        """
        given = {"axis": any(self.axis or ()), "vertical": self.vertical, "vertical_rate": self.vertical_rate}
        of_surface = [key for key, there in given.items() if there]
        if of_surface and self.surface is None:
            raise SimulationError(f"{of_surface[0]} belongs to a motion of the support surface; give surface, too")
        if self.surface is not None and (self.on == "command" or any(self.force) or any(self.torque)):
            raise SimulationError("command, force and torque do not apply to a motion of the support surface")
        found = self.source()
        if self.surface == "tilt" and found is not None:
            yield from make_tilt_sources(found, self.vertical, self.vertical_rate, self.point)
        elif self.vertical or self.vertical_rate or (self.surface not in (None, "turning") and self.point):
            raise SimulationError("vertical and point apply only to a tilt of the support surface")
        elif found is not None:
            yield found

    @property
    def full_size(self) -> float:
        """The size; 1 where force and torque are given and it is left out."""
        size: float | None = getattr(self, "size", None)
        if size is None and self.body is None and self.surface is None:
            raise SimulationError("size is required")
        return 1.0 if size is None else size
