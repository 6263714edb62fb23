"""Pictures of branches of cycles: interval and amplitude along the parameter, multipliers, and orbits on each other.

Solid: attracting; dashed: repelling; faint beneath: the linear prediction, which is the branch of the linear plant.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array
from icmj.cycle.branch import Branch, SpecialPoint
from icmj.cycle.parameter import get_unit
from icmj.errors import ReportError
from icmj.report import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDE, HIGH = 172.0, 124.0  # mm: two columns
SHADES = ("#a03c00", "#0072b2", "#007a55", "#7a4fa3", "#8a6d00")  # of branches one after another
LOOK: dict[str, dict[str, Any]] = {
    "fold": {"marker": "<", "label": "fold"},
    "flip": {"marker": "s", "label": "flip"},
    "symmetry breaking": {"marker": "D", "label": "symmetry breaking"},
    "branch point": {"marker": "P", "label": "branch point"},
    "Neimark–Sacker": {"marker": "o", "label": "Neimark–Sacker"},
    "grazing": {"marker": "x", "label": "grazing"},
    "least interval": {"marker": "v", "label": "least interval"},
    "homoclinic": {"marker": "^", "label": "homoclinic"},
    "fall": {"marker": "X", "label": "fall"},
    "end": {"marker": "|", "label": "end"},
}
PLANT = {"linear": "linear plant", "mujoco": "MuJoCo"}
STROKE = {True: "solid", False: "dashed"}
ORBITS = 6  # drawn on each other
_MOST_INTERVALS = 4.0  # times the median: what is longer runs out of the picture


def branch_figure(branches: Sequence[Branch], linear: Sequence[Branch] = ()) -> Figure:
    """Four panels: interval, amplitude, multipliers of the first branch, and orbits on it.

    Raises:
        ReportError: if there is no branch, or they are of different parameters.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDE * style.MM, HIGH * style.MM))
    boxes = ((0.075, 0.545), (0.575, 0.545), (0.075, 0.085), (0.575, 0.085))
    axes = [figure.add_axes((x, y, 0.34 if n == 3 else 0.4, 0.35)) for n, (x, y) in enumerate(boxes)]
    draw_intervals(axes[0], branches, linear)
    draw_amplitude(axes[1], branches, linear)
    draw_multipliers(axes[2], branches[0])
    draw_orbits(axes[3], branches[0], linear[0] if linear else None)
    for letter, panel in zip("abcd", axes, strict=True):
        panel.text(-0.13, 1.04, f"({letter})", transform=panel.transAxes, weight="bold", size=9.5)
    named = dict(zip(*reversed(axes[0].get_legend_handles_labels()), strict=True))  # of lines for two intervals one
    most = [(size, columns) for size in (7.6, 7.0, 6.4) for columns in range(7, -(-len(named) // 2) - 1, -1)]
    for size, columns in [*most, (6.4, 5)]:  # in two rows, which leave room below, or else in small letters
        for wider in list(figure.legends):
            wider.remove()
        legend = figure.legend(
            named.values(), named.keys(), loc="upper center", ncols=columns, bbox_to_anchor=(0.5, 1.0), fontsize=size,
            handlelength=1.8, columnspacing=1.3,
        )  # fmt: skip
        if legend.get_window_extent().width <= figure.bbox.width:
            break
    return figure


def parameter_in_words(name: str) -> str:
    """The parameter of a branch for axes and headings; keys of the run file as they are."""
    known = {
        "b": "input gain b", "q_t": "threshold q_t", "delay": "delay", "delta_min": "refractory period Δ_min",
        "rho": "share ρ of the changes",
    }  # fmt: skip
    what, colon, of = name.partition(":")
    if colon:
        return f"factor on the {what.replace('_', ' ')}{f' of the {of}' if of else ''}"
    return known.get(name, name)


def _axis_label(name: str, unit: str) -> str:
    shown = {"b": "input gain $b$", "q_t": "threshold $q_t$", "delta_min": r"refractory period $\Delta_{min}$"}
    words = shown.get(name, style.words(parameter_in_words(name)))
    return f"{words} ({unit})" if unit else words


def _symbol(name: str) -> str:
    """The parameter in as few letters as there is room for."""
    shown = {"b": "$b$", "q_t": "$q_t$", "delta_min": r"$\Delta_{min}$", "rho": r"$\rho$"}
    return shown.get(name, "factor" if ":" in name else style.words(name.rpartition(".")[2]))


def draw_intervals(axes: Axes, branches: Sequence[Branch], linear: Sequence[Branch] = ()) -> None:
    """Open-loop intervals against the parameter, with one line for each interval of a period.

    Raises:
        ReportError: if there is no branch, or they are of different parameters.
    """
    _along(axes, branches, linear, lambda of: (of.intervals, np.array([s.intervals for s in of.specials])))
    shown = np.concatenate([of.intervals.ravel() for of in branches])
    axes.set_ylim(0, min(1.08 * float(shown.max()), _MOST_INTERVALS * float(np.median(shown))))
    axes.set_ylabel(r"open-loop interval $\Delta_{ol}$ (s)")


def draw_amplitude(axes: Axes, branches: Sequence[Branch], linear: Sequence[Branch] = (), output: int = 0) -> None:
    """The peak of one output against the parameter, of angles in degrees.

    Raises:
        ReportError: if there is no branch, or they are of different parameters, or have no such output.
    """
    first = _first(branches)
    if not 0 <= output < len(first.outputs):
        raise ReportError(f"no output {output} on this branch; it has {len(first.outputs)}")
    factor, unit = _show(first.units[output])

    def quantity(of: Branch) -> tuple[Array, Array]:
        at = np.array([s.y_peak[[output]] for s in of.specials])
        return factor * of.y_peak[:, [output]], factor * at

    _along(axes, branches, linear, quantity)
    peaks = np.concatenate([factor * of.y_peak[:, output] for of in branches])
    if peaks.max() > 30 * peaks.min() > 0:
        axes.set_yscale("log")
    else:
        axes.set_ylim(0, min(1.08 * float(peaks.max()), 6 * float(np.median(peaks))))
    axes.set_ylabel(f"peak of {style.words(first.outputs[output])}{f' ({unit})' if unit else ''}")


def draw_multipliers(axes: Axes, branch: Branch) -> None:
    """Multipliers of the return map in the complex plane; yellow: the beginning of the branch, blue: its end."""
    from matplotlib import colormaps

    angle = np.linspace(0, 2 * np.pi, 241)
    axes.plot(np.cos(angle), np.sin(angle), color="#8a8a8a", linewidth=0.7, zorder=0.5)
    axes.axhline(0, color="#cccccc", linewidth=0.4, zorder=0.3)
    axes.axvline(0, color="#cccccc", linewidth=0.4, zorder=0.3)
    shade = colormaps["cividis"](np.linspace(0.92, 0.0, len(branch)))
    largest = float(np.abs(branch.multipliers).max())
    reach = float(np.clip(1.08 * largest, 1.15, 2.2))
    for i, values in enumerate(branch.multipliers):
        beyond = np.maximum(np.abs(values.real), np.abs(values.imag)) / (0.96 * reach)
        inside, edge = values[beyond <= 1], values[beyond > 1] / beyond[beyond > 1]
        axes.plot(inside.real, inside.imag, "o", color=shade[i], markersize=2.4, markeredgewidth=0, zorder=2)
        axes.plot(edge.real, edge.imag, "+", color=shade[i], markersize=4.4, zorder=2)
    if largest > reach:
        axes.text(0.03, 0.96, rf"+ beyond: $|\mu|$ to {largest:.3g}", transform=axes.transAxes, va="top", size=6.4)
    for special in branch.specials:
        if np.isfinite(special.multiplier.real):
            for value in {special.multiplier, special.multiplier.conjugate()}:
                axes.plot(value.real, value.imag, **_mark(special), linestyle="none", zorder=4)
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    axes.set_xlabel(r"Re $\mu$")
    axes.set_ylabel(r"Im $\mu$")
    first, last = float(branch.value[0]), float(branch.value[-1])
    turn = max(branch.value, key=lambda value: min(abs(value - first), abs(value - last)))
    turned = not min(first, last) <= turn <= max(first, last)  # past a fold
    by = f" via {turn:.4g}" if turned else ""
    ends = rf"{_symbol(branch.parameter)} from {first:.4g} (yellow){by} to {last:.4g} (blue)"
    axes.set_title(ends, size=7.2, pad=3, loc="right")


def draw_orbits(axes: Axes, branch: Branch, linear: Branch | None = None, output: int = 0) -> None:
    """Some cycles of the branch in the plane of one output and its rate, over those of the linear plant.

    Each is divided by the size of the linear one, so that only what is not linear shows, where the threshold is the
    parameter; else they are drawn as they are.
    """
    from matplotlib import colormaps

    factor, unit = _show(branch.units[output])
    by_size = branch.parameter == "q_t"
    chosen = _spread(branch)
    shades = colormaps["cividis"](np.linspace(0.9, 0.0, len(chosen)))
    for n, (i, shade) in enumerate(zip(chosen, shades, strict=True)):
        scale = 1 / branch.value[i] if by_size else factor
        if linear is not None:
            gap = np.abs(linear.value - branch.value[i]) / np.ptp(branch.value)
            # past a fold there are several at one value
            j = int(np.argmin(gap + 0.2 * np.abs(linear.interval / branch.interval[i] - 1)))
            near = abs(linear.value[j] - branch.value[i]) < 0.03 * np.ptp(branch.value)
            if near and (n == 0 or not by_size):
                own = 1 / linear.value[j] if by_size else factor
                axes.plot(*_portrait(linear, j, output, own), **{**style.PREDICTED, "linewidth": 3.0})
        label = f"{branch.value[i]:.2g}" if by_size else f"{branch.value[i]:.3g}"
        axes.plot(*_portrait(branch, i, output, scale), color=shade, linewidth=0.9, label=label)
    name = style.words(branch.outputs[output])
    if by_size:
        axes.set_xlabel(rf"{name} / $q_t$")
        axes.set_ylabel(rf"rate of {name} / $q_t$ (1/s)")
    else:
        axes.set_xlabel(f"{name}{f' ({unit})' if unit else ''}")
        axes.set_ylabel(f"rate of {name}{f' ({unit}/s)' if unit else ''}")
    axes.margins(0.06)
    axes.legend(
        title=_symbol(branch.parameter), loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=6.4, title_fontsize=6.8
    )


def _spread(branch: Branch) -> list[int]:
    """Cycles evenly spaced along the parameter, on all parts of a branch with folds."""
    value = np.log(branch.value) if _logarithmic([branch]) else branch.value
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(value)))])
    return sorted({int(np.argmin(np.abs(way - part))) for part in np.linspace(0, way[-1], ORBITS)})


def _portrait(branch: Branch, i: int, output: int, scale: float) -> tuple[Array, Array]:
    """One cycle of one output against its rate, mirrored half included."""
    p = branch.intervals.shape[1]
    y = branch.y[i, :, output].reshape(p, -1)
    t = branch.t[i].reshape(p, -1)
    rate = np.array([np.gradient(part, times, edge_order=2) for part, times in zip(y, t, strict=True)])
    x, v = y.ravel(), rate.ravel()
    if branch.mirrored:
        x, v = np.append(x, -x), np.append(v, -v)
    return scale * np.append(x, x[0]), scale * np.append(v, v[0])


def _along(
    axes: Axes, branches: Sequence[Branch], linear: Sequence[Branch], quantity: Callable[[Branch], tuple[Array, Array]]
) -> None:
    """Lines of a quantity of each cycle, and of each special point, against the parameter."""
    first = _first([*branches, *linear])
    for n, of in enumerate(linear):
        for i, (value, curve, _) in enumerate(_parts(of, *quantity(of))):
            axes.plot(
                value, curve, label=PLANT["linear"] if n == i == 0 else None, **{**style.PREDICTED, "linewidth": 3.2}
            )
    named: set[str] = set()
    stability: dict[bool, dict[str, Any]] = {True: {"linestyle": "-"}, False: {"linestyle": (0, (4, 1.6))}}
    plant, several = PLANT[first.plant], len(branches) > 1
    words = {True: "attracting", False: "repelling"}
    words = {at: f"{plant}, {word} ({STROKE[at]})" for at, word in words.items()}
    colours = [SHADES[n % len(SHADES)] for n in range(len(branches))]
    for n, colour in enumerate(colours if several else ()):
        axes.plot([], [], color=colour, linewidth=2.4, label=f"branch {n + 1}")
    for attracting, word in words.items() if several else ():
        if any((of.attracting == attracting).any() for of in branches):
            axes.plot([], [], color="#555555", linewidth=1.1, label=word, **stability[attracting])
    for n, of in enumerate(branches):
        values, at = quantity(of)
        for value, curve, attracting in _parts(of, values, at):
            label = None if several or words[attracting] in named else words[attracting]
            named.add(words[attracting])
            axes.plot(value, curve, color=colours[n], linewidth=1.1, label=label, **stability[attracting])
        for special, height in zip(of.specials, at, strict=True):
            kind = LOOK[special.kind]["label"]
            # an interval that is infinite there is shown by its branch alone
            for j, one in enumerate(height):
                label = kind if kind not in named and j == 0 else None
                axes.plot(special.value, one, linestyle="none", label=label, zorder=5, **_mark(special))
            named.add(kind)
    if _logarithmic(branches):
        axes.set_xscale("log")
    unit = "rad" if first.parameter == "q_t" and "rad" in first.units else get_unit(first.parameter)
    axes.set_xlabel(_axis_label(first.parameter, unit))


def _parts(of: Branch, values: Array, at: Array) -> Iterator[tuple[Array, Array, bool]]:
    """Pieces of one stability, cut at the special points on them: (parameter, values, attracting)."""
    x, y, attracting = [of.value[0]], [values[0]], bool(of.attracting[0])
    for i in range(1, len(of)):
        inside = [(s.value, at[k]) for k, s in enumerate(of.specials) if s.index == i - 1 and i < len(of)]
        for value, height in inside:
            x.append(value)
            y.append(height)
        if bool(of.attracting[i]) != attracting:
            cut = len(x) - 1 if inside else len(x)
            if not inside:
                x.append(of.value[i])
                y.append(values[i])
            yield np.array(x[: cut + 1]), np.array(y[: cut + 1]), attracting
            x, y, attracting = x[cut:], y[cut:], bool(of.attracting[i])
            if not inside:
                continue
        x.append(of.value[i])
        y.append(values[i])
    yield np.array(x), np.array(y), attracting


def _mark(special: SpecialPoint) -> dict[str, Any]:
    look = {"marker": LOOK[special.kind]["marker"], "markersize": 4.4, "color": "#111111", "markerfacecolor": "white"}
    return {**look, "markeredgewidth": 0.9}


def _first(branches: Sequence[Branch]) -> Branch:
    if not branches:
        raise ReportError("no branch to draw")
    if len({of.parameter for of in branches}) > 1:
        raise ReportError("branches of different parameters cannot be drawn in one figure")
    return branches[0]


def _logarithmic(branches: Sequence[Branch]) -> bool:
    value = np.concatenate([of.value for of in branches])
    return bool(value.min() > 0 and value.max() >= 10 * value.min())


def _show(unit: str) -> tuple[float, str]:
    return (180 / np.pi, "deg") if unit == "rad" else (1.0, unit)
