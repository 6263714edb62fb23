from . import plots as plots

__all__: list[str]
