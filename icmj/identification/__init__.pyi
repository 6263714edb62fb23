from .identification import Identification as Identification
from .observed import Observed as Observed
from .unknown import Unknown as Unknown

__all__: list[str]
