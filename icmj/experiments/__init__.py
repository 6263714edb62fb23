"""What is asked of a case beyond one run: growth under the clock, the amplitude law, coexisting attractors."""
