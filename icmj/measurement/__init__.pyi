from .measurement import Measurement as Measurement
from .stabilogram import Diffusion as Diffusion
from .stabilogram import diffusion as diffusion
from .statistics import Modality as Modality
from .statistics import Statistics as Statistics
from .statistics import modality as modality
from .sway import Sway as Sway

__all__: list[str]
