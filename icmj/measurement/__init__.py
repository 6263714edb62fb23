"""Measurement of the motion of a simulation, from its events."""
