from .bank import Bank as Bank
from .bank import read_bank as read_bank
from .bank import simulate_bank as simulate_bank
from .family import Family as Family
from .identification import Identification as Identification
from .observed import Observed as Observed
from .recording_tables import public_trials as public_trials
from .recordings import TrialOf as TrialOf
from .recordings import read_trials as read_trials
from .unknown import Unknown as Unknown

__all__: list[str]
