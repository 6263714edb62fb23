"""Data shared by both simulators: settings, disturbances, starts, endings, and the result of a run."""
