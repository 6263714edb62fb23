"""The paper's notation, in plain text and turned into HTML: ``Δ_crit`` becomes Δ with a subscript."""

from __future__ import annotations

import re

from markupsafe import Markup, escape

_SUBSCRIPT = re.compile(r"(?<![A-Za-zΓ-ω_])([A-Za-zΓ-ω])_(\w+)")

_GREEK = {"delta": "Δ", "gamma": "γ", "lambda": "λ", "rho": "ρ", "zeta": "ζ"}


def notation(text: str) -> Markup:
    """``text`` escaped, every single letter with an underscore given its subscript."""
    return Markup(_SUBSCRIPT.sub(r"\1<sub>\2</sub>", str(escape(text))))


def symbol(name: str) -> str:
    """A name in code as the paper writes it: ``delta_min`` is Δ_min; one that is no symbol as plain words."""
    head, _, index = name.partition("_")
    head = _GREEK.get(head, head)
    if not index:
        return head
    return f"{head}_{index}" if len(head) == 1 else name.replace("_", " ")
