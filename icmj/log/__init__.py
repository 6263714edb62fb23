"""The rerun log of one simulation: written whole, read back bit-exact, replayed. Only this package imports rerun.

A log is an ordinary rerun recording with one timeline, ``time``, from the start of the run:

=================================  ===================================================================================
entity                             what
=================================  ===================================================================================
``__properties/...``               case, outcome, predicted, measured, relative_error, precision, provenance, run_file
``archive``                        the whole result bit for bit: JSON tree, flat arrays, SHA-256 (:func:`read_log`)
``summary``                        one page of Markdown
``outputs``, ``inputs``            ``run``, ``predicted`` orbit laid on the last event, ``continuous`` control (study)
``states``                         ``plant`` x, ``observer`` x_o, ``hold`` x_h
``trigger``                        ``E``: hold error / threshold, √(1 + E/threshold²); ``threshold``, ``events`` at 1
``interval``                       ``running`` since the last event, ``events`` Δ_i, ``delta_crit``
``modes``                          χ = V⁻¹x̄: ``critical``, ``others``, ±``gamma``, ``events``
``phase``                          every output against its rate, scaled to a frame
``scene/true``, ``magnified``      bodies and centre of mass; the second with the sway magnified
=================================  ===================================================================================

Series of a group are the columns of one entity, named by its static ``SeriesLines:names``.
"""

import lazy_loader

from icmj.errors import LogError
from icmj.work.provenance import expect_minor

expect_minor("rerun-sdk", "0.41", LogError)

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)  # rerun takes 0.4 s to import
