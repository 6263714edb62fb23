"""The case: a run file made real, and simulated on either plant."""
