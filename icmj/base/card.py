"""Representation of icmj's objects: one line at a prompt, a small table in a notebook, plain data for JSON."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, is_dataclass
from html import escape
from typing import Any

import numpy as np

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


def _marked(text: str) -> str:
    """Escaped, Δ_crit with a subscript."""
    return _SUBSCRIPT.sub(r"\1<sub>\2</sub>", escape(text))


def plain(value: Any) -> Any:
    """``value`` as JSON can hold it."""
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, np.bool_ | np.integer):
        return value.item()
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, complex | np.complexfloating):
        return [plain(value.real), plain(value.imag)]
    if isinstance(value, np.ndarray):
        return [plain(entry) for entry in value]
    if is_dataclass(value) and not isinstance(value, type):
        return plain(vars(value))
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    return [plain(entry) for entry in value]
