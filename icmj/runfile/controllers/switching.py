"""The tables of switched delayed feedback: of one position and rate, or of several channels.

Each is bounded by a line in a plane of its own (:mod:`icmj.controller.switching`, :mod:`icmj.controller.channels`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from icmj.base.array import MOST_ENTRIES, Finite, Numbers
from icmj.controller.channels import Channel, SwitchingChannels
from icmj.controller.law import Law
from icmj.controller.switching import SwitchingPD, compute_slope
from icmj.runfile.control_tables import ControllerTable, Parts
from icmj.runfile.table import TomlTable, keys_of, make


class SwitchedTable(TomlTable):
    """What bounds the region where feedback is off, in one plane."""

    share: Annotated[float, Field(gt=0, le=1)] | None = None
    """Share ρ of the plane in which feedback is on, instead of ``slope`` = −tan(π(ρ − ½)); 1 means everywhere."""

    @property
    def line(self) -> dict[str, Any]:
        """What ``share`` says instead of ``slope``, where it is given: the line, or that there is none."""
        if self.share is None:
            return {}
        return {"slope": 0.0, "switches": False} if self.share == 1 else {"slope": compute_slope(self.share)}

    @model_validator(mode="after")
    def _says_it_once(self) -> SwitchedTable:
        if self.share is not None and "slope" in self.model_fields_set:
            raise ValueError("give slope or share, not both")
        return self


@keys_of(Channel)
class SwitchingChannel(SwitchedTable):
    """One channel of a switching controller of several joints: for a joint, or for the virtual pendulum."""

    @property
    def channel(self) -> Channel:
        """The channel."""
        return make(Channel, self, **self.line)


@keys_of(SwitchingPD, without=("assumed", "delay"))
class Switching(SwitchedTable, ControllerTable):
    """Feedback of delayed outputs that is switched on and off in their state plane (Asai et al. 2009).

    Its delay is that of the plant: ``delay`` of ``[actual]``, or else of ``[assumed]``.
    """

    kind: Literal["switching"]
    """Kind of controller."""
    position: str
    rate: str
    P: Finite | Numbers
    D: Finite | Numbers

    @classmethod
    def takes(cls, data: Mapping[str, Any]) -> bool:
        return "channel" not in data

    def law(self, parts: Parts) -> Law:
        return make(SwitchingPD, self, assumed=parts.assumed, delay=parts.delay.t_d, **self.line)


class Channelled(ControllerTable):
    """Switched feedback for a body with several joints: each channel is switched in its own plane.

    Its delay is that of the plant: ``delay`` of ``[actual]``, or else of ``[assumed]``.
    """

    tag: ClassVar[str] = "channels"

    kind: Literal["switching"]
    """Kind of controller; it has channels instead of one position and rate."""
    channel: Annotated[list[SwitchingChannel], Field(min_length=1, max_length=MOST_ENTRIES)]
    """The channels, one ``[[controller.channel]]`` each."""

    def law(self, parts: Parts) -> Law:
        return SwitchingChannels(parts.assumed, tuple(each.channel for each in self.channel), parts.delay.t_d)


TABLES, LAWS = (Switching, Channelled), (SwitchingPD, Channel, SwitchingChannels)
