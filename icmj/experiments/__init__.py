"""Experiments beyond one run: growth under a clock, the amplitude law, coexisting attractors."""
