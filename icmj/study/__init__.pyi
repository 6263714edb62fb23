from .fit import Fit as Fit
from .fit import Subject as Subject
from .kind import Experiment as Experiment
from .kind import sample_rows as sample_rows

__all__: list[str]
