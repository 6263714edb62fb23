from .interpolation import piecewise as piecewise
from .reading import read_long_table as read_long_table

__all__: list[str]
