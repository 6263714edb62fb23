"""``{run-file} SCHEMA``: every table and key of a run file, or of another schema, read out of what checks it."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Iterator
from importlib import import_module
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from docutils import nodes
from docutils.statemachine import StringList
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

from icmj.runfile.editor_schema import docstrings

LOGGER = logging.getLogger(__name__)
KINDS = {float: "number", int: "whole number", str: "text", bool: "`true` or `false`"}
UNIT = re.compile(r"\s*\[([^\]]+)\](?=[.:,]?(\s|$))")


class RunFileReference(SphinxDirective):
    """A section for each table, with a row for each key."""

    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        home, name = (self.arguments or ["icmj.runfile.schema.RunFile"])[0].rsplit(".", 1)
        lines = list(_tables(getattr(import_module(home), name), ""))
        holder = nodes.section()
        holder.document = self.state.document
        self.state.nested_parse(StringList(lines, "schema"), self.content_offset, holder, match_titles=True)
        return holder.children


def _tables(model: type[BaseModel], path: str) -> Iterator[str]:
    """Markdown of a table and of the tables in it."""
    inner: list[tuple[str, type[BaseModel]]] = []
    rows = []
    for key, field in model.model_fields.items():
        below = [each for each in _members(field.annotation) if _is_table(each)]
        many = any(get_origin(each) is list for each in _union(field.annotation))
        named = any(get_origin(each) is dict for each in _union(field.annotation))
        place = f"{path}.{key}" if path else key
        inner += [(f"[[{place}]]" if many else f"[{place}.NAME]" if named else f"[{place}]", each) for each in below]
        if not below or path:
            rows.append(_row(model, key, field, bool(below)))
    if path:
        yield from ["```{list-table}", ":header-rows: 1", ":widths: 16 24 10 14 36", ":class: run-file", ""]
        yield from ["* - key", "  - type", "  - unit", "  - default", "  - meaning"]
        for row in rows:
            yield f"* - {row[0]}"
            yield from (f"  - {cell}" for cell in row[1:])
        yield from ["```", ""]
    for heading, each in inner:
        title = f'{heading} kind = "{_kind(each)}"' if "kind" in each.model_fields else heading
        yield from [f"{'##' if not path else '###'} `{title}`", "", *_prose(inspect.getdoc(each) or ""), ""]
        yield from _tables(each, heading.strip("[]").replace(".NAME", ".NAME"))


def _row(model: type[BaseModel], key: str, field: FieldInfo, table: bool) -> list[str]:
    said = _meaning(model, key)
    units = UNIT.findall(said)
    unit = units[0][0] if units else "–"
    meaning = UNIT.sub("", said)
    annotation = Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
    return [f"`{key}`", _type(annotation) or "table", unit, "below" if table else _default(field), _plain(meaning)]


def _default(field: FieldInfo) -> str:
    if field.default is PydanticUndefined:
        return "required"
    if field.default is None or isinstance(field.default, BaseModel):
        return "none"
    if field.default in ({}, []):
        return "empty"
    value = list(field.default) if isinstance(field.default, tuple) else field.default
    return f"`{json.dumps(value, ensure_ascii=False)}`"


def _meaning(model: type[BaseModel], key: str) -> str:
    """What the docstring under the key says of it, or that of the setting that has it."""
    if (found := docstrings(model).get(key)) is None:
        LOGGER.warning("%s.%s: the key has no docstring that says what it means", model.__name__, key)
    return found or ""


def _type(annotation: Any) -> str:
    """What may stand there, with its bounds."""
    parts: list[str] = []
    for each in _union(annotation):
        bare, bounds = _bounds(each)
        origin = get_origin(bare)
        if origin is Literal:
            parts += [f"`{json.dumps(choice)}`" for choice in get_args(bare)]
        elif origin is list:
            inner = get_args(bare)[0]
            words = "list of lists of numbers" if any(get_origin(_bounds(i)[0]) is list for i in _union(inner)) else ""
            parts.append(words or f"list of {_plural(inner)}")
        elif origin is tuple:
            parts.append(f"list of {len(get_args(bare))} {_plural(get_args(bare)[0])}")
        elif origin is dict:
            parts.append(f"table of {_plural(get_args(bare)[1])} by name")
        elif bare is Any:
            parts.append("anything")
        elif bare in KINDS:
            parts.append(KINDS[bare] + bounds)
    return ", ".join(parts[:-1]) + (" or " if len(parts) > 1 else "") + parts[-1] if parts else ""


def _plural(annotation: Any) -> str:
    words = _type(annotation)
    return (
        words.replace("whole number", "whole numbers")
        .replace("number", "numbers", 1)
        .replace("numberss", "numbers")
        .replace("text", "texts")
        if words
        else "tables"
    )


def _bounds(annotation: Any) -> tuple[Any, str]:
    """The type without annotations, and its bounds in words where they say something."""
    if get_origin(annotation) is not Annotated:
        return annotation, ""
    bare, *marks = get_args(annotation)
    flat = [m for mark in marks for m in getattr(mark, "metadata", [mark])]
    low = next((m.ge for m in flat if getattr(m, "ge", None) is not None), None)
    high = next((m.le for m in flat if getattr(m, "le", None) is not None), None)
    words = ""
    if low is not None and low >= 0:
        words = " ≥ 0" if low == 0 else " > 0" if low < 1e-9 else f" ≥ {low:g}"
    if high is not None and high < 1e6:
        words += f", ≤ {high:g}"
    return bare, words


def _union(annotation: Any) -> list[Any]:
    """The members of a union with their annotations, without none."""
    if get_origin(annotation) in (Union, UnionType):
        return [each for member in get_args(annotation) for each in _union(member)]
    if get_origin(annotation) is Annotated and get_origin(get_args(annotation)[0]) in (Union, UnionType):
        return _union(get_args(annotation)[0])
    return [] if annotation is NoneType else [annotation]


def _members(annotation: Any) -> list[Any]:
    """Everything inside: members of unions, elements of lists and of tables."""
    found = []
    for each in _union(annotation):
        bare = _bounds(each)[0]
        if get_origin(bare) in (list, dict):
            found += _members(get_args(bare)[-1])
        else:
            found.append(bare)
    return found


def _is_table(each: Any) -> bool:
    return isinstance(each, type) and issubclass(each, BaseModel)


def _kind(model: type[BaseModel]) -> str:
    field = model.model_fields.get("kind")
    said = get_args(field.annotation) if field else ()  # none where a kind may be any name
    return said[0] if said else ""


def _prose(docstring: str) -> list[str]:
    return [_plain(line) for line in docstring.splitlines()]


def _plain(text: str) -> str:
    """Markdown of the little reStructuredText that docstrings have."""
    return re.sub(r":\w+:`~?([^`]+)`", r"`\1`", text.replace("``", "`"))


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the directive to Sphinx."""
    app.add_directive("run-file", RunFileReference)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
