from .interpolation import piecewise as piecewise

__all__: list[str]
