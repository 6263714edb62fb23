"""Text from elsewhere made fit for one line of a message: no control characters, no colour codes, not too long."""

from __future__ import annotations

import re

_ESCAPES = re.compile(r"\x1b(\[[0-?]*[ -/]*[@-~]|\][^\x07\x1b]*(\x07|\x1b\\)?|[@-Z\\-_])")
_CONTROLS = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]+")


def one_line(text: object, longest: int = 4000) -> str:
    """``text`` in one line without escape sequences and control characters, cut at ``longest`` characters."""
    line = " ".join(_CONTROLS.sub(" ", _ESCAPES.sub("", str(text))).split())
    return line if len(line) <= longest else line[: longest - 1] + "…"
