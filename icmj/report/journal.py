"""Settings of matplotlib for figures in a journal: column width, font sizes, embedded TrueType fonts."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

from icmj.errors import ReportError
from icmj.report import style

COLUMNS = {1: 85.0, 1.5: 114.0, 2: 174.0}  # mm: widths that most journals accept
SHAPE = 0.66  # height of a figure over the width of one column


class Journal(dict[str, Any]):
    """Settings by the names of ``matplotlib.rcParams``; as a context manager, they hold within a ``with`` block."""

    def __init__(self, settings: dict[str, Any]) -> None:
        super().__init__(settings)
        self._open: list[AbstractContextManager[None]] = []

    def __enter__(self) -> Journal:
        import matplotlib

        settings: Any = dict(self)
        context: AbstractContextManager[None] = matplotlib.rc_context(settings)
        context.__enter__()
        self._open.append(context)
        return self

    def __exit__(self, *what: Any) -> None:
        self._open.pop().__exit__(*what)


def journal(columns: float, width: float | None, height: float | None, size: float, font: str) -> Journal:
    """The settings; see :func:`icmj.report.plots.style`."""
    if width is None and columns not in COLUMNS:
        raise ReportError(f"no figure is {columns:g} columns wide; expected 1, 1.5 or 2, or give a width [mm]")
    wide = COLUMNS[columns] if width is None else width
    high = SHAPE * min(wide, COLUMNS[1.5]) if height is None else height
    if not (0 < wide < 1e4 and 0 < high < 1e4 and 0 < size < 1e3):
        raise ReportError(f"a figure of {wide:g} by {high:g} mm in {size:g} pt; all must be positive")
    shipped = font == style.RC["font.family"]
    return Journal(
        {
            **style.RC,
            "font.family": font if shipped else [font, "DejaVu Sans"],
            "mathtext.fontset": "stix" if shipped else "stixsans",
            "font.size": size,
            "axes.labelsize": size,
            "axes.titlesize": size,
            "xtick.labelsize": 0.92 * size,
            "ytick.labelsize": 0.92 * size,
            "legend.fontsize": 0.9 * size,
            "figure.figsize": (wide * style.MM, high * style.MM),
            "figure.constrained_layout.use": True,
            "pdf.fonttype": 42,  # TrueType; many journals refuse Type 3
            "ps.fonttype": 42,
            "savefig.dpi": 600,
        }
    )
