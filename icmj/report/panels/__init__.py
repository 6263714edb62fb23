"""The shelf of panels: pictures of one case, each in a file of its own, and their list.

To add one, write a file here and enter its name below. The file defines ``PANEL``, a
:class:`icmj.report.panel.Panel`: a letter that no other has, a function that draws the figure from the runs of a case,
one that describes it in words, and one that says whether a case has it. What ``icmj.plots`` offers, too, is drawn by a
function of :mod:`icmj.report.axes`. Pages and the folders beside them show every panel that a case has.
"""

from icmj.base.catalogue import Catalogue

PANELS = Catalogue(
    __name__,
    (
        "modulus",
        "locus",
        "outputs_over_time",
        "phase_plane",
        "open_loop_intervals",
        "critical_mode",
        "acting_inputs",
        "centre_of_pressure",
        "hold_error",
    ),
)
"""The panels, by the names of their files, in the order of a page."""
