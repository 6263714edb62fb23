"""The model error that explains a motion: one number of a run file, from a log, times of events or samples."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
