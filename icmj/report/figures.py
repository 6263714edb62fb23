"""The former home of the figures of the report; what is asked for here is found, with a warning."""

from __future__ import annotations

from icmj.base.catalogue import find_moved

_MOVED = {
    "draw_histogram": "icmj.report.axes.noise",
    "draw_spectrum": "icmj.report.axes.noise",
    "draw_law": "icmj.report.axes.law",
    "Spectrum": "icmj.report.axes.eigenvalues",
    "draw_locus": "icmj.report.axes.eigenvalues",
    "draw_modulus": "icmj.report.axes.eigenvalues",
    "draw_scale": "icmj.report.axes.eigenvalues",
    "shown_locus": "icmj.report.axes.eigenvalues",
    "draw_diffusion": "icmj.report.sway_figures",
    "draw_path": "icmj.report.sway_figures",
    "draw_spectra": "icmj.report.sway_figures",
    "Rival": "icmj.report.sections.rival_controllers",
    "rivals": "icmj.report.sections.rival_controllers",
    "kind_in_words": "icmj.report.wording",
}  # where to


def __getattr__(name: str) -> object:
    return find_moved(__name__, name, _MOVED)
