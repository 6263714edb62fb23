"""The shelf of shapes: courses of a signal over time, each in a file of its own, and their list.

To add one, write a file here and enter its name below. The file defines ``DISTURBANCE``, ``SETPOINT`` or both: the
table of a run file whose ``kind`` selects it. That of a disturbance inherits from
:class:`icmj.runfile.place.PlaceTable` and says in ``source`` of what sources of :mod:`icmj.simulation.settings` it is
made; that of a set-point inherits from :class:`icmj.runfile.target.TargetTable` and gives the ``terms`` of its rate.
Keys that are those of a dataclass come from it (:func:`icmj.runfile.table.keys_of`); each other key has its meaning
under it. Help, messages, JSON Schema and reference follow from these tables.
"""

from collections.abc import Callable
from typing import Any

from icmj.base.catalogue import Catalogue

SHAPES = Catalogue(
    __name__,
    (
        "impulse",
        "step",
        "pulse",
        "noise",
        "gaussian",
        "bias",
        "sinusoids",
        "sines",
        "ternary",
        "ramp",
        "sampled",
        "double_steps",
        "file",
        "own_shape",
    ),
)
"""The shapes, by the names of their files."""


def kind_of_course(course: Callable[..., Any]) -> str:
    """The kind by which a run file selects the shape of this class of sources, or of this function that makes terms."""
    return course.__name__.lower().replace("_", "-")
