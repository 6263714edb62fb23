"""The paper's notation in plain text turned into HTML: ``Δ_crit`` becomes Δ with a subscript."""

from __future__ import annotations

import re

from markupsafe import Markup, escape

_SUBSCRIPT = re.compile(r"(?<![A-Za-zΓ-ω_])([A-Za-zΓ-ω])_(\w+)")


def notation(text: str) -> Markup:
    """``text`` escaped, every single letter with an underscore given its subscript."""
    return Markup(_SUBSCRIPT.sub(r"\1<sub>\2</sub>", str(escape(text))))
