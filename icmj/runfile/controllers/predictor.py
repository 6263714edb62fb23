"""The table of the continuous predictor controller (:mod:`icmj.controller.predictor`)."""

from __future__ import annotations

from typing import ClassVar, Literal

from icmj.controller.law import Law
from icmj.controller.predictor import PredictorController
from icmj.runfile.control_tables import ControllerTable, Parts


class Predictor(ControllerTable):
    """The continuous predictor controller: observer, predictor over the delay, and feedback act continuously.

    Its gains are those of ``[design]``, its delay is that of the plant, and its predictor uses the assumed delay.
    """

    kind: Literal["predictor"]
    """Kind of controller."""

    follows: ClassVar[bool] = True

    def law(self, parts: Parts) -> Law:
        return PredictorController(parts.design(), parts.delay, parts.setpoint())


TABLES, LAWS = (Predictor,), (PredictorController,)
