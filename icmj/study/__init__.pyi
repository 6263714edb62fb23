from .experiment import Experiment as Experiment
from .kind import Kind as Kind
from .kind import sample_rows as sample_rows

__all__: list[str]
