"""Everything that touches MuJoCo: models, linearisation, callbacks, the closed loop, poses, forces on the ground."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
