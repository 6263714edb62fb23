"""What ``sweep.json`` says that a sweep's folder is of, read as what nobody vouches for."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError, model_validator

from icmj.runfile.sweep_tables import MOST_POINTS
from icmj.runfile.table import Name

_Word = Annotated[str, StringConstraints(max_length=300, pattern=r"^[^\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]*$")]


class Facts(BaseModel):
    """What a folder says that it is of.

    Attributes:
        fingerprint: of all that decides what comes out.
        name, title: of the sweep file.
        points: how many there are to be.
        chunk: points of one file.
        varies: columns of what varies.
        fields: of the run file that they are, "" for a change of the model.
        outputs: of the plant.
        measures: names of the numbers of the user's own measures.
        units: of what varies and of the outputs, by name, where they are known.
        versions: of what computed, by package.
    """

    model_config = ConfigDict(strict=True, frozen=True)
    fingerprint: Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{16}$")]
    name: Name
    title: _Word
    points: Annotated[int, Field(ge=1, le=MOST_POINTS)]
    chunk: Annotated[int, Field(ge=1, le=100_000)]
    varies: list[_Word]
    fields: list[_Word]
    outputs: list[_Word]
    measures: list[_Word] = []
    units: dict[str, _Word] = {}
    versions: dict[str, _Word]

    @model_validator(mode="after")
    def _fit(self) -> Facts:
        if len(self.varies) != len(self.fields):
            raise ValueError("varies and fields differ in length")
        return self

    @property
    def chunks(self) -> int:
        """How many files there are to be."""
        return -(-self.points // self.chunk)

    def rows(self, chunk: int) -> range:
        """The points of one of them, by index."""
        return range(chunk * self.chunk, min((chunk + 1) * self.chunk, self.points))


def parse_facts(content: bytes) -> Facts:
    """The facts in JSON text.

    Raises:
        ValueError: in one line, if there are none.
    """
    try:
        return Facts.model_validate_json(content)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise ValueError(f"{where}: {first['msg']}" if where else first["msg"]) from error
