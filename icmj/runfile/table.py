"""What all tables of a run file share.

Unknown keys are errors, a value of another type is one, and numbers lie where they can be computed with.

Many tables are a setting of the Python interface as a file writes it: a frozen dataclass. Its keys, their bounds and
their meaning are declared there; the table adds what only a file has.

pydantic says what a value is not, once for each member of a union. Here every wrong key gets one sentence: what it
may be, what it is, and for a key that does not exist the one that was probably meant.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from datetime import date, time
from inspect import signature
from types import NoneType, UnionType
from typing import Annotated, Any, ClassVar, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Strict,
    Tag,
    ValidationError,
    create_model,
    model_validator,
)
from pydantic_core import PydanticCustomError

from icmj.base.array import LARGEST, Finite, Matrix, Numbers
from icmj.base.text import find_nearest, suggest
from icmj.errors import IcmjError
from icmj.work.own_code import REFERENCE

OWN = "own"  # tag of a table that names code as module:name
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
        members = [a for a in _members(annotation) if a is not NoneType]
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
        named = [tag for model in _members(annotation) if (tag := tag_of(model))]
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
    members = [model for model in _members(annotation) if hasattr(model, "model_fields")]
    if len(members) != 1:
        return f"{place_in_words(place)} is missing"
    needed = [name for name, field in members[0].model_fields.items() if field.is_required()]
    verb = "is" if len(needed) == 1 else "are"
    more = f"; {' and '.join(needed)} {verb} required" if needed else ""
    return f"the table [{place_in_words(place)}] is missing{more}"


def _unknown(key: str, table: _Place, schema: type[BaseModel]) -> str:
    annotation = _resolve(table, schema)[2]
    models = [model for model in _members(annotation) if hasattr(model, "model_fields")]
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
        for model in _members(field.annotation):
            tables.setdefault(name, []).extend(getattr(model, "model_fields", {}))
    return tables


def _describe_allowed(annotation: Any) -> str:
    """The values that are allowed: ``'output', 'identity' or a list of numbers``."""
    parts: list[str] = []
    for member in _members(annotation):
        if get_origin(member) is Literal:
            parts += [repr(choice) for choice in get_args(member)]
        elif get_origin(member) is list:
            inner = get_args(member)[0]
            parts.append("a list of lists of numbers" if _is_list(inner) else f"a list of {_plural(inner)}")
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
    return " or ".join(kinds.get(member, "tables") for member in _members(annotation))


def _is_list(annotation: Any) -> bool:
    return any(get_origin(member) is list for member in _members(annotation))


def _choices(annotation: Any) -> list[object]:
    return [c for member in _members(annotation) if get_origin(member) is Literal for c in get_args(member)]


def _either(parts: Sequence[str]) -> str:
    return f"{', '.join(parts[:-1])} or {parts[-1]}" if len(parts) > 1 else "".join(parts)


def _list_values(names: Sequence[str]) -> str:
    return ", ".join(names) if names else "none here"


def _members(annotation: Any) -> tuple[Any, ...]:
    """The members of a union, or the type itself; annotations taken off."""
    if get_origin(annotation) is Annotated:
        return _members(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        return tuple(each for member in get_args(annotation) for each in _members(member))
    return (annotation,)


def _element(annotation: Any) -> Any:
    lists = [get_args(member)[0] for member in _members(annotation) if get_origin(member) in (list, tuple)]
    return Union[tuple(lists)] if lists else annotation  # noqa: UP007


def tag_of(model: Any) -> str | None:
    """By what a table is told from others: its tag, else its ``kind``; ``None`` if it has neither."""
    if (own := getattr(model, "tag", None)) is not None:
        return str(own)
    field = getattr(model, "model_fields", {}).get("kind")
    return str(get_args(field.annotation)[0]) if field is not None and get_args(field.annotation) else None


def kind_of(table: Any) -> str | None:
    """The kind of a table, or of data that are to be one: ``own`` where it names code; ``None`` without one."""
    kind = table.get("kind") if isinstance(table, Mapping) else getattr(table, "kind", None)
    return OWN if isinstance(kind, str) and ":" in kind else None if kind is None else str(kind)


def one_of(tables: Sequence[type[TomlTable]], tell: Callable[[Any], str | None] = kind_of, **messages: Any) -> Any:
    """The type of a table that is one of these.

    Args:
        tables: each with a ``kind`` of its own, or with a tag.
        tell: the kind, or the tag, of the one that data are to be.
        messages: those of pydantic's ``Discriminator``, for data that are none of them.
    """
    members = tuple(Annotated[table, Tag(str(tag_of(table)))] for table in tables)
    return Annotated[Union[members], Discriminator(tell, **messages)]  # noqa: UP007


Interval = Annotated[float, Field(ge=1e-6, le=1e4, allow_inf_nan=False)]
Reference = Annotated[str, Field(pattern=REFERENCE, max_length=200)]
Whole = Annotated[int, Field(ge=-int(LARGEST), le=int(LARGEST))]
Parameters = dict[str, bool | Whole | Finite | str | Numbers | Matrix]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=80)]
Line = Annotated[str, Field(max_length=1000, pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")]


LISTED = Strict(False)
"""Of a tuple: TOML has lists alone. Its entries are as strict as all others."""


def _whole(value: object) -> object:
    if isinstance(value, bool | float):
        raise PydanticCustomError("literal_error", "not a whole number")
    return value


CHOICE = BeforeValidator(_whole)
"""Of a literal of whole numbers: it is found by equality, and true and 1.0 are equal to 1."""


class TomlTable(BaseModel):
    """Base of all tables: unknown keys are errors, values do not change.

    Types are those of TOML: a whole number is a number, too, but neither truth nor text is.
    """

    # built when they are first read: most tables are read as parts of others alone
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False, defer_build=True)

    setting: ClassVar[Callable[..., Any] | None] = None
    """The dataclass, or the function, whose parameters are keys of the table, if there is one."""


Table = TypeVar("Table", bound=TomlTable)
Setting = TypeVar("Setting")


def keys_of(
    setting: Callable[..., Any], *, without: Sequence[str] = (), optional: bool = False
) -> Callable[[type[Table]], type[Table]]:
    """Decorator of a table: what a setting is made of are its keys, too, with their bounds, defaults and meanings.

    Args:
        setting: a dataclass, or a function. What the table declares itself is as the table has it.
        without: parameters that no file has.
        optional: whether each key may be left out, and is then ``None``.
    """

    def decorate(table: type[Table]) -> type[Table]:
        hints, keys = get_type_hints(setting, include_extras=True), dict[str, Any]()
        factories = {field.name: field.default_factory for field in fields(setting)} if is_dataclass(setting) else {}
        for name, parameter in signature(setting).parameters.items():
            if name not in (*table.model_fields, *without):
                hint, default = _as_read(hints[name]), parameter.default
                if (factory := factories.get(name, MISSING)) is not MISSING:
                    default = factory()
                default = list(default) if isinstance(default, tuple) and _is_list(hint) else default
                keys[name] = (hint | None, None) if optional else (hint, ... if default is parameter.empty else default)
        whole = create_model(table.__name__, __base__=table, __module__=table.__module__, __doc__=table.__doc__, **keys)
        whole.setting = setting
        return whole

    return decorate


def _as_read(hint: Any) -> Any:
    """A type as TOML has it: lists instead of tuples whose length is free, and tables instead of mappings."""
    origin, inside = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return Annotated[(_as_read(inside[0]), *inside[1:])]
    if origin in (Union, UnionType):
        return Union[tuple(map(_as_read, inside))]  # noqa: UP007
    if origin is Sequence or inside[-1:] == (...,):
        return list[_as_read(inside[0])]  # type: ignore[misc]
    if origin is tuple:
        return Annotated[hint, LISTED]
    return dict[inside[0], _as_read(inside[1])] if origin is Mapping else hint  # type: ignore[misc, valid-type]


def make(setting: Callable[..., Setting], table: TomlTable, **more: Any) -> Setting:
    """What a table stands for: made of its keys that have a value, and of ``more``."""
    given = {name: getattr(table, name, None) for name in signature(setting).parameters}
    plain = {key: tuple(value) if isinstance(value, list) else value for key, value in given.items()}
    return setting(**{key: value for key, value in plain.items() if value is not None} | more)


def check_by(method: str) -> Any:
    """Validator of a table that calls a method, which makes a setting: what that refuses is told of the table."""

    def check(table: Table) -> Table:
        try:
            getattr(table, method)()
        except IcmjError as error:
            raise ValueError(re.sub("^activation: ", "", str(error))) from error
        return table

    return model_validator(mode="after")(check)
