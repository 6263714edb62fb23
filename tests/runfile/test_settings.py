"""A table that is a setting of the Python interface: its keys, their bounds and meanings are the setting's."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import pytest
from annotated_types import Len
from pydantic import ValidationError

from icmj.base.array import NonNegative, Positive, Seed
from icmj.errors import ModelError
from icmj.runfile.editor_schema import docstrings
from icmj.runfile.messages import in_words
from icmj.runfile.shapes.noise import NoiseTable
from icmj.runfile.table import TomlTable, check_by, keys_of, make


@dataclass(frozen=True)
class Base:
    """What a spring inherits.

    Attributes:
        rate: rate of the spring
            [N/m].
        r: r, in the paper's letter.
    """

    rate: Positive
    r: Seed = 0


@dataclass(frozen=True)
class Spring(Base):
    """A spring.

    Attributes:
        ends, rests: positions of its ends: two numbers [m].
        shares: shares by name.
        place: of the spring, which no file has.

    Raises:
        ModelError: if it is slack.
    """

    ends: tuple[NonNegative, NonNegative] = (0.0, 1.0)
    rests: Annotated[tuple[Positive, ...], Len(1, 2)] = (1.0,)
    shares: Mapping[str, Positive] = field(default_factory=dict)
    place: object = None

    def __post_init__(self) -> None:
        if self.ends[0] == self.ends[1]:
            raise ModelError("a spring is slack")


@keys_of(Spring, without=("place",))
class SpringTable(TomlTable):
    """A spring of a file."""

    kind: str
    """Kind of spring."""
    r: Seed
    own: float | None = None
    """What only a file has."""

    def spring(self) -> Spring:
        return make(Spring, self)

    _is_one = check_by("spring")


def test_the_keys_are_the_fields_and_those_of_the_table():
    assert set(SpringTable.model_fields) == {"kind", "own", "rate", "r", "ends", "rests", "shares"}
    required = {name for name, key in SpringTable.model_fields.items() if key.is_required()}
    assert required == {"kind", "rate", "r"}
    table = SpringTable(kind="steel", rate=2, r=1)
    assert table.spring() == Spring(rate=2, r=1)
    assert (SpringTable.__name__, SpringTable.__module__) == ("SpringTable", __name__)


def test_what_a_file_says_becomes_the_setting():
    data = {"kind": "steel", "rate": 2.0, "r": 3, "ends": [0.5, 2.0], "rests": [1.0, 2.0], "shares": {"a": 0.5}}
    made = SpringTable.model_validate(data).spring()
    assert made == Spring(2.0, 3, (0.5, 2.0), (1.0, 2.0), {"a": 0.5})
    assert make(Spring, SpringTable.model_validate(data), place="here", rests=(3.0,)).place == "here"


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"rate": 0.0}, "rate: must be greater than 0, got 0.0"),
        ({"rate": 1e13}, "rate: must be at most 1e+12, got 10000000000000.0"),
        ({"rate": float("nan")}, "rate: must be a finite number, got nan"),
        ({"rate": True}, "rate: expected a number, got true"),
        ({"r": 1.0}, "r: expected a whole number, got 1.0"),
        ({"ends": [0.0]}, "ends"),
        ({"ends": [0.0, -1.0]}, "ends[1]: must be at least 0, got -1.0"),
        ({"rests": []}, "rests: has 0 entries; expected at least 1"),
        ({"rests": [1.0] * 3}, "rests: has 3 entries; expected at most 2"),
        ({"shares": {"a": -1.0}}, "shares.a: must be greater than 0, got -1.0"),
        ({"place": 1.0}, "place: no such key"),
        ({"ends": [1.0, 1.0]}, "a spring is slack"),
    ],
)
def test_bounds_are_those_of_the_setting_and_what_it_refuses_is_told(wrong, words):
    with pytest.raises(ValidationError) as raised:
        SpringTable.model_validate({"kind": "steel", "rate": 1.0, "r": 0} | wrong)
    assert words in in_words(raised.value, SpringTable)


def test_meanings_are_those_of_the_docstring_unless_the_table_has_its_own():
    own = docstrings(NoiseTable)  # the docstrings under the keys of a table of icmj
    assert own["kind"] == "Kind of the disturbance."
    assert own["input"] == "Name of the input that is disturbed; give either ``input`` or ``body``."
    assert own["seed"] == "Seed of frequencies and phases."
    assert set(own) == set(NoiseTable.model_fields)
    assert docstrings(SpringTable) == {
        "rate": "Rate of the spring [N/m].",
        "r": "r, in the paper's letter.",
        "ends": "Positions of its ends: two numbers [m].",
        "rests": "Positions of its ends: two numbers [m].",
        "shares": "Shares by name.",
    }


def test_a_function_is_a_setting_too_and_each_key_may_be_optional():
    def weigh(mass: Positive, times: Sequence[Positive] = (1.0,), *, twice: bool = False) -> float:
        """Weigh.

        Args:
            mass: mass [kg].
            times: times.
            twice: whether twice.
        """
        return mass * sum(times) * (2 if twice else 1)

    @keys_of(weigh)
    class WeightTable(TomlTable):
        """A weight."""

    @keys_of(weigh, optional=True)
    class LooseTable(TomlTable):
        """A weight, or none."""

    assert WeightTable.model_fields["mass"].is_required()
    assert WeightTable.model_fields["times"].default == [1.0]
    assert make(weigh, WeightTable.model_validate({"mass": 2.0, "times": [1.0, 2.0], "twice": True})) == 12.0
    assert LooseTable().model_dump() == {"mass": None, "times": None, "twice": None}
