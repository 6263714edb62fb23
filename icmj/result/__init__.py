"""Everything one log holds, as data. Runs nothing."""
