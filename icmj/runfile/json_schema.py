"""The JSON Schema of run files and the other files of icmj, with which editors complete and check them."""

from __future__ import annotations

import ast
import inspect
import textwrap
from typing import Any, Literal

from pydantic import BaseModel

from icmj.base.version import VERSION
from icmj.runfile.experiment_tables import ExperimentFile
from icmj.runfile.family_tables import FamilyFile
from icmj.runfile.schema import RunFile
from icmj.runfile.sweep_tables import SweepFile

SCHEMA_VERSION = 2
"""Rises with every change after which a file that was valid is not any more, or means something else."""
KINDS: dict[str, tuple[type[BaseModel], str]] = {
    "run": (RunFile, "icmj run file"),
    "sweep": (SweepFile, "icmj sweep file"),
    "experiment": (ExperimentFile, "icmj experiment file"),
    "family": (FamilyFile, "icmj family file"),
}


def json_schema(kind: Literal["run", "sweep", "experiment", "family"]) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a kind of file: every table and key with its meaning, bounds and default.

    What only the whole file shows, such as whether a joint has that name, is checked when the file is read.
    """
    model, title = KINDS[kind]
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
    for cls in reversed(model.__mro__):
        if not cls.__module__.startswith("icmj."):
            continue
        (body,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
        assert isinstance(body, ast.ClassDef)
        for key, said in zip(body.body, body.body[1:], strict=False):
            if not (isinstance(key, ast.AnnAssign) and isinstance(key.target, ast.Name)):
                continue
            if not (isinstance(said, ast.Expr) and isinstance(said.value, ast.Constant)):
                continue
            if (entry := record.get("properties", {}).get(key.target.id)) is not None:
                entry["description"] = " ".join(str(said.value.value).split())
