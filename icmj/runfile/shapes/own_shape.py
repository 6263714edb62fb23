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
from icmj.runfile.table import OWN, Parameters, Reference, keys_of
from icmj.runfile.target import TargetTable
from icmj.simulation.sources import Sinusoids
from icmj.work.own_code import Code, digest_of, pick_accepted


@keys_of(Sinusoids, without=("terms",))
class OwnNoiseTable(PlaceTable):
    """Noise from your own code: the ``module:name`` of a function that draws the terms of a sum of sinusoids."""

    tag: ClassVar[str] = OWN

    kind: Reference
    """The function; it receives the parameters, and ``duration`` [s] if it accepts one."""
    parameters: Parameters = {}
    """Parameters of the function, by name, including its seed."""

    def source(self) -> None:
        """Nothing before its code has drawn it (:meth:`drawn`)."""

    def resolve(self, code: Code, folder: Path, duration: float) -> dict[str, Any]:
        """The table of kind ``sinusoids`` with the terms that ``code`` draws."""
        rows = {3: "(a, ω, φ)", 5: "(a, ω, φ, start, end)"}
        terms, origin = _draw(code, self.kind, self.parameters, duration, rows)
        kept = self.model_dump(exclude={"kind", "parameters"}, exclude_unset=True, mode="json")
        return {**kept, "kind": kind_of_course(Sinusoids), "terms": terms, **origin}


class OwnSetpoint(TargetTable):
    """A course from your own code: the ``module:name`` of a function that gives the terms of its rate.

    Such terms are made by the functions of :mod:`icmj.controller` that are named by a course, such as ``polygon``.
    """

    tag: ClassVar[str] = OWN

    kind: Reference
    """The function; it receives the parameters, and ``duration`` [s] if it accepts one."""
    parameters: Parameters = {}
    """Parameters of the function, by name."""

    def resolve(self, code: Code, folder: Path, duration: float) -> dict[str, Any]:
        """The table of kind ``sinusoids`` with the terms that ``code`` gives."""
        terms, origin = _draw(code, self.kind, self.parameters, duration, {5: "(a, ω, φ, start, end)"})
        kept = self.model_dump(exclude={"kind", "parameters"}, exclude_unset=True, mode="json")
        return {**kept, "kind": kind_of_course(Sinusoids), "rate": terms, **origin}


def _draw(
    code: Code, reference: str, parameters: Mapping[str, Any], duration: float, rows: Mapping[int, str]
) -> tuple[list[list[float]], dict[str, str]]:
    """The terms that a function returns, and where they come from, as the keys ``made_by`` and ``sha256``.

    Args:
        code: finds the function, if it may be run.
        reference: ``module:name`` of it.
        parameters: its parameters by name.
        duration: of the run [s], which it gets if it accepts one.
        rows: what a row of numbers is, by their count.

    Raises:
        RunFileError: if the code may not be run, fails, or returns something else.
    """
    make = code.find(reference)
    told = code.make(reference, **{**pick_accepted(make, {"duration": duration}), **parameters})
    try:
        terms = np.atleast_2d(np.asarray(told, dtype=float))
    except (TypeError, ValueError):
        terms = np.zeros((0, 0))
    if terms.ndim != 2 or terms.shape[1] not in rows or not len(terms):
        raise RunFileError(f"{reference}: expected rows {' or '.join(rows.values())}, got {short(told)}")
    return np.clip(terms, -LARGEST, LARGEST).tolist(), {"made_by": reference, "sha256": digest_of(make)}


DISTURBANCE, SETPOINT = OwnNoiseTable, OwnSetpoint
