"""The exact simulation of the linear plant in compiled code."""
