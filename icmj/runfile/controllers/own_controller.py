"""A controller of the user's own: ``module:name`` of a class that inherits from ``icmj.Law``."""

from __future__ import annotations

from typing import ClassVar

from icmj.controller.law import Law, expect_law
from icmj.errors import RunFileError
from icmj.runfile.control_tables import ControllerTable, Parts
from icmj.runfile.table import OWN, Parameters, Reference
from icmj.work.own_code import guard, pick_accepted


class OwnController(ControllerTable):
    """Your own controller: the ``module:name`` of a class that inherits from ``icmj.Law``."""

    tag: ClassVar[str] = OWN

    kind: Reference
    """The class; it receives the assumed plant, the delay if it accepts one, and the parameters."""
    parameters: Parameters = {}
    """Parameters of the controller, by name."""

    def law(self, parts: Parts) -> Law:
        given = pick_accepted(parts.code.find(self.kind), {"delay": parts.delay.t_d})
        made = parts.code.make(self.kind, parts.assumed, **{**given, **self.parameters})
        if not isinstance(made, Law):
            raise RunFileError(f"controller.kind: {self.kind} makes a {type(made).__name__}; expected an icmj.Law")
        with guard(self.kind):
            return expect_law(made, parts.assumed)


TABLES: tuple[type[ControllerTable], ...] = (OwnController,)
