"""The JSON Schema of a kind of file, with which editors complete and check them."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel

from icmj.base import VERSION
from icmj.base.docstrings import read_attribute_docstrings, read_meanings

SCHEMA_VERSION = 2
"""Rises with every change after which a file that was valid is not any more, or means something else."""


def json_schema(model: type[BaseModel], kind: str, title: str) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a kind of file: every table and key with its meaning, bounds and default.

    What only the whole file shows, such as whether a joint has that name, is checked when the file is read.
    """
    record = model.model_json_schema()
    _describe(record, model)
    for known in _tables(model):
        if known.__name__ in record.get("$defs", {}):
            _describe(record["$defs"][known.__name__], known)
    facts = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": f"icmj:{kind}:{SCHEMA_VERSION}"}
    return {**facts, "version": SCHEMA_VERSION, "$comment": f"icmj {VERSION}", **record, "title": title}


def _tables(model: type[BaseModel]) -> set[type[BaseModel]]:
    """Every table of the package: names are unique among them."""
    found, waiting = set[type[BaseModel]](), [BaseModel]
    while waiting:
        below = [cls for cls in waiting.pop().__subclasses__() if cls not in found]
        found.update(below)
        waiting += below
    return {cls for cls in found if cls.__module__.startswith(model.__module__.partition(".")[0])}


def _describe(record: dict[str, Any], model: type[BaseModel]) -> None:
    """Give the keys of a table the docstrings that stand under them."""
    for key, words in docstrings(model).items():
        if (entry := record.get("properties", {}).get(key)) is not None:
            entry["description"] = words


def docstrings(model: type[BaseModel]) -> dict[str, str]:
    """The meaning of the keys of a table, by key: the docstrings under them, or those of its setting."""
    found = dict[str, str]()
    for cls in reversed(model.__mro__):
        if (setting := vars(cls).get("setting")) is not None:
            found |= read_meanings(setting)
    # what keys_of and create_model made has no source of its own: it stands in its setting, or in its base
    for cls in reversed(model.__mro__):
        made = "setting" in vars(cls) or cls.__name__ in [base.__name__ for base in cls.__bases__]
        if cls.__module__.startswith("icmj.") and not made:
            found |= read_attribute_docstrings(cls)
    return {key: words for key, words in found.items() if key in model.model_fields}
