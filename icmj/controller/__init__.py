"""The controller as data: gains, hold, trigger, set-point, and the states that it runs with.

:mod:`icmj` has the controllers, rules and designs themselves. Here is what they are made of: the hybrid linear system
that every controller is (:class:`Realisation`, its parts, and :func:`parallel` for the sum of two), the faces of an
event rule, what a log keeps of a user's own controller or rule, and courses of a set-point in time (:func:`step`,
:func:`ramp`, :func:`sines`, :func:`double_steps`).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
