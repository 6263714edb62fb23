"""Pictures of sweeps, each drawn into axes from the rows alone."""

from icmj.report.maps.curve import draw_curve
from icmj.report.maps.plane import draw_basins, draw_sway, draw_validity

__all__ = ["draw_basins", "draw_curve", "draw_sway", "draw_validity"]
