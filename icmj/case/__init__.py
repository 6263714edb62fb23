"""The case: a run file made real, simulated on either plant, and compared with its prediction."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
