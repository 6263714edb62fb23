"""What there is to see of a run beside its prediction, as plain arrays; drawing them is for others."""
