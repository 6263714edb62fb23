"""Every key of every kind of file: a value of another type is refused in one line, and a whole number is a number."""

import tomllib
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np
import pytest
from pydantic import BaseModel
from terminal_cases import told

import icmj
from icmj.cli.main import main
from icmj.errors import RunFileError
from icmj.fits.family_file import FamilyFile, load_family_file
from icmj.runfile.reading import load_run
from icmj.runfile.schema import RunFile, to_toml
from icmj.runfile.sweep_tables import SweepFile, load_sweep
from icmj.study.experiment_file import ExperimentFile, load_experiment
from icmj.study.file_kinds import json_schema
from icmj.work.shipped import EXPERIMENTS, FAMILIES, RUNS, SWEEPS

ROOT = Path(__file__).resolve().parents[2]
SCHEMAS: dict[str, type[BaseModel]] = {
    "run": RunFile, "sweep": SweepFile, "experiment": ExperimentFile, "family": FamilyFile,
}  # fmt: skip
LOADS = {"run": load_run, "sweep": load_sweep, "experiment": load_experiment, "family": load_family_file}
SHELVES = {"run": RUNS, "sweep": SWEEPS, "experiment": EXPERIMENTS, "family": FAMILIES}
COMMANDS = {
    "run": ["analyse"], "sweep": ["sweep"], "experiment": ["experiment"],
    "family": ["fit", str(ROOT / "examples" / "standing.csv"), "--rate", "100", "--model"],
}  # fmt: skip
OTHERS = (True, 1, 1.5, "0.2", date(2020, 1, 1), [], {})
Place = tuple[str | int | dict[str, Any], ...]
"""Keys, the number of an entry of a list, and the keys by which the table around it is found to be of its kind."""


def members(annotation: Any) -> tuple[Any, ...]:
    if get_origin(annotation) is Annotated:
        return members(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        return tuple(each for member in get_args(annotation) for each in members(member))
    return () if annotation is NoneType else (annotation,)


def is_table(member: Any) -> bool:
    return isinstance(member, type) and issubclass(member, BaseModel)


def places(annotations: tuple[Any, ...], at: Place = ()) -> Iterator[tuple[Place, tuple[Any, ...]]]:
    """Every place that can be written, and what may stand there."""
    yield at, annotations
    inner = [get_args(each)[0] for each in annotations if get_origin(each) in (list, tuple)]
    if inner:
        yield from places(tuple(each for one in inner for each in members(one)), (*at, 0))
    for each in annotations:
        if get_origin(each) is dict:
            names = get_args(get_args(each)[0]) or ("ankle",)
            yield from places(members(get_args(each)[1]), (*at, names[0]))
        if is_table(each):
            for name, field in each.model_fields.items():
                kind = known_by(each) if name != "kind" else {}
                yield from places(members(field.annotation), (*at, kind, name))


def known_by(table: type[BaseModel]) -> dict[str, Any]:
    tag, field = getattr(table, "tag", None), table.model_fields.get("kind")
    if tag == "own":
        return {"kind": "module:name"}
    more = {"channel": []} if tag == "channels" else {}
    return more if field is None else {"kind": get_args(field.annotation)[0], **more}


def written(at: Place, value: Any) -> Any:
    """Data with a value at a place, and as little as possible around it."""
    for part in reversed(at):
        if isinstance(part, int):
            value = [value]
        elif isinstance(part, str):
            value = {part: value}
        else:
            value = {**part, **value}
    return value


def may_be(value: Any, annotations: tuple[Any, ...]) -> bool:
    for each in annotations:
        if get_origin(each) is Literal:
            if any(type(value) is type(choice) and value == choice for choice in get_args(each)):
                return True
            continue
        origin = dict if is_table(each) else get_origin(each) or each
        kinds = {float: (int, float), tuple: (list,), Any: (object,)}.get(origin, (origin,))
        if any(type(value) is one or one is object for one in kinds):
            return True
    return False


def name_of(at: Place) -> str:
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in at if not isinstance(part, dict))
    return text.removeprefix(".")


def each_place(kind: str) -> list[tuple[Place, tuple[Any, ...]]]:
    schema = SCHEMAS[kind]
    return [
        found
        for name, field in schema.model_fields.items()
        for found in places(members(field.annotation), (name,))
        if name_of(found[0]) != "simulation.native"
    ]


def refusal(kind: str, at: Place, value: Any) -> str:
    try:
        SCHEMAS[kind].validated(written(at, value), Path("file.toml"))  # type: ignore[attr-defined]
    except RunFileError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("kind", SCHEMAS)
def test_a_value_of_another_type_is_refused_at_every_key(kind: str) -> None:
    wrong, keys = 0, each_place(kind)
    for at, kinds in keys:
        for value in OTHERS:
            if may_be(value, kinds):
                continue
            wrong += 1
            said = refusal(kind, at, value)
            where = name_of(at) if at[-1] != "kind" else name_of(at[:-1])
            assert where in said, f"{name_of(at)} = {value!r}: {said or 'accepted'}"
            assert "\n" not in said
    assert len(keys) > {"run": 300, "sweep": 25, "experiment": 80, "family": 20}[kind]
    assert wrong > 2 * len(keys)


@pytest.mark.parametrize("kind", SCHEMAS)
def test_a_whole_number_is_a_number_and_a_truth_where_one_is_meant(kind: str) -> None:
    """So that the test above does not pass because everything is refused."""
    for at, kinds in each_place(kind):
        for value, of in ((1, float), (1.5, float), (1, int), (True, bool), ("a", str)):
            if of in kinds:
                said = refusal(kind, at, value)
                # a word of its pattern, or a number beyond its bounds, is of the type
                assert f"{name_of(at)}: expected" not in said or str in kinds, said


@pytest.mark.parametrize("kind", SCHEMAS)
def test_the_command_refuses_it_in_one_line(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """A value of another type put into a shipped file: status 2, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    shipped = next(iter(SHELVES[kind].files.values())).read_text(encoding="utf-8")
    file, seen = tmp_path / "file.toml", 0
    for at, kinds in each_place(kind):
        *way, last = [part for part in at if part != {}]
        value = next((value for value in OTHERS if not may_be(value, kinds)), None)
        data = tomllib.loads(shipped)
        inside: Any = data
        for part in way:
            inside = inside.get(part) if isinstance(inside, dict) and isinstance(part, str) else None
        if value is None or not isinstance(inside, dict):  # a table that this file does not have
            continue
        seen += 1
        inside[last] = value
        file.write_text(to_toml(data), encoding="utf-8")
        status, err = main([*COMMANDS[kind], str(file)]), capfd.readouterr().err
        assert (status, len(told(err))) == (2, 1), f"{name_of(at)} = {value!r}: {err}"
        assert str(last) in err
    assert seen > 5
    assert {path.name for path in tmp_path.iterdir()} == {"file.toml"}


@pytest.mark.parametrize(
    "change",
    [
        *("controller.delta_min=true", "assumed.delay='0.2'", 'assumed.delay="0.2"', "assumed.activation.order=true"),
        *("study.growth_points=3.0", "study.growth_points=true", "case.title=7", "simulation.duration=1979-05-27"),
        *("case.paper.cycle=1", "case.paper.eigenvalue=true", "case.paper.eigenvalue=1.0", "actual.gain=[true]"),
        *("simulation.limit=07:32:00", "simulation.integrator=4", "analysis.allow=true", "design.Q_c=[['1']]"),
    ],
)  # fmt: skip
def test_so_does_a_value_for_once(change: str, capfd: pytest.CaptureFixture[str]) -> None:
    status, err = main(["analyse", "three-link-0.9", "--set", change]), capfd.readouterr().err
    assert (status, len(told(err))) == (2, 1), err
    assert change.partition("=")[0] in err


@pytest.mark.parametrize("value", ["[true, false]", '["0.1", "0.2"]', "[1979-05-27, 1979-05-28]"])
def test_so_does_an_axis_of_a_sweep(value: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "sweep.toml"
    file.write_text(
        f'[sweep]\nname = "a"\nrun = "three-link-0.9"\n[[vary]]\nfield = "controller.delta_min"\nvalues = {value}\n'
    )
    status, err = main(["sweep", str(file), "--out", str(tmp_path / "out")]), capfd.readouterr().err
    assert (status, len(told(err))) == (2, 1), err
    assert "controller.delta_min: expected a number" in err


def test_an_axis_of_whole_numbers_may_be_that_of_a_seed(tmp_path: Path) -> None:
    from icmj.study.plan import Plan

    text = """
    [[set.simulation.disturbance]]
    kind = "noise"
    input = "ankle_torque"
    size = 1.0
    bandwidth = 2.0
    seed = 4
    [sweep]
    name = "a"
    run = "three-link-0.9"
    [[vary]]
    field = "simulation.disturbance[0].seed"
    low = 0
    high = 4
    count = %d
    """
    file = SweepFile.validated(tomllib.loads(text % 5), tmp_path / "sweep.toml")
    plan = Plan.of(file)
    assert [plan.run(plan.points.at(i)).simulation.disturbance[0].seed for i in range(5)] == [0, 1, 2, 3, 4]  # type: ignore[union-attr]
    file = SweepFile.validated(tomllib.loads(text % 4), tmp_path / "sweep.toml")
    with pytest.raises(RunFileError, match="seed: expected a whole number, got 1"):
        Plan.of(file)


@pytest.mark.parametrize("kind", SCHEMAS)
def test_shipped_files_are_read(kind: str) -> None:
    for name in SHELVES[kind].files:
        LOADS[kind](name)


def test_numbers_of_numpy_are_numbers_in_python() -> None:
    run = load_run("three-link-0.9")
    same = run.with_(**{"actual.gain": 0.9, "study.growth_points": 3, "assumed.person.stiffness": [0.0, 1.0, 1.0]})
    for gain, points in ((np.float64(0.9), np.int64(3)), (np.array(0.9), np.uint8(3))):
        assert same == run.with_(
            **{"actual.gain": gain, "study.growth_points": points, "assumed.person.stiffness": (0, np.float32(1), 1)}
        )
    with pytest.raises(RunFileError, match="growth_points: expected a whole number, got true"):
        run.with_(**{"study.growth_points": np.True_})


KINDS = {"number": (int, float), "integer": (int,), "string": (str,), "boolean": (bool,), "array": (list,)}


def admits(schema: dict[str, Any], entry: dict[str, Any], value: Any) -> bool:
    """Whether a JSON Schema admits a value as far as types go: for a table, of the keys that it has."""
    if "$ref" in entry:
        return admits(schema, schema["$defs"][entry["$ref"].rpartition("/")[2]], value)
    forks = entry.get("anyOf", entry.get("oneOf"))
    if forks is not None:
        return any(admits(schema, fork, value) for fork in forks)
    if isinstance(value, dict) and entry.get("type") == "object":
        known, more = entry.get("properties", {}), entry.get("additionalProperties", True)
        inner = ((known.get(key, more), each) for key, each in value.items())
        return all(admits(schema, one, each) if isinstance(one, dict) else one for one, each in inner)
    if isinstance(value, list) and entry.get("type") == "array":
        of = entry.get("prefixItems", [entry.get("items", {})])[0]
        return all(admits(schema, of, each) for each in value)
    choices = entry.get("enum", [entry["const"]] if "const" in entry else None)
    if choices is not None:
        return any(type(value) is type(choice) and value == choice for choice in choices)
    return "type" not in entry or type(value) in KINDS.get(entry["type"], ())


@pytest.mark.parametrize("kind", SCHEMAS)
def test_the_json_schema_refuses_the_same(kind: str) -> None:
    schema, seen = json_schema(kind), set()  # type: ignore[arg-type]
    for at, kinds in each_place(kind):
        for value in (True, 1, 1.5, "0.2"):
            seen.add(there := may_be(value, kinds))
            if at[-1] != "kind":
                assert admits(schema, schema, written(at, value)) == there, f"{name_of(at)} = {value!r}"
    assert seen == {True, False}


@pytest.mark.parametrize("entry", ["true", '"0.2"', "[true, 1]"])
def test_so_does_a_file_of_matrices(entry: str, tmp_path: Path) -> None:
    (tmp_path / "plant.json").write_text(f'{{"A": [[0, 1], [1, 0]], "B": [0, 1], "C": [1, {entry}]}}', encoding="utf-8")
    run = RunFile.validated(
        {
            "case": {"name": "a", "title": "A"},
            "assumed": {"matrices": "plant.json"},
            "controller": {"q_t": 0.1},
        },
        tmp_path / "run.toml",
    )
    with pytest.raises(RunFileError, match="C is not a matrix"):
        icmj.prepare(run)


@pytest.mark.parametrize("value", ["true", "2020-01-01", "text"])
def test_so_does_a_recording(value: str, tmp_path: Path) -> None:
    """A column of anything else is none of numbers, and one that is asked for says so."""
    rows = "".join(f"{i / 100},{i % 7},{value}\n" for i in range(20))
    (tmp_path / "a.csv").write_text(f"t,y,flag\n{rows}", encoding="utf-8")
    assert icmj.read_series(tmp_path / "a.csv").names == ("y",)
    (tmp_path / "b.csv").write_text("t,y\n" + "".join(f"{i / 100},{i % 7}\n" for i in range(20)) + f"0.2,{value}\n")
    with pytest.raises(icmj.errors.DataError):
        icmj.read_series(tmp_path / "b.csv")
