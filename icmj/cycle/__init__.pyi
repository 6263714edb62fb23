from .branch import Branch as Branch
from .branch import SpecialPoint as SpecialPoint
from .branch import write_branch as write_branch
from .cycle import Cycle as Cycle

__all__: list[str]
