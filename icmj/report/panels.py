"""The panels of one case: the paper's six (a)–(f), and further ones."""

from __future__ import annotations

from icmj.report.hold_error_panel import HOLD_ERROR
from icmj.report.input_panel import ACTING
from icmj.report.interval_panel import INTERVALS
from icmj.report.loci import LOCUS, MODULUS
from icmj.report.mode_panel import MODES
from icmj.report.output_panel import OUTPUTS
from icmj.report.panel import Panel
from icmj.report.phase_panel import PHASE
from icmj.report.pressure_panel import PRESSURE

PANELS: tuple[Panel, ...] = (MODULUS, LOCUS, OUTPUTS, PHASE, INTERVALS, MODES)
"""The paper's, of every case, in the order of their letters."""
MORE: tuple[Panel, ...] = (ACTING, PRESSURE, HOLD_ERROR)
"""Those of cases that have what they show."""


__all__ = ["MORE", "PANELS", "Panel"]
