"""The former home of the summary of the report; what is asked for here is found, with a warning."""

from __future__ import annotations

from icmj.base.catalogue import find_moved

_MOVED = {
    "abstract": "icmj.report.abstract",
    "agrees_with_paper": "icmj.report.sections.summary_table",
    "critical": "icmj.report.sections.summary_table",
    "draw_errors": "icmj.report.overview",
    "draw_intervals": "icmj.report.overview",
    "overview_figure": "icmj.report.overview",
    "estimate": "icmj.report.sections.noise_statistics",
    "is_noisy": "icmj.report.case_runs",
}  # where to


def __getattr__(name: str) -> object:
    return find_moved(__name__, name, _MOVED)
