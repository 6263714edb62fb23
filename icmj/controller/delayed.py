"""The former home of the controllers that are not intermittent; what is asked for here is found, with a warning."""

from __future__ import annotations

from icmj.base.catalogue import find_moved

_MOVED = {
    "PredictorController": "icmj.controller.predictor",
    "DelayedPID": "icmj.controller.delayed_pid",
    "SwitchingPD": "icmj.controller.switching",
    "ON": "icmj.controller.switching",
    "OFF": "icmj.controller.switching",
    "slope_of": "icmj.controller.switching",
    "Channel": "icmj.controller.channels",
    "SwitchingChannels": "icmj.controller.channels",
}  # where to


def __getattr__(name: str) -> object:
    return find_moved(__name__, name, _MOVED)
