from .open_loop import OpenLoop as OpenLoop
from .open_loop import OpenLoopInterval as OpenLoopInterval
from .pressure import Pressure as Pressure

__all__: list[str]
