from .ending import OpenLoop as OpenLoop
from .ending import OpenLoopInterval as OpenLoopInterval
from .simulation import Pressure as Pressure

__all__: list[str]
