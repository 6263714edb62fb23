"""Representation of icmj's objects: one line at a prompt, a small table in a notebook."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from icmj.base.array import Array

MISSING = "–"
_SUBSCRIPT = re.compile(r"(?<![A-Za-zΓ-ω_])([A-Za-zΓ-ω])_(\w+)\b(?!\.)")
_CELL = "text-align:left;vertical-align:top;padding:.15em 1em .15em 0;border:0;background:none;color:inherit"
_LABEL = f"{_CELL};font-weight:normal;opacity:.7;white-space:nowrap"
_TABLE = "border-collapse:collapse;margin:.3em 0;font-size:.95em"


@dataclass(frozen=True)
class Card:
    """The contents of a representation.

    Attributes:
        line: few words, for a prompt.
        rows: label and value, for a notebook.
        words: a sentence below them, or "".
    """

    line: str
    rows: tuple[tuple[str, str], ...]
    words: str = ""


class Shown:
    """Base class of objects with a card; a dataclass that inherits from it must set ``repr=False``."""

    def card(self) -> Card:
        """The representation to show."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.card().line}>"

    def _repr_html_(self) -> str:
        card = self.card()
        rows = "".join(
            f'<tr style="background:none"><th scope="row" style="{_LABEL}">{_marked(label)}</th>'
            f'<td style="{_CELL}">{_marked(value)}</td></tr>'
            for label, value in card.rows
        )
        words = f'<div style="max-width:44em">{_marked(card.words)}</div>' if card.words else ""
        title = f"<strong>{escape(type(self).__name__)}</strong>"
        return f'<div class="icmj">{title}<table style="{_TABLE}"><tbody>{rows}</tbody></table>{words}</div>'


def amount(value: float | None, unit: str = "", figures: int = 6) -> str:
    """A number with its unit, angles also in degrees; a dash where there is none."""
    if value is None or math.isnan(value):
        return MISSING
    degrees = f" ({math.degrees(value):.3g}°)" if unit == "rad" else ""
    return f"{value:.{figures}g} {unit}".rstrip().replace("-", "−") + degrees.replace("-", "−")


def amounts(values: Array | None, names: Sequence[str], units: Sequence[str], figures: int = 4) -> str:
    """Numbers with their names and units, one after another; without names where these are not known."""
    if values is None or len(values) == 0:
        return MISSING
    names = names if len(names) == len(values) else ("",) * len(values)
    units = units if len(units) == len(values) else ("",) * len(values)
    each = (f"{name} {amount(float(v), u, figures)}".strip() for v, name, u in zip(values, names, units, strict=True))
    return ", ".join(words.replace(" ", "\N{NO-BREAK SPACE}") for words in each)


def count(number: int, what: str) -> str:
    """``1 state``, ``2 states``."""
    return f"{number} {what}" + ("" if number == 1 else "s")


def number(value: complex | None) -> str:
    """An eigenvalue as +1, −1 or a ± bj; a dash where there is none."""
    if value is None:
        return MISSING
    if abs(value.imag) < 1e-9:
        return f"{value.real:+.4g}".replace("-", "−")
    return f"{value.real:.4g} {'+' if value.imag > 0 else '−'} {abs(value.imag):.4g}j".replace("-", "−")


def relative(value: float | None) -> str:
    """A relative error with its sign."""
    return MISSING if value is None or not math.isfinite(value) else f"{value:+.1e}".replace("-", "−")


def _marked(text: str) -> str:
    """Escaped, Δ_crit with a subscript."""
    return _SUBSCRIPT.sub(r"\1<sub>\2</sub>", escape(text))
