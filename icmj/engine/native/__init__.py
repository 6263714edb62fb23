"""The closed loop, compiled: callbacks, the loops from event to event, extremes of outputs.

Compiled functions may call those of other modules of this folder: what is kept on disk is kept under the contents of
all of them. With ``ICMJ_INTERPRETED=1`` the same source runs as plain Python (:mod:`icmj.base.compilation`).
"""
