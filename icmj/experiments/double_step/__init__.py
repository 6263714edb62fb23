"""The double-step experiment: pairs of steps, when they were responded to, and what kind of controller does that."""
