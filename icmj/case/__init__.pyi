from .comparison import Comparison as Comparison

__all__: list[str]
