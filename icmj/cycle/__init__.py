"""Exact cycles of the closed loop: found by Newton on the return map, continued in a parameter, stored."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
