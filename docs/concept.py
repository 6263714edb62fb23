# ruff: noqa: E501  elements of SVG are read as lines
"""The drawing of the idea: plant, observer, hold and event rule, and what they do in a simulation.

Curves are those of the case ``simple-0.8`` on the linear plant, so that the drawing shows what icmj computes.
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.sax.saxutils import escape

import numpy as np

import icmj

SINCE, UNTIL = 4.6, 13.6  # [s] of the run: a few settled intervals


@dataclass(frozen=True)
class Shades:
    """Colours on one ground."""

    ink: str
    soft: str
    face: str
    true: str
    model: str
    event: str
    open: str
    ground: str


LIGHT = Shades("#1b1b1b", "#5c5c5c", "#f4f2ec", "#0072b2", "#b34700", "#8a1f5a", "#e9f1f7", "#ffffff")
DARK = Shades("#e6e4de", "#aaa79f", "#26282b", "#6bb8ec", "#f2955b", "#f07fb8", "#1f2c36", "#131416")


@dataclass
class Sheet:
    """Elements of an SVG, one after another."""

    shades: Shades
    parts: list[str]

    def words(self, x: float, y: float, text: str, size: float = 15, **look: str) -> None:
        """Text whose ``<i>``, ``<b>`` and ``<s>`` (subscript) are those of SVG."""
        fill = look.pop("fill", self.shades.ink)
        more = "".join(f' {name.replace("_", "-")}="{value}"' for name, value in look.items())
        marked = escape(text)
        for tag, style in (
            ("i", 'font-style="italic"'),
            ("b", 'font-weight="bold"'),
            ("s", 'baseline-shift="-20%" font-size="75%"'),
        ):
            marked = marked.replace(f"&lt;{tag}&gt;", f"<tspan {style}>").replace(f"&lt;/{tag}&gt;", "</tspan>")
        self.parts.append(f'<text x="{x:g}" y="{y:g}" font-size="{size:g}" fill="{fill}"{more}>{marked}</text>')

    def box(
        self, x: float, y: float, wide: float, high: float, title: str, lines: tuple[str, ...], colour: str
    ) -> None:
        """A box with a title and lines under it."""
        self.parts.append(
            f'<rect x="{x:g}" y="{y:g}" width="{wide:g}" height="{high:g}" rx="7" fill="{self.shades.face}" '
            f'stroke="{colour}" stroke-width="2"/>'
        )
        self.words(x + wide / 2, y + 23, title, 16.5, font_weight="bold", fill=colour, text_anchor="middle")
        for i, line in enumerate(lines):
            self.words(x + wide / 2, y + 44 + 18 * i, line, 13.5, text_anchor="middle")

    def arrow(self, *points: tuple[float, float], dashed: bool = False, colour: str = "") -> None:
        """A line through points, with a head at its end."""
        way = " ".join(f"{x:g},{y:g}" for x, y in points)
        colour = colour or self.shades.ink
        head = {self.shades.ink: "ink", self.shades.event: "event"}[colour]
        dash = ' stroke-dasharray="6 4"' if dashed else ""
        self.parts.append(
            f'<polyline points="{way}" fill="none" stroke="{colour}" stroke-width="1.8"{dash} marker-end="url(#{head})"/>'
        )

    def line(self, x: np.ndarray, y: np.ndarray, colour: str, width: float = 2.0, dash: str = "") -> None:
        """A curve."""
        way = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        dashes = f' stroke-dasharray="{dash}"' if dash else ""
        self.parts.append(
            f'<polyline points="{way}" fill="none" stroke="{colour}" stroke-width="{width:g}" stroke-linejoin="round"{dashes}/>'
        )


def concept(shades: Shades, *, narrow: bool = False) -> str:
    """The SVG: loop and curves side by side, or, ``narrow``, one above the other."""
    sheet = Sheet(shades, [])
    _loop(sheet)
    wide, high = (470, 720) if narrow else (960, 372)
    curves = Sheet(shades, [])
    _curves(curves)
    place = "translate(4 372)" if narrow else "translate(494 0)"
    heads = "".join(
        f'<marker id="{name}" viewBox="0 0 10 10" refX="8.5" refY="5" markerWidth="7" markerHeight="7" orient="auto">'
        f'<path d="M0 0 10 5 0 10z" fill="{colour}"/></marker>'
        for name, colour in (("ink", shades.ink), ("event", shades.event))
    )
    inside = "\n".join([*sheet.parts, f'<g transform="{place}">', *curves.parts, "</g>"])
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide} {high}" width="{wide}" height="{high}" role="img" '
        "font-family=\"Helvetica, Arial, 'Liberation Sans', sans-serif\">\n"
        "<title>Intermittent control: between events an internal model drives the body in open loop</title>\n"
        f"<defs>{heads}</defs>\n{inside}\n</svg>\n"
    )


def _loop(sheet: Sheet) -> None:
    """Body, observer, switch, hold; the event rule that closes the switch; and the gain that the model does not know."""
    shades = sheet.shades
    sheet.words(8, 20, "<b>Open loop between events</b>", 15.5)
    sheet.box(286, 38, 170, 104, "body (plant)", (), shades.true)
    _person(sheet, 310, 71, 0.0)
    _person(sheet, 310, 71, 8.0)
    sheet.words(350, 88, "would fall", 13.5)
    sheet.words(350, 106, "by itself", 13.5)
    sheet.box(286, 222, 170, 68, "observer", ("estimates the state",), shades.true)
    sheet.box(8, 38, 170, 104, "hold", ("an internal model runs", "ahead and commands", "the muscles"), shades.model)
    sheet.box(8, 222, 170, 86, "event rule", ("prediction − estimate", "larger than <i>q</i><s>t</s> ?"), shades.event)
    # the command, multiplied by what the model does not know
    sheet.arrow((178, 76), (202, 76))
    sheet.parts.append(
        f'<path d="M202 52 250 76 202 100z" fill="{shades.face}" stroke="{shades.ink}" stroke-width="1.8"/>'
    )
    sheet.words(209, 81.5, "× <i>b</i>", 15, font_weight="bold")
    sheet.arrow((250, 76), (284, 76))
    sheet.words(186, 126, "muscles give", 13, fill=shades.soft)
    sheet.words(186, 142, "<i>b</i> × what the", 13, fill=shades.soft)
    sheet.words(186, 158, "model assumes", 13, fill=shades.soft)
    sheet.arrow((371, 142), (371, 220))
    sheet.words(379, 188, "what is sensed", 13, fill=shades.soft)
    # observer to event rule, always; to the hold, through a switch
    sheet.arrow((286, 264), (180, 264))
    sheet.arrow((93, 142), (93, 220), dashed=True)
    sheet.words(14, 188, "prediction", 13, fill=shades.soft)
    sheet.arrow((300, 222), (300, 196), (146, 196), (146, 144), colour=shades.event)
    sheet.parts.append(
        f'<rect x="196" y="186" width="56" height="20" fill="none"/>'
        f'<line x1="205" y1="196" x2="243" y2="196" stroke="{shades.ground}" stroke-width="5"/>'
        f'<line x1="243" y1="196" x2="210" y2="180" stroke="{shades.event}" stroke-width="2.6" stroke-linecap="round"/>'
        f'<circle cx="243" cy="196" r="3.6" fill="{shades.event}"/><circle cx="205" cy="196" r="3.6" fill="{shades.event}"/>'
    )
    sheet.words(232, 224, "closes at", 13, fill=shades.event, text_anchor="middle")
    sheet.words(232, 240, "events only", 13, fill=shades.event, text_anchor="middle")
    sheet.arrow((178, 236), (190, 236), (190, 204), (203, 200), dashed=True, colour=shades.event)
    sheet.words(8, 332, "<i>b</i> = 1: the model is right. At <i>b</i> = 0.8: the muscles are a fifth weaker", 13.5)
    sheet.words(8, 350, "than it assumes: prediction and body part, and events repeat in a cycle.", 13.5)


def _person(sheet: Sheet, x: float, y: float, lean: float) -> None:
    """A standing figure that leans by an angle [°] about its foot."""
    colour = sheet.shades.true if lean else sheet.shades.soft
    sheet.parts.append(
        f'<g transform="rotate({lean:g} {x - 8:g} {y + 66:g})" stroke="{colour}" stroke-width="{3 if lean else 1.3}" '
        f'fill="none" stroke-linecap="round" stroke-dasharray="{"none" if lean else "3 3"}">'
        f'<circle cx="{x - 8:g}" cy="{y + 4:g}" r="6.5"/><path d="M{x - 8:g} {y + 11:g}V{y + 66:g}h11"/></g>'
    )


def _curves(sheet: Sheet) -> None:
    """The angle of the body and its prediction; their difference in the event rule; events."""
    shades = sheet.shades
    case = icmj.prepare(icmj.load_run("simple-0.8"))
    run = icmj.simulate(case, "linear")
    shown = (run.t >= SINCE) & (run.t <= UNTIL)
    t, x0, x1 = run.t[shown], 60.0, 452.0
    at = x0 + (x1 - x0) * (t - SINCE) / (UNTIL - SINCE)
    events = [float(e) for e in run.events.t if SINCE < e < UNTIL]
    where = [x0 + (x1 - x0) * (e - SINCE) / (UNTIL - SINCE) for e in events]
    for i, (left, right) in enumerate(zip([x0, *where], [*where, x1], strict=True)):
        if i % 2:
            sheet.parts.append(
                f'<rect x="{left:.1f}" y="34" width="{right - left:.1f}" height="252" fill="{shades.open}"/>'
            )
    for x in where:
        sheet.parts.append(
            f'<line x1="{x:.1f}" y1="34" x2="{x:.1f}" y2="286" stroke="{shades.event}" stroke-width="1.3" stroke-dasharray="2 3"/>'
        )
    # estimate and prediction, in degrees
    state = run.x_o[shown].T
    angle, held = np.degrees(state[0]), np.degrees(run.x_h[shown].T[0])
    low, high = min(angle.min(), held.min()), max(angle.max(), held.max())

    def up(values: np.ndarray, bottom: float, top: float, least: float, most: float) -> np.ndarray:
        return bottom - (bottom - top) * (values - least) / (most - least)

    sheet.words(0, 20, "<b>One simulation, <i>b</i> = 0.8</b>", 15.5)
    sheet.words(x1, 20, "events", 14, fill=shades.event, text_anchor="end")
    sheet.line(at, up(angle, 176, 52, low, high), shades.true, 2.4)
    sheet.line(at, up(held, 176, 52, low, high), shades.model, 2.0, "7 4")
    sheet.words(20, 104, "angle", 14, transform="rotate(-90 20 104)", text_anchor="middle")
    error = np.abs(np.degrees(state[0] - run.x_h[shown].T[0]))
    limit = float(np.degrees(case.controller.trigger.size))
    sheet.line(np.array([x0, x1]), up(np.array([limit, limit]), 272, 200, 0, limit), shades.event, 1.4)
    sheet.line(at, up(np.minimum(error, limit), 272, 200, 0, limit), shades.ink, 1.8)
    sheet.words(20, 236, "difference", 14, transform="rotate(-90 20 236)", text_anchor="middle")
    sheet.words(x0 - 4, 204, "<i>q</i><s>t</s>", 14, fill=shades.event, text_anchor="end")
    sheet.words(x0 - 4, 277, "0", 13, fill=shades.soft, text_anchor="end")
    for y, words, colour, dash in (
        (306.0, "body, as estimated", shades.true, ""),
        (324.0, "prediction of the hold", shades.model, "7 4"),
    ):
        sheet.line(np.array([x0, x0 + 26]), np.array([y - 4.5, y - 4.5]), colour, 2.2, dash)
        sheet.words(x0 + 32, y, words, 13, fill=colour)
    if len(where) > 3:
        sheet.words((where[1] + where[2]) / 2, 190, "open loop", 13, fill=shades.soft, text_anchor="middle")
    delta = case.prediction.delta_crit
    assert delta is not None
    y, (left, right) = 300.0, where[-2:]
    sheet.parts.append(
        f'<path d="M{left:.1f} {y - 7:g}v14M{right:.1f} {y - 7:g}v14M{left:.1f} {y:g}H{right:.1f}" stroke="{shades.ink}" '
        'stroke-width="1.6" fill="none"/>'
    )
    sheet.words((left + right) / 2, y + 22, f"{delta:.2f} s", 16, font_weight="bold", text_anchor="middle")
    sheet.words(x1, y + 46, "<b>predicted from eigenvalues alone</b>, and measured", 14, text_anchor="end")
