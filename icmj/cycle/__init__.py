"""Exact cycles of the closed loop: found by Newton on the return map, continued in a parameter, stored."""
