"""Families of controllers fitted to recordings of standing people, and a model error identified from a motion."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
