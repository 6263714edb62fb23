"""The tables of controllers that are not intermittent; ``[controller] kind`` selects one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from icmj.controller.channels import Channel, SwitchingChannels
from icmj.controller.delayed_pid import DelayedPID
from icmj.controller.law import Law
from icmj.controller.predictor import PredictorController
from icmj.controller.switching import SwitchingPD, slope_of
from icmj.errors import RunFileError
from icmj.runfile.control_tables import Control, ControllerTable, Parts
from icmj.runfile.table import MOST, Finite, NonNegative, Numbers, Parameters, Positive, Reference, TomlTable
from icmj.work.own_code import accepted

Share = Annotated[float, Field(gt=0, le=1)]
Combination = str | Annotated[dict[str, Finite], Field(min_length=1, max_length=MOST)]


class SwitchingChannel(TomlTable):
    """One channel of a switching controller of several joints: for a joint, or for the virtual pendulum."""

    position: Combination
    """Position that is fed back: an output θ, or weights of several outputs, ``{ ankle = 0.6, hip = 0.3 }``."""
    rate: Combination
    """Rate that is fed back: an output θ', or weights of several outputs by name."""
    P: Finite
    """Gain of the position [input per output]."""
    D: Finite
    """Gain of the rate [input per output]."""
    input: str = ""
    """Input that is commanded; may be left out if the plant has only one input."""
    slope: Finite = 0.0
    """Slope a of the line θ' = aθ that, together with θ = 0, bounds the region where feedback is off [1/s]."""
    share: Share | None = None
    """Share ρ of the plane in which feedback is on, instead of ``slope``; 1 means the whole plane."""
    dead_zone: NonNegative = 0.0
    """Size of (θ, θ') within which feedback is off."""
    switches: bool = True
    """Whether feedback is switched; if not, it is always on."""

    @property
    def channel(self) -> Channel:
        """The channel."""
        slope, switches = _line(self)
        return Channel(
            self.position, self.rate, self.P, self.D, self.input, slope, self.dead_zone, self.switches and switches
        )

    @model_validator(mode="after")
    def _says_it_once(self) -> SwitchingChannel:
        _once(self)
        return self


def _line(table: Switching | SwitchingChannel) -> tuple[float, bool]:
    """The slope that slope or share says, and whether there is a line at all."""
    if table.share == 1:
        return 0.0, False
    return (table.slope if table.share is None else slope_of(table.share)), True


def _once(table: Switching | SwitchingChannel) -> None:
    if table.share is not None and "slope" in table.model_fields_set:
        raise ValueError("give slope or share, not both")


class Switching(ControllerTable):
    """Feedback of delayed outputs that is switched on and off in their state plane (Asai et al. 2009).

    Its delay is that of the plant: ``delay`` of ``[actual]``, or else of ``[assumed]``.
    """

    kind: Literal["switching"]
    """Kind of controller."""
    position: str
    """Output θ that is fed back."""
    rate: str
    """Output θ' that is fed back."""
    P: Finite | Numbers
    """Gain of the position: one number for all inputs, or one for each input [input per output]."""
    D: Finite | Numbers
    """Gain of the rate: one number for all inputs, or one for each input [input per output]."""
    slope: Finite = 0.0
    """Slope a of the line θ' = aθ that, together with θ = 0, bounds the region where feedback is off [1/s]."""
    share: Share | None = None
    """Share ρ of the plane in which feedback is on, instead of ``slope`` = −tan(π(ρ − ½)); 1 means everywhere."""
    dead_zone: NonNegative = 0.0
    """Size of (θ, θ') within which feedback is off."""
    switches: bool = True
    """Whether feedback is switched; if not, this is the continuous delayed controller."""

    def law(self, parts: Parts) -> Law:
        """The controller for the assumed plant, with the actual delay.

        Raises:
            AnalysisError: if it does not fit the plant.
        """
        slope, switches = _line(self)
        return SwitchingPD(
            parts.assumed, self.position, self.rate, self.P, self.D, parts.delay.t_d, slope, self.dead_zone,
            self.switches and switches,
        )  # fmt: skip

    @model_validator(mode="after")
    def _says_it_once(self) -> Switching:
        _once(self)
        return self


class Channelled(ControllerTable):
    """Switched feedback for a body with several joints: each channel is switched in its own plane.

    Its delay is that of the plant: ``delay`` of ``[actual]``, or else of ``[assumed]``.
    """

    tag: ClassVar[str] = "channels"

    kind: Literal["switching"]
    """Kind of controller; it has channels instead of one position and rate."""
    channel: Annotated[list[SwitchingChannel], Field(min_length=1, max_length=MOST)]
    """The channels, one ``[[controller.channel]]`` each."""

    def law(self, parts: Parts) -> Law:
        """The controller for the assumed plant, with the actual delay.

        Raises:
            AnalysisError: if it does not fit the plant.
        """
        return SwitchingChannels(parts.assumed, tuple(each.channel for each in self.channel), parts.delay.t_d)


class DelayedPIDTable(ControllerTable):
    """Continuous delayed feedback, proportional, integral and derivative, with force feedback (Peterka's family).

    Its delay is that of the plant: ``delay`` of ``[actual]``, or else of ``[assumed]``.
    """

    kind: Literal["delayed-pid"]
    """Kind of controller."""
    position: str
    """Output θ that is fed back."""
    rate: str
    """Output θ' that is fed back."""
    P: Finite
    """Gain K_P of the position [input per output]."""
    D: Finite
    """Gain K_D of the rate [input per output]."""
    I: Finite = 0.0
    """Gain K_I of the integral [input per output and second]."""
    weight: Finite = 1.0
    """Sensory weight w of position and rate."""
    input: str = ""
    """Input that is commanded; may be left out if the plant has only one input."""
    force: str = ""
    """Output T that the force feedback G/(τs + 1) reads with the delay; by default the command itself."""
    force_gain: Finite = 0.0
    """Gain G of the force feedback [position per unit of T]. With 0 there is no force feedback."""
    force_time: Positive = 1.0
    """Time constant τ of the force feedback [s]."""

    def law(self, parts: Parts) -> Law:
        """The controller for the assumed plant, with the actual delay.

        Raises:
            AnalysisError: if it does not fit the plant.
        """
        given = self.model_dump(exclude={"kind"})
        return DelayedPID(parts.assumed, **given, delay=parts.delay.t_d)


class Predictor(ControllerTable):
    """The continuous predictor controller: observer, predictor over the delay, and feedback act continuously.

    Its gains are those of ``[design]``, its delay is that of the plant, and its predictor uses the assumed delay.
    """

    kind: Literal["predictor"]
    """Kind of controller."""

    follows: ClassVar[bool] = True

    def law(self, parts: Parts) -> Law:
        """The controller of the design.

        Raises:
            DesignError, AnalysisError: if the weights give none, or there is no delay, or one over which nothing can
                be predicted.
            RunFileError: if a file of the set-point cannot be read.
        """
        return PredictorController(parts.design(), parts.delay, parts.setpoint())


class OwnController(ControllerTable):
    """Your own controller: the ``module:name`` of a class that inherits from ``icmj.Law``."""

    tag: ClassVar[str] = "own"

    kind: Reference
    """The class; it receives the assumed plant, the delay if it accepts one, and the parameters."""
    parameters: Parameters = {}
    """Parameters of the controller, by name."""

    def law(self, parts: Parts) -> Law:
        """The controller for the assumed plant and, if it takes one, the actual delay.

        Raises:
            RunFileError: if it may not be made, cannot be, or is none.
        """
        given = accepted(parts.code.named(self.kind), {"delay": parts.delay.t_d})
        made = parts.code.made(self.kind, parts.assumed, **{**given, **self.parameters})
        if not isinstance(made, Law):
            raise RunFileError(f"controller.kind: {self.kind} makes a {type(made).__name__}; expected an icmj.Law")
        return made


def _kind(table: Any) -> str:
    kind = table.get("kind", "intermittent") if isinstance(table, Mapping) else getattr(table, "kind", "intermittent")
    if kind == "switching" and (isinstance(table, Channelled) or (isinstance(table, Mapping) and "channel" in table)):
        return "channels"
    return "own" if isinstance(kind, str) and ":" in kind else str(kind)


_KINDS = (
    "kind must be 'intermittent', 'predictor', 'switching', 'delayed-pid' or the module:name of a controller of your "
    "own"
)
AnyController = Annotated[
    Annotated[Control, Tag("intermittent")]
    | Annotated[Predictor, Tag("predictor")]
    | Annotated[Switching, Tag("switching")]
    | Annotated[Channelled, Tag("channels")]
    | Annotated[DelayedPIDTable, Tag("delayed-pid")]
    | Annotated[OwnController, Tag("own")],
    Discriminator(_kind, custom_error_type="controller_kind", custom_error_message=_KINDS),
]
"""The controller of a run file, by its ``kind``."""
