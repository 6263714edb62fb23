"""A plant by its matrices in a run file: written out, or in a file beside it."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import model_validator

from icmj.runfile.table import Matrix, Numbers, TomlTable

LETTERS = ("A", "B", "C")


class MatrixTable(TomlTable):
    """ẋ = A x + B u, y = C x; states, inputs and outputs are named in the keys of these names, in order."""

    A: Matrix | None = None
    """State matrix of a plant given by matrices, row by row."""
    B: Matrix | Numbers | None = None
    """Input matrix, row by row; for a single input, also a list of its entries."""
    C: Matrix | Numbers | None = None
    """Output matrix, row by row; for a single output, also a list of its entries."""
    B_d: Matrix | Numbers | None = None
    """Effect of a push of size 1 along each input, independent of the input gain, in the form of B (default: B)."""
    matrices: str | None = None
    """File with A, B, C, optionally B_d, and names, relative to the run file: ``.npz``, or ``.json`` as printed by
    ``icmj linearise --json``."""
    units: dict[str, str] = {}
    """Units of states, inputs and outputs of a plant given by matrices, by name."""

    @property
    def given(self) -> bool:
        """Whether it gives a plant by matrices."""
        return self.matrices is not None or any(getattr(self, letter) is not None for letter in LETTERS)

    def refuse(self, foreign: Sequence[str], what: str) -> None:
        """Refuse these keys if they are present.

        Raises:
            ValueError: at the first that is.
        """
        for name in foreign:
            if name in self.model_fields_set:
                raise ValueError(f"{what} has no {name}")

    @model_validator(mode="after")
    def _one_way(self) -> MatrixTable:
        there = [letter for letter in LETTERS if getattr(self, letter) is not None]
        if there and self.matrices is not None:
            raise ValueError(f"give either matrices or {' and '.join(there)}")
        if self.B_d is not None and not there:
            raise ValueError("B_d is given together with A, B and C")
        if there and len(there) < len(LETTERS):
            missing = [letter for letter in LETTERS if letter not in there]
            raise ValueError(f"a plant needs A, B and C; {' and '.join(missing)} is not there")
        return self
