"""The case: a run file made real, and simulated on either plant; and the comparison of a run with its prediction."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
