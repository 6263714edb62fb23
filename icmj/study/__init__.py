"""Every case on both plants, into logs, a report and a summary; sweeps and experiments of many runs."""

import lazy_loader

from icmj.base.catalogue import find_moved

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
_MOVED = {"Fit": "icmj.fits", "Subject": "icmj.fits"}


def __getattr__(name: str) -> object:
    return find_moved(__name__, name, _MOVED) if name in _MOVED else _load(name)
