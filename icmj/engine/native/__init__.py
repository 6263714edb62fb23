"""The closed loop on the engine, in compiled code.

Compiled functions may call those of other modules of this folder: what is kept on disk is kept under the contents of
all of them. With ``ICMJ_INTERPRETED=1`` the same source runs as plain Python (:mod:`icmj.base.compilation`).
"""
