"""The paper's six panels (a)–(f) for one case, each a function from the case's runs to a matplotlib figure."""

from icmj.report.panels.eigenvalues import locus_panel, modulus_panel
from icmj.report.panels.modes import mode_panel
from icmj.report.panels.phase import phase_panel
from icmj.report.panels.time import interval_panel, output_panel

PANELS = {
    "a": modulus_panel,
    "b": locus_panel,
    "c": output_panel,
    "d": phase_panel,
    "e": interval_panel,
    "f": mode_panel,
}

__all__ = ["PANELS", "interval_panel", "locus_panel", "mode_panel", "modulus_panel", "output_panel", "phase_panel"]
