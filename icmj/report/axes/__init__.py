"""What is drawn of one case into axes that are given, a file for each subject; ``icmj.plots`` makes it public.

Panels and sections of the report put these axes into figures, with captions.
"""

LAST_INTERVALS = 8
"""Intervals at the end of a run that are drawn where a whole run would be a tangle."""
LEAST_ERROR = 1e-16
"""Relative error that is drawn of what agrees to the last digit."""
