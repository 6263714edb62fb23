"""What a simulation did, read from its events."""
