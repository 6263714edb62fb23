"""The kinds of files, and the JSON Schema of each, with which editors complete and check them."""

from __future__ import annotations

from typing import Any, Literal

from icmj.runfile import sweep_tables
from icmj.runfile.schema import RunFile
from icmj.runfile.sweep_tables import FamilyFile, SweepFile
from icmj.runfile.table import TomlTable
from icmj.study.experiment_file import ExperimentFile

KINDS: dict[str, tuple[type[TomlTable], str]] = {
    "run": (RunFile, "icmj run file"),
    "sweep": (SweepFile, "icmj sweep file"),
    "experiment": (ExperimentFile, "icmj experiment file"),
    "family": (FamilyFile, "icmj family file"),
}


def json_schema(kind: Literal["run", "sweep", "experiment", "family"]) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a kind of file: every table and key with its meaning, bounds and default."""
    model, title = KINDS[kind]
    return sweep_tables.json_schema(model, kind, title)
