from .accuracy import choose_timestep as choose_timestep
from .reaction import Reaction as Reaction
from .reaction import centre_of_pressure as centre_of_pressure
from .reaction import ground_force as ground_force

__all__: list[str]
