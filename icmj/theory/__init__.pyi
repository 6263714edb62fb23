from .delay_roots import DelayLoop as DelayLoop
from .delay_roots import delay_loop as delay_loop
from .delay_roots import rightmost_roots as rightmost_roots
from .delay_roots import stability_limit as stability_limit
from .error_system import ErrorSystem as ErrorSystem
from .predictor_roots import PredictorLoop as PredictorLoop
from .predictor_roots import predictor_loop as predictor_loop
from .spread import SmallNoise as SmallNoise
from .spread import Spread as Spread
from .spread import predict_spread as predict_spread
from .stationary_covariance import predictor_covariance as predictor_covariance

__all__: list[str]
