from .delay_roots import DelayLoop as DelayLoop
from .delay_roots import PredictorLoop as PredictorLoop
from .delay_roots import delay_loop as delay_loop
from .delay_roots import predictor_covariance as predictor_covariance
from .delay_roots import predictor_loop as predictor_loop
from .delay_roots import rightmost_roots as rightmost_roots
from .delay_roots import stability_limit as stability_limit
from .error_system import ErrorSystem as ErrorSystem
from .spread import SmallNoise as SmallNoise
from .spread import Spread as Spread
from .spread import predict_spread as predict_spread

__all__: list[str]
