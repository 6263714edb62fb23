"""The exact event-driven simulation of the intermittently controlled linear plant."""
