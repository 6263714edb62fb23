"""The representation of a result at a prompt or in a notebook: a line, and a table of a few rows."""

from __future__ import annotations

import re
from dataclasses import dataclass
from html import escape

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


class WithCard:
    """Base class of objects with a card; a dataclass that inherits from it must set ``repr=False``."""

    def card(self) -> Card:
        """The representation to show."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.card().line}>"

    def _repr_html_(self) -> str:
        card = self.card()
        rows = "".join(
            f'<tr style="background:none"><th scope="row" style="{_LABEL}">{_mark_up(label)}</th>'
            f'<td style="{_CELL}">{_mark_up(value)}</td></tr>'
            for label, value in card.rows
        )
        words = f'<div style="max-width:44em">{_mark_up(card.words)}</div>' if card.words else ""
        title = f"<strong>{escape(type(self).__name__)}</strong>"
        return f'<div class="icmj">{title}<table style="{_TABLE}"><tbody>{rows}</tbody></table>{words}</div>'


def _mark_up(text: str) -> str:
    """Escaped, Δ_crit with a subscript."""
    return _SUBSCRIPT.sub(r"\1<sub>\2</sub>", escape(text))
