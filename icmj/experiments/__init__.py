"""Experiments beyond one run, and the analyses of what they record.

Growth under a clock, the amplitude law, coexisting attractors and the rounds of switched control; batches of runs;
responses to multisines and of perturbed stance; quiet standing and the intersection point of ground forces; double
steps, reconstructed from a command, and refractoriness.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
