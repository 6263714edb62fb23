"""The linear plant as data.

The body that a model is of, changes of it, and notices of what is doubtful belong to it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
