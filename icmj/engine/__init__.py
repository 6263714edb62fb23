"""Everything that touches MuJoCo: models, linearisation, callbacks, the closed loop, poses, forces on the ground."""

import lazy_loader

from icmj.base.process import INTERPRETED
from icmj.errors import ModelError
from icmj.work.provenance import expect_minor

if not INTERPRETED:  # the compiled code knows the structs of this version
    expect_minor("mujoco", "4.0", ModelError)

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
