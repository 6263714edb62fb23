"""What all tables of a file share: no unknown key, no value of another type, and numbers that can be computed with.

Many tables are a setting of the Python interface as a file writes it: a frozen dataclass, or a function. Its keys,
their bounds and their meaning are declared there; the table adds what only a file has.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from inspect import signature
from types import UnionType
from typing import Annotated, Any, ClassVar, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Strict,
    Tag,
    create_model,
    model_validator,
)
from pydantic_core import PydanticCustomError

from icmj.base.array import LARGEST, Finite, Matrix, Numbers
from icmj.errors import IcmjError
from icmj.work.own_code import REFERENCE

OWN = "own"  # tag of a table that names code as module:name


def is_list(annotation: Any) -> bool:
    """Whether a list is among what a key may be."""
    return any(get_origin(member) is list for member in members_of(annotation))


def members_of(annotation: Any) -> tuple[Any, ...]:
    """The members of a union, or the type itself; annotations taken off."""
    if get_origin(annotation) is Annotated:
        return members_of(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        return tuple(each for member in get_args(annotation) for each in members_of(member))
    return (annotation,)


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
                default = list(default) if isinstance(default, tuple) and is_list(hint) else default
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
