"""Text from files and users, made safe to show.

Control characters are taken out, JSON is read as what nobody vouches for, and names that are nearly right are found.
"""

from __future__ import annotations

import ast
import inspect
import json
import re
import textwrap
from collections.abc import Callable, Iterable
from difflib import get_close_matches
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
LONGEST = 80  # characters of what was given that are looked at


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


def find_nearest(given: str, known: Iterable[str]) -> str | None:
    """The most similar name among ``known`` to ``given``; ``None`` if none is similar.

    Capitals and separators do not count, because names are often written with others, or without them.
    """
    names = list(known)
    by_lower = {name.lower(): name for name in names}
    bare = {_bare(name): name for name in names}
    plain = given[:LONGEST].lower()
    if _bare(plain) in bare:
        return bare[_bare(plain)]
    found = get_close_matches(plain, list(by_lower), 1, 0.6)
    return by_lower[found[0]] if found else None


def suggest(given: str, known: Iterable[str]) -> str:
    """``; did you mean gain?``, or nothing if no name is near."""
    near = find_nearest(given, known)
    return f"; did you mean {near}?" if near is not None else ""


def _bare(name: str) -> str:
    return name.lower().replace("_", "").replace("-", "")


def read_attribute_docstrings(cls: type) -> dict[str, str]:
    """The docstrings under the attributes that a class declares itself, each in one line, by attribute."""
    (body,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
    assert isinstance(body, ast.ClassDef)
    return {
        attribute.target.id: " ".join(str(said.value.value).split())
        for attribute, said in zip(body.body, body.body[1:], strict=False)
        if isinstance(attribute, ast.AnnAssign)
        and isinstance(attribute.target, ast.Name)
        and isinstance(said, ast.Expr)
        and isinstance(said.value, ast.Constant)
    }


def read_meanings(setting: Callable[..., Any]) -> dict[str, str]:
    """What the docstring of a setting, and of those that it inherits from, says of each parameter."""
    found: dict[str, str] = {}
    for cls in reversed(getattr(setting, "__mro__", (setting,))):
        said = re.search(
            r"^(?:Attributes|Args):\n((?: {4}.*\n)*)", f"{inspect.cleandoc(cls.__doc__ or '')}\n", re.MULTILINE
        )
        for names, words in re.findall(r"^ {4}(\w[\w, ]*): (.*(?:\n {5,}.*)*)", said[1] if said else "", re.MULTILINE):
            text = " ".join(words.split())
            symbol = not re.match("[a-z]{2,}[ ,;-]|a ", text)
            found |= dict.fromkeys(names.split(", "), text if symbol else text[0].upper() + text[1:])
    return found
