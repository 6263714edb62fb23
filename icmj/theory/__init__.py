"""The linear theory: error system, eigenvalue crossings, orbit, return map, prediction. Imports no engine.

:func:`icmj.error_system` and :func:`icmj.predict` are where it begins. Here are the error system itself and loops with
a delay, of switched, delayed and predictor control: their characteristic roots, responses and stability limits; and the
spread of intervals under small noise.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
