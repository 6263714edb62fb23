"""The former home of fits and of the identification; what is asked for here is found, with a warning."""

from __future__ import annotations

from icmj.base.catalogue import find_moved

_FITS = ("Bank", "Family", "TrialOf", "public_trials", "read_bank", "read_trials", "simulate_bank")
_MOVED = dict.fromkeys(_FITS, "icmj.fits") | dict.fromkeys(
    ("Identification", "Observed", "Unknown"), "icmj.identification"
)


def __getattr__(name: str) -> object:
    return find_moved(__name__, name, _MOVED)
