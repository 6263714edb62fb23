"""Processes that work for this one, and what a result was made with."""
