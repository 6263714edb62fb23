from .activation import Activation as Activation
from .body import Change as Change
from .body import OperatingRule as OperatingRule
from .body import Selection as Selection
from .linear_plant import Push as Push
from .quality import Notice as Notice
from .quality import Quality as Quality

__all__: list[str]
