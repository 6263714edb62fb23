"""The style of figures: one size, one typeface, colours that colour-blind readers can distinguish (Okabe–Ito); for a
journal its column's width and fonts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from io import BytesIO
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from icmj.base.text import one_line
from icmj.errors import ReportError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


MM = 1 / 25.4
WIDTH = 85.0  # mm: one column of a journal page
HEIGHT = 58.0
MIDDLE = 70.0  # panels with a strip beneath
TALL = 84.0  # mm: panels that stack one axes for each output
CROWDED = 45  # events in one axes beyond which their lines and marks are drawn smaller

# Where curves coincide, the later is thinner, so that each stays visible: predicted, linear, MuJoCo.
PREDICTED: dict[str, Any] = {"color": "#d9d4c3", "linewidth": 4.0, "solid_capstyle": "round"}
LINEAR: dict[str, Any] = {"color": "#56b4e9", "linewidth": 1.9}
MUJOCO: dict[str, Any] = {"color": "#a03c00", "linewidth": 0.75}
CONTINUOUS: dict[str, Any] = {"color": "#007a55", "linewidth": 0.9, "linestyle": (0, (5, 1.5))}
EXACT: dict[str, Any] = {"color": "#007a55", "linewidth": 1.1, "linestyle": (0, (5, 1.5))}
ACTUAL: dict[str, Any] = {"color": "#0072b2", "linewidth": 1.4}
CRITICAL: dict[str, Any] = {"color": "#222222", "linewidth": 0.9, "linestyle": (0, (1, 1.6))}
EVENT: dict[str, Any] = {"colors": "#8a8a8a", "linestyles": [(0, (1, 2.2))]}
BAND: dict[str, Any] = {"color": "#e9e5d8", "linewidth": 0, "zorder": 0.3}
RUN = {"linear": LINEAR, "mujoco": MUJOCO}
MARK: dict[str, dict[str, Any]] = {
    "linear": {"marker": "o", "markersize": 5.2, "markerfacecolor": "#56b4e9", "markeredgecolor": "#1f7fb8"},
    "mujoco": {"marker": "x", "markersize": 4.0, "markeredgecolor": "#a03c00", "markeredgewidth": 1.0},
}
EIGENVALUE: dict[str, Any] = {
    "marker": "o",
    "linestyle": "none",
    "markersize": 3.6,
    "markerfacecolor": "white",
    "markeredgecolor": "#222222",
    "markeredgewidth": 0.8,
    "zorder": 4,
}
CRITICAL_EIGENVALUE: dict[str, Any] = {
    "marker": "D",
    "linestyle": "none",
    "markersize": 5,
    "markerfacecolor": "#d55e00",
    "markeredgecolor": "white",
    "markeredgewidth": 0.6,
    "zorder": 5,
}
NAME = {"linear": "linear", "mujoco": "MuJoCo"}

RC: Any = {
    "font.family": "STIXGeneral",  # shipped with matplotlib, so the page looks the same on every machine
    "mathtext.fontset": "stix",
    "font.size": 8.5,
    "axes.labelsize": 8.5,
    "axes.titlesize": 8.5,
    "xtick.labelsize": 7.8,
    "ytick.labelsize": 7.8,
    "legend.fontsize": 7.6,
    "axes.linewidth": 0.55,
    "axes.edgecolor": "#333333",
    "axes.labelcolor": "#111111",
    "axes.labelpad": 2.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.unicode_minus": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 5),
    "xtick.direction": "out",
    "ytick.direction": "out",
    "xtick.major.size": 2.4,
    "ytick.major.size": 2.4,
    "xtick.minor.size": 1.4,
    "ytick.minor.size": 1.4,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "xtick.major.pad": 2.0,
    "ytick.major.pad": 2.0,
    "lines.solid_joinstyle": "round",
    "axes.prop_cycle": "cycler('color', ['0072b2', 'd55e00', '007a55', 'cc79a7', '56b4e9', 'e69f00'])",  # Okabe–Ito
    "legend.frameon": False,
    "legend.handlelength": 1.9,
    "legend.handletextpad": 0.5,
    "legend.columnspacing": 1.1,
    "legend.borderaxespad": 0.1,
    "legend.labelspacing": 0.25,
    "path.simplify": True,
    "path.simplify_threshold": 0.12,
    "svg.fonttype": "path",
    "svg.hashsalt": "icmj",
    "pdf.fonttype": 42,  # editable text in the PDF
    "figure.dpi": 100,
}
COLUMNS = {1: 85.0, 1.5: 114.0, 2: 174.0}  # mm: widths that most journals accept
SHAPE = 0.66  # height of a figure over the width of one column


@contextmanager
def apply() -> Iterator[None]:
    """This style for the length of a ``with`` block, on matplotlib's defaults; the settings before come back after it.

    What a ``matplotlibrc`` sets, such as LaTeX for all text, is of other figures: these are the same everywhere.
    """
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(RC)
        yield


def new_figure(
    height: float = HEIGHT, rows: int = 1, *, width: float = WIDTH, shares: Sequence[float] = ()
) -> tuple[Figure, list[Axes]]:
    """A figure of ``width`` × ``height`` mm with ``rows`` axes one above the other, which share the abscissa.

    They are of the same height, or of heights as ``shares`` are.

    Margins are fixed in millimetres, so that the axes of neighbouring panels line up.
    """
    from matplotlib.figure import Figure

    left, right, bottom, top, gap = 13.0, 3.5, 9.0, 7.0, 3.0
    figure = Figure(figsize=(width * MM, height * MM))
    parts = np.asarray(shares or (1.0,) * rows)
    heights = (height - bottom - top - gap * (len(parts) - 1)) * parts / parts.sum()
    axes: list[Axes] = []
    for row, each in enumerate(heights):
        low = bottom + float((heights[row + 1 :] + gap).sum())
        box = (left / width, low / height, (width - left - right) / width, each / height)
        axes.append(figure.add_axes(box, sharex=axes[0] if axes else None))
        if row < len(parts) - 1:
            axes[-1].tick_params(labelbottom=False)
    return figure, axes


def each_output(count: int, draw: Callable[[Axes, int], object], abscissa: str, columns: int = 4) -> Figure:
    """A figure with one axes for each output, one above the other, and one legend above them all."""
    figure, stack = new_figure(TALL if count > 1 else HEIGHT, count)
    for i, axes in enumerate(stack):
        draw(axes, i)
        axes.set_xlabel(abscissa if axes is stack[-1] else "")
    figure.align_ylabels(stack)
    legend(figure, stack[0], columns)
    return figure


def letter(figure: Figure, text: str) -> None:
    """The panel's letter, top left."""
    height = figure.get_size_inches()[1] / MM
    figure.text(1.0 / (figure.get_size_inches()[0] / MM), 1 - 1.2 / height, text, va="top", weight="bold", size=9.5)


def legend(figure: Figure, axes: Axes, columns: int = 4) -> None:
    """One legend line above the axes, right of the letter, where it hides no data."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        width, height = figure.get_size_inches() / MM
        figure.legend(
            handles,
            labels,
            loc="upper right",
            bbox_to_anchor=(1 - 1.5 / width, 1 - 1.0 / height),
            ncols=min(columns, len(handles)),
        )


def words(text: str) -> str:
    """A name for matplotlib: on one line, with dollar signs escaped."""
    return one_line(text, 60).replace("$", r"\$")


def residual(axes: Axes, name: str) -> None:
    """Axes of the magnitude of a relative error, from the last digit of floats to all of it."""
    axes.set_yscale("log")
    axes.set(ylim=(3e-17, 10), yticks=[1e-16, 1e-8, 1], ylabel=name)
    axes.set_yticklabels(["$10^{-16}$", "$10^{-8}$", "1"])
    axes.minorticks_off()


def event_lines(axes: Axes, times: Any) -> None:
    """Dotted vertical lines at event times (over the height of the axes)."""
    times = np.asarray(times)
    if len(times):
        width = 0.45 if len(times) <= CROWDED else 0.25
        axes.vlines(times, 0, 1, transform=axes.get_xaxis_transform(), zorder=0.5, linewidths=width, **EVENT)


def link(kind: Literal["time", "plane"], *axes: Axes) -> None:
    """Mark axes in which the page can show the present time of a run, along the abscissa or as a point in the plane."""
    for each in axes:
        each.set_label(kind)


def links(figure: Figure) -> str:
    """Where axes that :func:`link` named are: kind; left, right, top and bottom from the upper left, 0 to 1; limits."""
    found = []
    for axes in figure.axes:
        if axes.get_label() in ("time", "plane"):
            box = axes.get_position()
            numbers = (box.x0, box.x1, 1 - box.y1, 1 - box.y0, *axes.get_xlim(), *axes.get_ylim())
            found.append(f"{axes.get_label()} {' '.join(f'{number:.6g}' for number in numbers)}")
    return ";".join(found)


def save(figure: Figure, kind: str) -> bytes:
    """The figure as ``svg`` or ``pdf``; the same bytes whenever it is drawn."""
    stream = BytesIO()
    metadata = {"Date": None, "Description": links(figure) or None} if kind == "svg" else {"CreationDate": None}
    figure.savefig(stream, format=kind, metadata=metadata)
    return stream.getvalue()


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
    shipped = font == RC["font.family"]
    return Journal(
        {
            **RC,
            "font.family": font if shipped else [font, "DejaVu Sans"],
            "mathtext.fontset": "stix" if shipped else "stixsans",
            "font.size": size,
            "axes.labelsize": size,
            "axes.titlesize": size,
            "xtick.labelsize": 0.92 * size,
            "ytick.labelsize": 0.92 * size,
            "legend.fontsize": 0.9 * size,
            "figure.figsize": (wide * MM, high * MM),
            "figure.constrained_layout.use": True,
            "pdf.fonttype": 42,  # TrueType; many journals refuse Type 3
            "ps.fonttype": 42,
            "savefig.dpi": 600,
        }
    )
