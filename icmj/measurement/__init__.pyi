from .measurement import Measurement as Measurement
from .statistics import Modality as Modality
from .statistics import Statistics as Statistics
from .statistics import modality as modality
from .sway import Diffusion as Diffusion
from .sway import Sway as Sway
from .sway import diffusion as diffusion

__all__: list[str]
