"""What docstrings say: of the attributes of a class, and of the parameters of a setting."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Callable
from typing import Any


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
