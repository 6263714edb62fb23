"""Studies, sweeps and experiments: many runs, from files to results."""

import lazy_loader

from icmj.base.catalogue import find_moved

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
_MOVED = {"Fit": "icmj.fits", "Subject": "icmj.fits"}


def __getattr__(name: str) -> object:
    return find_moved(__name__, name, _MOVED) if name in _MOVED else _load(name)
