"""The JSON Schema of run and sweep files: it knows every key, says what it means, and takes every shipped file."""

import json
import tomllib
from typing import Any

import pytest

from icmj.cli.main import main
from icmj.runfile.editor_schema import SCHEMA_VERSION
from icmj.study.file_kinds import json_schema
from icmj.work.shipped import FAMILIES, RUNS, SWEEPS


def tables(schema: dict[str, Any], entry: dict[str, Any]) -> list[dict[str, Any]]:
    """Every object that an entry of the schema may be."""
    if "$ref" in entry:
        return tables(schema, schema["$defs"][entry["$ref"].rpartition("/")[2]])
    found = [entry] if "properties" in entry else []
    for one in (*entry.get("anyOf", ()), *entry.get("oneOf", ()), entry.get("items", {})):
        found += tables(schema, one) if one else []
    # an object without properties may have any, which older versions of pydantic leave unsaid
    if more := entry.get("additionalProperties", entry.get("type") == "object" and "properties" not in entry):
        found += [
            {"properties": {}, "more": {"properties": {}, "additionalProperties": True} if more is True else more}
        ]
    return found


def unknown(schema: dict[str, Any], entry: dict[str, Any], value: Any, at: str = "") -> list[str]:
    """Keys of a file that the schema does not know."""
    if isinstance(value, list):
        return [key for one in value for key in unknown(schema, entry, one, at)]
    if not isinstance(value, dict):
        return []
    known = tables(schema, entry)
    missing = []
    for key, inner in value.items():
        entries = [table["properties"].get(key, table.get("more")) for table in known]
        entries = [one for one in entries if one]
        missing += [] if entries else [f"{at}{key}"]
        if entries:
            missing += min((unknown(schema, one, inner, f"{at}{key}.") for one in entries), key=len)
    return missing


@pytest.mark.parametrize(("kind", "shelf"), [("run", RUNS), ("sweep", SWEEPS), ("family", FAMILIES)])
def test_every_key_of_the_shipped_files_is_known_and_described(kind, shelf):
    schema = json_schema(kind)
    files = sorted(shelf.folder.glob("*.toml"))
    assert len(files) >= 3
    for file in files:
        data = tomllib.loads(file.read_text(encoding="utf-8"))
        assert unknown(schema, schema, data) == [], file
        assert unknown(schema, schema, {**data, "extra": 1}) == ["extra"]
    for name, table in [("", schema), *schema["$defs"].items()]:
        for key, entry in table.get("properties", {}).items():
            assert entry.get("description"), f"{name}.{key}"


def test_the_command_prints_and_writes_it_with_its_version(tmp_path, capsys):
    assert main(["schema"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads(json.dumps(json_schema("run")))
    assert printed["$id"] == f"icmj:run:{SCHEMA_VERSION}"
    file = tmp_path / "sweep.schema.json"
    assert main(["schema", "sweep", "--out", str(file)]) == 0
    assert json.loads(file.read_text(encoding="utf-8"))["title"] == "icmj sweep file"
    assert main(["schema", "swep"]) == 2
    assert "expected experiment or family or run or sweep, got 'swep'" in capsys.readouterr().err
