"""How long tests wait for what must come: so long that load makes none fail, and what hangs is still told."""

PATIENCE = 600.0  # s on the clock
