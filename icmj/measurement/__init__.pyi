from .measure import Definition as Definition
from .measure import Measure as Measure
from .measure import Number as Number
from .measure import Signal as Signal
from .measure import define_measure as define_measure
from .measurement import Measurement as Measurement
from .measures.stabilogram import Diffusion as Diffusion
from .measures.stabilogram import diffusion as diffusion
from .statistics import Modality as Modality
from .statistics import Statistics as Statistics
from .statistics import modality as modality
from .sway import Sway as Sway

__all__: list[str]
