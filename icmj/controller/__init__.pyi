from .channels import Channel as Channel
from .controller import continuous_limit as continuous_limit
from .law import RecordedLaw as RecordedLaw
from .layout import Layout as Layout
from .realisation import Guard as Guard
from .realisation import Mode as Mode
from .realisation import Realisation as Realisation
from .realisation import parallel as parallel
from .rules.quadratic import as_weight as as_weight
from .setpoint import Setpoint as Setpoint
from .setpoint import polygon as polygon
from .setpoint import pulse as pulse
from .setpoint import ramp as ramp
from .setpoint import sines as sines
from .setpoint import step as step
from .setpoint import ternary as ternary
from .step_pairs import StepPairs as StepPairs
from .step_pairs import double_steps as double_steps
from .step_pairs import find_step_pairs as find_step_pairs
from .trigger import Faces as Faces
from .trigger import RecordedRule as RecordedRule
from .trigger import Trigger as Trigger

__all__: list[str]
