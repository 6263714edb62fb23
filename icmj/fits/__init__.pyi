from .bank import Bank as Bank
from .bank import read_bank as read_bank
from .bank import simulate_bank as simulate_bank
from .family import Family as Family
from .fit import Fit as Fit
from .fit import Subject as Subject
from .recording_tables import public_trials as public_trials
from .recordings import TrialOf as TrialOf
from .recordings import read_trials as read_trials

__all__: list[str]
