"""A shape of the user's own: ``module:name`` of a function that draws the terms of a sum of sinusoids.

It is drawn once, when the case is prepared and the code may be run; from then on it is one of numbers, which a log
keeps, with the name of the function and the digest of its source.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from icmj.base.array import LARGEST
from icmj.errors import RunFileError
from icmj.runfile.messages import short
from icmj.runfile.place import PlaceTable
from icmj.runfile.shapes import kind_of_course
from icmj.runfile.table import OWN, Parameters, Reference, TomlTable, keys_of
from icmj.runfile.target import TargetTable
from icmj.simulation.sources import Sinusoids
from icmj.work.own_code import Code, digest_of, pick_accepted


class OwnCourse(TomlTable):
    """What code of your own makes: the ``module:name`` of a function that returns terms."""

    tag: ClassVar[str] = OWN
    rows: ClassVar[Mapping[int, str]] = {5: "(a, ω, φ, start, end)"}
    """What a row of numbers is that the function returns, by their count."""
    place: ClassVar[str] = "rate"
    """The key of a table of kind ``sinusoids`` to which the terms belong."""

    kind: Reference
    """The function; it receives the parameters, and ``duration`` [s] if it accepts one."""
    parameters: Parameters = {}
    """Parameters of the function, by name, its seed among them if it draws."""

    def resolve(self, code: Code, folder: Path, duration: float) -> dict[str, Any]:
        """The table of kind ``sinusoids`` with the terms that ``code`` makes, and where they come from.

        Raises:
            RunFileError: if the code may not be run, fails, or returns something else.
        """
        make = code.find(self.kind)
        told = code.make(self.kind, **{**pick_accepted(make, {"duration": duration}), **self.parameters})
        try:
            terms = np.atleast_2d(np.asarray(told, dtype=float))
        except (TypeError, ValueError):
            terms = np.zeros((0, 0))
        if terms.ndim != 2 or terms.shape[1] not in self.rows or not len(terms):
            raise RunFileError(f"{self.kind}: expected rows {' or '.join(self.rows.values())}, got {short(told)}")
        kept = self.model_dump(exclude={"kind", "parameters"}, exclude_unset=True, mode="json")
        made = {self.place: np.clip(terms, -LARGEST, LARGEST).tolist(), "made_by": self.kind, "sha256": digest_of(make)}
        return {**kept, "kind": kind_of_course(Sinusoids), **made}


@keys_of(Sinusoids, without=("terms",))
class OwnNoiseTable(OwnCourse, PlaceTable):
    """Noise from your own code: the ``module:name`` of a function that draws the terms of a sum of sinusoids."""

    rows: ClassVar[Mapping[int, str]] = {3: "(a, ω, φ)", **OwnCourse.rows}
    place: ClassVar[str] = "terms"

    def source(self) -> None:
        """Nothing before its code has drawn it (:meth:`resolve`)."""


class OwnSetpoint(OwnCourse, TargetTable):
    """A course from your own code: the ``module:name`` of a function that gives the terms of its rate.

    Such terms are made by the functions of :mod:`icmj.controller` that are named by a course, such as ``polygon``.
    """


DISTURBANCE, SETPOINT = OwnNoiseTable, OwnSetpoint
