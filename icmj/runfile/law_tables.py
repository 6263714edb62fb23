"""The tables of controllers that are not intermittent: ``[controller] kind`` says which one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from icmj.controller.delay import Delay
from icmj.controller.design import Design
from icmj.controller.law import Law
from icmj.controller.predictor import PredictorController
from icmj.controller.setpoint import Setpoint
from icmj.controller.switching import SwitchingPD, slope_of
from icmj.errors import RunFileError
from icmj.plant.linear_plant import LinearPlant
from icmj.runfile.control_tables import Control
from icmj.runfile.table import Finite, NonNegative, Numbers, Parameters, Reference, TomlTable
from icmj.work.own_code import Code, accepted


class Switching(TomlTable):
    """Feedback of delayed outputs that is switched on and off in their plane (Asai et al. 2009).

    Its delay is that of the plant: ``delay`` of ``[actual]``, or else of ``[assumed]``.
    """

    kind: Literal["switching"]
    """Says that this is the controller."""
    position: str
    """The output θ that it feeds back."""
    rate: str
    """The output θ' that it feeds back."""
    P: Finite | Numbers
    """Gain of the position: a number for all inputs, or one for each [input per output]."""
    D: Finite | Numbers
    """Gain of the rate, likewise."""
    slope: Finite = 0.0
    """Slope a of the line θ' = aθ that bounds, with θ = 0, where feedback is off [1/s]."""
    share: Annotated[float, Field(gt=0, le=1)] | None = None
    """Share ρ of the plane in which feedback is on, instead of ``slope`` = −tan(π(ρ − ½)); 1 is throughout."""
    dead_zone: NonNegative = 0.0
    """Size of (θ, θ') within which feedback is off."""
    switches: bool = True
    """Whether it is switched at all; false makes it the continuous delayed controller."""

    def law(self, assumed: LinearPlant, delay: float, code: Code) -> Law:
        """The controller for a plant and a delay [s].

        Raises:
            AnalysisError: if it does not fit the plant.
        """
        whole = self.share == 1
        slope = self.slope if self.share is None or whole else slope_of(self.share)
        return SwitchingPD(
            assumed, self.position, self.rate, self.P, self.D, delay, slope, self.dead_zone, self.switches and not whole
        )

    @model_validator(mode="after")
    def _says_it_once(self) -> Switching:
        if self.share is not None and "slope" in self.model_fields_set:
            raise ValueError("give slope or share, not both")
        return self


class Predictor(TomlTable):
    """The continuous predictor controller: observer, predictor over the delay and feedback, all the time.

    Its gains are those of ``[design]``, its delay is that of the plant, and its predictor goes by the assumed one.
    """

    kind: Literal["predictor"]
    """Says that this is the controller."""

    def predictor(self, design: Design, delay: Delay, setpoint: Setpoint | None) -> PredictorController:
        """The controller of a design.

        Raises:
            AnalysisError: if there is no delay, or one over which nothing can be predicted.
        """
        return PredictorController(design, delay, setpoint)


class OwnController(TomlTable):
    """Your own controller: the ``module:name`` of a class that inherits from ``icmj.Law``."""

    tag: ClassVar[str] = "own"

    kind: Reference
    """The class; it is given the assumed plant, its delay if it takes one, and the parameters."""
    parameters: Parameters = {}
    """Of the controller, by name."""

    def law(self, assumed: LinearPlant, delay: float, code: Code) -> Law:
        """The controller for a plant and a delay [s], made by ``code``.

        Raises:
            RunFileError: if it may not be made, cannot be, or is none.
        """
        given = accepted(code.named(self.kind), {"delay": delay})
        made = code.made(self.kind, assumed, **{**given, **self.parameters})
        if not isinstance(made, Law):
            raise RunFileError(f"controller.kind: {self.kind} makes a {type(made).__name__}; expected an icmj.Law")
        return made


def _kind(table: Any) -> str:
    kind = table.get("kind", "intermittent") if isinstance(table, Mapping) else getattr(table, "kind", "intermittent")
    return "own" if isinstance(kind, str) and ":" in kind else str(kind)


_KINDS = "kind must be 'intermittent', 'predictor', 'switching' or the module:name of a controller of your own"
AnyController = Annotated[
    Annotated[Control, Tag("intermittent")]
    | Annotated[Predictor, Tag("predictor")]
    | Annotated[Switching, Tag("switching")]
    | Annotated[OwnController, Tag("own")],
    Discriminator(_kind, custom_error_type="controller_kind", custom_error_message=_KINDS),
]
"""The controller of a run file, by its ``kind``."""
