"""The panels of one case: the paper's six (a)–(f), and further ones."""

from icmj.report.panels.eigenvalues import LOCUS, MODULUS
from icmj.report.panels.ground import ACTING, PRESSURE
from icmj.report.panels.modes import MODES
from icmj.report.panels.panel import Panel
from icmj.report.panels.phase import PHASE
from icmj.report.panels.time import INTERVALS, OUTPUTS

PANELS: tuple[Panel, ...] = (MODULUS, LOCUS, OUTPUTS, PHASE, INTERVALS, MODES)
"""The paper's, of every case, in the order of their letters."""
MORE: tuple[Panel, ...] = (ACTING, PRESSURE)
"""Those of cases that have what they show."""

__all__ = ["MORE", "PANELS", "Panel"]
