"""The shelf of sections of the report: each in a file of its own, and their list.

To add one, write a file here and enter its name below. The file defines ``compose``, a function of the
:class:`icmj.report.material.Material` of a report, which returns a :class:`icmj.report.section.Section`, heading,
template and what it prints, or ``None`` where the report has nothing for it. If figures of single cases stand in it,
the file defines ``list_drawings``, too, a function of a case, so that the figures of cases are drawn side by side.
Numbers of tables and figures are given by ``next_table()`` and ``next_figure()`` in templates.
"""

from icmj.base.catalogue import Catalogue

SECTIONS = Catalogue(
    __name__,
    (
        "summary_table",
        "paper_statements",
        "case_panels",
        "noise_statistics",
        "amplitude_law",
        "coexisting_attractors",
        "swept_maps",
        "cycle_branches",
        "rival_controllers",
        "other_controllers",
        "design_matrices",
        "run_settings",
    ),
)
"""The sections, by the names of their files, in the order of a page."""
