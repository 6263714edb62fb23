"""The kinds of files, and the JSON Schema of each, with which editors complete and check them."""

from __future__ import annotations

from importlib import import_module
from typing import Any, Literal

from icmj.runfile import editor_schema
from icmj.runfile.table import TomlTable

FileKind = Literal["run", "sweep", "experiment", "family"]
_SCHEMAS = {
    "run": "icmj.runfile.schema:RunFile",
    "sweep": "icmj.runfile.sweep_tables:SweepFile",
    "experiment": "icmj.study.experiment_file:ExperimentFile",
    "family": "icmj.fits.family_file:FamilyFile",
}


def schema_of(kind: FileKind) -> type[TomlTable]:
    """What a kind of file is read by; imported when asked for."""
    module, _, name = _SCHEMAS[kind].partition(":")
    found: type[TomlTable] = getattr(import_module(module), name)
    return found


def json_schema(kind: FileKind) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a kind of file: every table and key with its meaning, bounds and default."""
    return editor_schema.json_schema(schema_of(kind), kind, f"icmj {kind} file")
