"""What all tables of a run file share: unknown keys are errors, a value of another type is one, and numbers lie where
they can be computed with.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, Strict
from pydantic_core import PydanticCustomError

from icmj.work.own_code import REFERENCE

# far beyond anything physical, and near enough to 1 for squares and products to be numbers
SMALLEST, LARGEST = 1e-15, 1e12
MOST = 200  # entries of a list: more states, inputs or thresholds than can be computed with
Positive = Annotated[float, Field(ge=SMALLEST, le=LARGEST, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, le=LARGEST, allow_inf_nan=False)]
Finite = Annotated[float, Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Numbers = Annotated[list[Finite], Field(min_length=1, max_length=MOST)]
Positives = Annotated[list[Positive], Field(min_length=1, max_length=MOST)]
Matrix = Annotated[list[Numbers], Field(min_length=1, max_length=MOST)]
Weight = Literal["output", "identity"] | Numbers | Matrix
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

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)
