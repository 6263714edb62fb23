"""What both simulators share, as data: settings, disturbances, starts, endings, and what a run yields. Runs nothing."""
