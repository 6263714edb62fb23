"""The former home of the experiment file; what is asked for here is found, with a warning."""

from __future__ import annotations

from icmj.base.catalogue import find_moved

_MOVED = {
    "ExperimentFile": "icmj.study.experiment_file",
}  # where to


def __getattr__(name: str) -> object:
    return find_moved(__name__, name, _MOVED)
