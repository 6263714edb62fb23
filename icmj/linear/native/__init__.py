"""The exact simulation in compiled code: what flight, watch and history do piece by piece in Python, in one loop.

The tests compare the two. A plan is one array of numbers, so that a call costs a microsecond and not one a matrix.
"""
