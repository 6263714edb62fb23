"""The table of delayed proportional, integral and derivative feedback (:mod:`icmj.controller.delayed_pid`)."""

from __future__ import annotations

from typing import Literal

from icmj.controller.delayed_pid import DelayedPID
from icmj.controller.law import Law
from icmj.runfile.control_tables import ControllerTable, Parts
from icmj.runfile.table import keys_of, make


@keys_of(DelayedPID, without=("assumed", "delay"))
class DelayedPIDTable(ControllerTable):
    """Continuous delayed feedback, proportional, integral and derivative, with force feedback (Peterka's family).

    Its delay is that of the plant: ``delay`` of ``[actual]``, or else of ``[assumed]``.
    """

    kind: Literal["delayed-pid"]
    """Kind of controller."""

    def law(self, parts: Parts) -> Law:
        return make(DelayedPID, self, assumed=parts.assumed, delay=parts.delay.t_d)


TABLES, LAWS = (DelayedPIDTable,), (DelayedPID,)
