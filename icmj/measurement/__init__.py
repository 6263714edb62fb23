"""Measurement of the motion of a simulation, from its events; statistics, diffusion and sway of any signal."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
