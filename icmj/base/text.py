"""Text of strangers made safe: what a terminal obeys is taken out, and JSON is read as what nobody vouches for."""

from __future__ import annotations

import json
import re
from typing import Any

_ESCAPES = re.compile(r"\x1b(\[[0-?]*[ -/]*[@-~]|\][^\x07\x1b]*(\x07|\x1b\\)?|[@-Z\\-_])")
# C0 and C1; marks, embeddings and isolates of direction; separators of lines; annotations; tags; halves of characters
_OBEYED = (
    r"\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u206f\ufff9-\ufffb\ud800-\udfff"
    r"\U000e0000-\U000e007f"
)
_CONTROLS = re.compile(rf"[\t\n{_OBEYED}]+")
_UNPRINTABLE = re.compile(rf"[{_OBEYED}]")
# what icmj prints itself, for streams that cannot encode it
_SPELT = str.maketrans(
    {"Δ": "Delta", "λ": "lambda", "γ": "gamma", "φ": "phi", "μ": "mu", "ζ": "zeta", "ρ": "rho", "±": "+-", "–": "-"}
    | {"−": "-", "·": ".", "²": "^2", "°": " deg", "→": "->", "…": "...", "’": "'", "≤": "<=", "≥": ">=", "×": "x"}
)


def one_line(text: object, longest: int = 4000) -> str:
    """``text`` in one line without escape sequences and control characters, cut at ``longest`` characters."""
    line = " ".join(_CONTROLS.sub(" ", _ESCAPES.sub("", str(text))).split())
    return line if len(line) <= longest else line[: longest - 1] + "…"


def strip_controls(text: str) -> str:
    """``text`` without control sequences; line breaks and tabs stay."""
    return _UNPRINTABLE.sub("", text)


def spell(error: UnicodeError) -> tuple[str, int]:
    """Replacements for characters that a stream cannot encode: a handler for :func:`codecs.register_error`."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    words = error.object[error.start : error.end].translate(_SPELT)
    return words.encode("ascii", "backslashreplace").decode(), error.end


def parse_json(content: str | bytes) -> Any:
    """What untrusted JSON text says.

    Raises:
        ValueError: in one line, if it is none, or is nested too deeply.
    """
    try:
        return json.loads(content)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    except ValueError as error:  # no JSON, no UTF-8, an integer of thousands of digits
        raise ValueError(f"not JSON: {one_line(error, 160)}") from error
