"""Every case on both plants, into logs, a report and a summary; sweeps, experiments and fits of many runs."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
