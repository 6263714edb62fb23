"""What is wrong with a file, in words: one sentence for every wrong key.

pydantic says what a value is not, once for each member of a union. Here a key has one sentence: what it may be, what it
is, and where it does not exist the one that was probably meant.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date, time
from types import NoneType
from typing import Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from icmj.base.similar_names import find_nearest, suggest
from icmj.runfile.table import OWN, is_list, members_of, tag_of

MOST_SENTENCES = 20  # sentences in one message; a list of a thousand wrong numbers is told by its first ones
_BOUNDS = {
    "greater_than": ("gt", "must be greater than"),
    "greater_than_equal": ("ge", "must be at least"),
    "less_than": ("lt", "must be less than"),
    "less_than_equal": ("le", "must be at most"),
}
_KINDS = {float: "a number", int: "a whole number", str: "text", bool: "true or false"}
_Place = tuple[int | str, ...]


def in_words(error: ValidationError, schema: type[BaseModel]) -> str:
    """All errors, one sentence for each key, in the order of the schema."""
    by_place: dict[_Place, list[tuple[_Place, Mapping[str, Any], Any]]] = {}
    for each in error.errors(include_url=False):
        place, fork, annotation = _resolve(each["loc"], schema)
        by_place.setdefault(place[:fork], []).append((place, each, annotation))
    sentences = [_sentence(place, found, schema) for place, found in by_place.items()]
    shown = list(dict.fromkeys(sentences))
    left = len(shown) - MOST_SENTENCES
    return "; ".join(shown[:MOST_SENTENCES]) + (f"; and {left} more of the kind" if left > 0 else "")


def place_in_words(place: Sequence[int | str]) -> str:
    """``design.R_c[2]`` of ("design", "R_c", 2)."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in place)
    return text.removeprefix(".") or "file"


def short(value: object, longest: int = 60) -> str:
    """A value approximately as in TOML, cut at ``longest`` characters."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        value = list(value[:longest])
    elif isinstance(value, dict):
        value = dict(list(value.items())[:longest])
    elif isinstance(value, str):
        value = value[: 2 * longest]
    elif isinstance(value, date | time):
        return value.isoformat()
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # an integer with thousands of digits, a list in a list in a list …
        return "a value too long to show"
    return text if len(text) <= longest else text[: longest - 1] + "…"


def _resolve(loc: _Place, schema: type[BaseModel]) -> tuple[_Place, int | None, Any]:
    """The part of pydantic's place that is in the file, without names of union members; what is expected there.

    Errors of all members of a union are told together, so it also returns how long the place is where they fork.
    """
    place: list[int | str] = []
    fork: int | None = None
    annotation: Any = schema
    for part in loc:
        members = [a for a in members_of(annotation) if a is not NoneType]
        models = [a for a in members if isinstance(a, type) and issubclass(a, BaseModel)]
        tables = [a for a in members if get_origin(a) is dict]
        if isinstance(part, int):
            place.append(part)
            annotation = _element(annotation)
        elif len(models) > 1 and part in {
            tag_of(model) for model in models
        }:  # first: "file" is a kind, and a key of it
            annotation = next(model for model in models if tag_of(model) == part)
        elif models and any(part in model.model_fields for model in models):
            place.append(part)
            annotation = next(m.model_fields[part].annotation for m in models if part in m.model_fields)
        elif models and len(models) == len(members):
            place.append(part)  # a key that does not exist
        elif tables and len(members) == 1:
            place.append(part)
            annotation = get_args(tables[0])[1]
        else:  # the name of a union's member, which is not in the file
            fork = len(place) if fork is None else fork
            if tables and part.startswith("dict["):
                annotation = tables[0]
    return tuple(place), fork, annotation


def _sentence(place: _Place, found: list[tuple[_Place, Mapping[str, Any], Any]], schema: type[BaseModel]) -> str:
    deepest = max(len(where) for where, _, _ in found)
    inside = [entry for entry in found if len(entry[0]) == deepest]
    # what is of the right kind, and beyond a bound, is what is wrong
    beyond = [entry for entry in inside if entry[1]["type"] in _BOUNDS]
    where, each, annotation = (beyond or inside)[0]
    if beyond and len({entry[0] for entry in inside}) == 1:
        inside = beyond[:1]
    if len(inside) > 1 and len({entry[0] for entry in inside}) > 1 and len(found) > len(inside):
        where, annotation = place, _resolve(place, schema)[2]
        inside = found
    if len(inside) > 1 and len({entry[1]["type"] for entry in inside}) > 1:
        got = each["input"] if where == inside[0][0] else None
        shown = f"; got {short(got)}" if got is not None else ""
        return f"{place_in_words(where)}: expected {_describe_allowed(annotation)}{shown}"
    if each["type"] == "missing":
        return _missing(where, annotation)
    return f"{place_in_words(where)}: {_words(where, each, annotation, schema)}"


def _words(where: _Place, error: Mapping[str, Any], annotation: Any, schema: type[BaseModel]) -> str:
    kind, context, got = error["type"], error.get("ctx", {}), error["input"]
    if kind == "missing":
        return "is missing"
    if kind == "extra_forbidden":
        return _unknown(str(where[-1]), error["loc"][:-1], schema)  # with the kind of the table, where it has one
    if kind in _BOUNDS:
        key, words = _BOUNDS[kind]
        bound = context[key]
        if isinstance(got, int | float) and got <= 0 < bound and key in ("ge", "gt") and bound < 1:
            return f"must be greater than 0, got {short(got)}"
        return f"{words} {bound:g}, got {short(got)}"
    if kind == "finite_number":
        return f"must be a finite number, got {short(got)}"
    if kind in ("too_long", "too_short"):
        few = kind == "too_short"
        bound = context["min_length" if few else "max_length"]
        return f"has {len(got)} entries; expected at {'least' if few else 'most'} {bound}"
    if kind == "string_too_long":
        return f"is longer than {context['max_length']} characters"
    if kind == "string_pattern_mismatch":
        pattern = context["pattern"]
        what = "holds control characters" if r"\x00" in pattern else f"does not match the pattern {pattern}"
        return f"{what}, got {short(got)}"
    if kind == "controller_kind":
        return str(error["msg"])
    if kind == "value_error":
        return str(context.get("error", error["msg"]))
    if kind in ("union_tag_not_found", "union_tag_invalid"):
        name = "kind"  # by which all tables are told apart
        named = [tag for model in members_of(annotation) if (tag := tag_of(model))]
        tags = [tag for tag in named if tag != OWN]
        code = [] if len(tags) == len(named) else ["the module:name of code of your own"]
        if isinstance(got, dict) and name not in got:
            return f"{name} is missing; it is {_either([*map(repr, tags), *code])}"
        got = got.get(name) if isinstance(got, dict) else got
        hint = suggest(str(got), tags)
        return f"{name} must be {_either([*map(repr, tags), *code])}, got {short(got)}{hint}"
    if kind == "literal_error":
        choices = [str(choice) for choice in _choices(annotation)]
        return f"expected {_describe_allowed(annotation)}, got {short(got)}{suggest(str(got), choices)}"
    return f"expected {_describe_allowed(annotation)}, got {short(got)}"


def _missing(place: _Place, annotation: Any) -> str:
    """What is missing, and of a table, which of its keys are required."""
    members = [model for model in members_of(annotation) if hasattr(model, "model_fields")]
    if len(members) != 1:
        return f"{place_in_words(place)} is missing"
    needed = [name for name, field in members[0].model_fields.items() if field.is_required()]
    verb = "is" if len(needed) == 1 else "are"
    more = f"; {' and '.join(needed)} {verb} required" if needed else ""
    return f"the table [{place_in_words(place)}] is missing{more}"


def _unknown(key: str, table: _Place, schema: type[BaseModel]) -> str:
    annotation = _resolve(table, schema)[2]
    models = [model for model in members_of(annotation) if hasattr(model, "model_fields")]
    keys = [name for model in models for name in model.model_fields]
    inner = {one: f"{name}.{one}" for model in models for name, ones in _tables(model).items() for one in ones}
    near = suggest(key, keys)
    if not near and table and key in inner:
        near = f"; did you mean {_path(table)}{inner[key]}?"
    if not near and any(key in names for names in _tables(schema).values()):
        homes = [f"[{name}]" for name, names in _tables(schema).items() if key in names]
        near = f"; it belongs in {' or '.join(homes)}"
    if not near and table and (found := find_nearest(key, inner)):
        near = f"; did you mean {_path(table)}{inner[found]}?"
    if key == "b" and not table:
        near = "; b is actual.gain"
    return f"no such key{near or f'; there are {_list_values(sorted(keys))}'}"


def _path(table: _Place) -> str:
    """A table's dotted key, with a dot behind it; empty where an entry of a list is on the way."""
    return "" if any(isinstance(part, int) for part in table) else "".join(f"{part}." for part in table)


def _tables(schema: type[BaseModel]) -> dict[str, list[str]]:
    tables: dict[str, list[str]] = {}
    for name, field in schema.model_fields.items():
        for model in members_of(field.annotation):
            tables.setdefault(name, []).extend(getattr(model, "model_fields", {}))
    return tables


def _describe_allowed(annotation: Any) -> str:
    """The values that are allowed: ``'output', 'identity' or a list of numbers``."""
    parts: list[str] = []
    for member in members_of(annotation):
        if get_origin(member) is Literal:
            parts += [repr(choice) for choice in get_args(member)]
        elif get_origin(member) is list:
            inner = get_args(member)[0]
            parts.append("a list of lists of numbers" if is_list(inner) else f"a list of {_plural(inner)}")
        elif get_origin(member) is tuple:
            parts.append(f"a list of {len(get_args(member))} {_plural(get_args(member)[0])}")
        elif get_origin(member) is dict:
            parts.append("a table of names and values")
        elif isinstance(member, type) and issubclass(member, BaseModel):
            parts.append("a table")
        elif member is not NoneType:
            parts.append(_KINDS.get(member, str(member)))
    return _either(list(dict.fromkeys(parts))) or "something else"


def _plural(annotation: Any) -> str:
    kinds = {float: "numbers", int: "whole numbers", str: "texts", bool: "true or false", Any: "values"}
    if choices := _choices(annotation):
        return _either([repr(choice) for choice in choices])
    return " or ".join(kinds.get(member, "tables") for member in members_of(annotation))


def _choices(annotation: Any) -> list[object]:
    return [c for member in members_of(annotation) if get_origin(member) is Literal for c in get_args(member)]


def _either(parts: Sequence[str]) -> str:
    return f"{', '.join(parts[:-1])} or {parts[-1]}" if len(parts) > 1 else "".join(parts)


def _list_values(names: Sequence[str]) -> str:
    return ", ".join(names) if names else "none here"


def _element(annotation: Any) -> Any:
    lists = [get_args(member)[0] for member in members_of(annotation) if get_origin(member) in (list, tuple)]
    return Union[tuple(lists)] if lists else annotation  # noqa: UP007
