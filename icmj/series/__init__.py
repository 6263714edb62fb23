"""Time series with names and units: even times, and files of them (CSV, Parquet, npz). Knows nothing of control."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
