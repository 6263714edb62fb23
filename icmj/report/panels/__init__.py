"""The paper's six panels (a)–(f) of one case."""

from icmj.report.panels.eigenvalues import LOCUS, MODULUS
from icmj.report.panels.modes import MODES
from icmj.report.panels.panel import Panel
from icmj.report.panels.phase import PHASE
from icmj.report.panels.time import INTERVALS, OUTPUTS

PANELS: tuple[Panel, ...] = (MODULUS, LOCUS, OUTPUTS, PHASE, INTERVALS, MODES)
"""Every panel, in the order of their letters."""

__all__ = ["PANELS", "Panel"]
