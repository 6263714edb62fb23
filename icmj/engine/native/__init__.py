"""The closed loop in compiled code: callbacks, the loop from event to event, extremes of outputs.

What it computes is :mod:`icmj.engine.reference`, statement by statement; the tests compare the two. Compiled functions
may call those of other modules of this folder: what is kept on disk is kept under the contents of all of them.
"""
