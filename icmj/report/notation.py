"""The paper's notation, in plain text and turned into HTML: ``Δ_crit`` becomes Δ with a subscript."""

from __future__ import annotations

import re

from markupsafe import Markup, escape

from icmj.base.text import strip_controls

_SUBSCRIPT = re.compile(
    r"(?<![A-Za-zΓ-ω_])([A-Za-zΓ-ω])_(\w+)"  # Δ_crit
    r"|(?<![\wΓ-ω])([φχγρζμ])(?![\wΓ-ω_\u0302])|(?<![\w.])(b)(?= = \d)"  # γ alone, and b where it has a value
)

# what stands on one line: a symbol, its equals sign and its value; a number and its unit
_TOGETHER = re.compile(r"(?<=\S) ([=≈≠<>±×−]) (?=\S)|(?<=\d) (?=(?:s|Hz|rad|deg|kg|mm|m|N|Δ)\b|[%°])")
_POWER = re.compile(r"(?<![\w.])([−+-]?\d(?:\.\d+)?)e([+-]?)0*(\d+)\b")
_MINUS = re.compile(r"(?<![\w-])-(?=\d)")
_MAGNITUDE = re.compile(r"\|(\S{1,12}?)\|")  # lines may be broken after a bar
_LONGEST = 10_000  # characters of what is text; pictures are longer

SYMBOLS = {
    "Δ_ol": "open-loop interval: the time between two events [s]",
    "Δ_crit": "critical open-loop interval, at which an eigenvalue of φ reaches the unit circle [s]",
    "Δ_min": "shortest interval between two events, the refractory period [s]",
    "λ_crit": "eigenvalue of φ at the critical interval: +1 or −1",
    "φ": "matrix that maps the state at one event to the state at the next, as a function of the interval",
    "γ": "magnitude of the critical mode at events on the cycle; proportional to the threshold",
    "χ_k1": "critical mode: the coordinate of the state along the eigenvector of λ_crit",
    "χ": "coordinates of the state at events in the eigenvectors of φ",
    "b": "input gain: the actual effect of the inputs as a multiple of what the controller assumes",
    "ρ": "share of the changes of the plant that is applied: 0 for none, 1 for all",
    "q_t": "threshold of the event rule [unit of the outputs]",
    "Q_t": "weight of the hold error in the event rule",
    "ζ": "damping ratio",
    "μ": "multiplier: factor on a small deviation over one turn of the cycle; the cycle attracts if all |μ| < 1",
}
"""What each symbol of the page means, shown where a pointer rests on it, and in the legend."""

_GREEK = {"delta": "Δ", "gamma": "γ", "lambda": "λ", "rho": "ρ", "zeta": "ζ"}


def notation(text: str) -> Markup:
    """``text`` escaped, every single letter with an underscore given its subscript; numbers as they are printed."""
    printed = _POWER.sub(
        lambda m: f"{m[1]} × 10<sup>{m[2].replace('-', '−').strip('+')}{m[3]}</sup>", str(escape(text))
    )
    return Markup(_SUBSCRIPT.sub(_explain, _MINUS.sub("−", printed)))


def _explain(found: re.Match[str]) -> str:
    """A symbol with its subscript, and with its meaning where the page knows it."""
    shown = f"{found[1]}<sub>{found[2]}</sub>" if found[1] else found[0]
    meaning = SYMBOLS.get(found[0])
    return shown if meaning is None else f'<abbr title="{escape(meaning)}">{shown}</abbr>'


def unbroken(value: object) -> object:
    """Text for the templates without control characters, and with non-breaking spaces in terms like ``b = 0.9``."""
    if not isinstance(value, str) or len(value) > _LONGEST:
        return value
    value = Markup(strip_controls(value)) if isinstance(value, Markup) else strip_controls(value)
    blank, joiner = "\N{NO-BREAK SPACE}", "\N{WORD JOINER}"
    joined = _TOGETHER.sub(lambda m: f"{blank}{m[1]}{blank}" if m[1] else blank, str(value))
    joined = _MAGNITUDE.sub(rf"|{joiner}\1|{joiner}", joined)
    return Markup(joined) if isinstance(value, Markup) else joined


def symbol(name: str) -> str:
    """A name in code as the paper writes it: ``delta_min`` is Δ_min; one that is no symbol as plain words."""
    head, _, index = name.partition("_")
    head = _GREEK.get(head, head)
    if not index:
        return head
    return f"{head}_{index}" if len(head) == 1 else name.replace("_", " ")
