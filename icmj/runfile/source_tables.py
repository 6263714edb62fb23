"""The tables of disturbances: each kind with its shape, and the place where it acts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag

from icmj.errors import RunFileError, SimulationError
from icmj.runfile.messages import short
from icmj.runfile.periodic_tables import SinesTable, TernaryTable
from icmj.runfile.place_table import PlaceTable
from icmj.runfile.sampled_tables import FileTable, RampTable, SampledTable
from icmj.runfile.table import (
    LARGEST,
    Finite,
    Line,
    NonNegative,
    Parameters,
    Positive,
    Reference,
    TomlTable,
)
from icmj.simulation.sources import (
    GRID,
    MOST_TERMS,
    NOISE_TERMS,
    Bias,
    Gaussian,
    Impulse,
    Noise,
    Sinusoids,
    Source,
    Step,
)
from icmj.work.own_code import Code, accepted, digest_of


class ImpulseTable(PlaceTable):
    """An impulse on an input or a body: ``size`` [N m s], constant over ``duration`` [s] from ``start`` [s] on."""

    kind: Literal["impulse"]
    """Kind of the disturbance."""
    size: Finite | None = None
    """Size of the impulse [N m s, or the unit of the input times s]. For a body, a factor on force and torque (default:
    1)."""
    start: NonNegative = 0.0
    """Start [s]."""
    duration: Positive = 0.05
    """Duration [s]."""

    def source(self) -> Source:
        """The source that it stands for."""
        return Impulse(self.input, self.sized(self.size), self.start, self.duration, **self.placed)


class StepTable(PlaceTable):
    """A step on an input or a body: ``size`` [N m] from ``start`` [s] on."""

    kind: Literal["step"]
    """Kind of the disturbance."""
    size: Finite | None = None
    """Size of the step [N m, or the unit of the input]. For a body, a factor on force and torque (default: 1)."""
    start: NonNegative = 0.0
    """Start [s]."""

    def source(self) -> Source:
        """The source that it stands for."""
        return Step(self.input, self.sized(self.size), self.start, **self.placed)


class NoiseTable(PlaceTable):
    """Coloured noise on one input or body, or on one output as the observer reads it.

    Its standard deviation is ``size``. Its spectrum is flat up to ``bandwidth`` [Hz], or a first-order low-pass with a
    ``corner`` [Hz]; see :class:`icmj.simulation.sources.Noise`.
    """

    kind: Literal["noise"]
    """Kind of the disturbance."""
    size: Positive | None = None
    """Standard deviation [unit of the input or output]. For a body, a factor on force and torque (default: 1)."""
    bandwidth: Positive | None = None
    """Upper end of a flat spectrum [Hz]. Give either ``bandwidth`` or ``corner``."""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)]
    """Seed of frequencies and phases."""
    start: NonNegative = 0.0
    """Start [s]."""
    output: str | None = None
    """Name of the output whose reading is disturbed, instead of an input or body."""
    corner: Positive | None = None
    """Frequency at which a low-pass spectrum has fallen to half [Hz]."""
    terms: Annotated[int, Field(ge=1)] = NOISE_TERMS
    """Number of sinusoids of which the noise is the sum."""

    def source(self) -> Source:
        """The source that it stands for."""
        size, edge = (
            self.sized(self.size),
            (self.bandwidth, self.seed, self.start, self.output, self.corner, self.terms),
        )
        return Noise(self.input, size, *edge, **self.placed)


class GaussianTable(PlaceTable):
    """Gaussian noise on one input or body, or on one output as the observer reads it.

    Its spectrum is white, or a first-order low-pass with a ``corner`` [Hz]. Its distribution is exact at the points of
    a grid; see :class:`icmj.simulation.sources.Gaussian`.
    """

    kind: Literal["gaussian"]
    """Kind of the disturbance."""
    size: Positive | None = None
    """Standard deviation [unit of the input or output]. For a body, a factor on force and torque (default: 1)."""
    share: Positive | None = None
    """Instead of ``size``, for an ``input``: standard deviation as a share of the controller's command to it, as in
    signal-dependent motor noise. The noise is this share times the command times noise of variance one. Needs a
    controller whose command follows from a hold between events."""
    corner: Positive | None = None
    """Frequency at which a low-pass spectrum has fallen to half [Hz]. By default, the noise is white."""
    interval: Positive = GRID
    """Time between values; noise is linear between them [s]. Those of several noises must be integer multiples of the
    shortest."""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)]
    """Seed of the values."""
    start: NonNegative = 0.0
    """Start [s]."""
    output: str | None = None
    """Name of the output whose reading is disturbed, instead of an input or body."""

    def source(self) -> Source:
        """The source that it stands for."""
        keys = ("input", "output", "corner", "interval", "seed", "start")
        if self.share is not None and self.size is not None:
            raise SimulationError("gaussian noise: give size or share, not both")
        how: dict[str, Any] = {"share": self.share} if self.share else {"size": self.sized(self.size)}
        return Gaussian(**how, **{key: getattr(self, key) for key in keys}, **self.placed)


class BiasTable(TomlTable):
    """A constant error of one output as the observer reads it: ``size`` from ``start`` [s] on."""

    kind: Literal["bias"]
    """Kind of the disturbance."""
    output: str
    """Name of the output."""
    size: Finite
    """Size of the error [unit of the output]."""
    start: NonNegative = 0.0
    """Start [s]."""

    def sources(self) -> Iterator[Source]:
        """The source that it stands for."""
        yield Bias(self.output, self.size, self.start)


class SinusoidsTable(PlaceTable):
    """A sum of sinusoids on one input or body, or on one output as the observer reads it.

    See :class:`icmj.simulation.sources.Sinusoids`. Noise from user code is also recorded in this form.
    """

    kind: Literal["sinusoids"]
    """Kind of the disturbance."""
    terms: Annotated[list[Annotated[list[Finite], Field(min_length=3, max_length=5)]], Field(max_length=MOST_TERMS)]
    """Terms [a, ω, φ] or [a, ω, φ, start, end] of a cos(ωt + φ) [unit; rad/s; rad; s]."""
    output: str | None = None
    """Name of the output, as the observer reads it."""
    made_by: Line = ""
    """Code that drew the terms, as ``module:name``."""
    sha256: str = ""
    """Digest of its source file."""

    def source(self) -> Source:
        """The source that it stands for."""
        return Sinusoids(input=self.input, output=self.output, terms=tuple(map(tuple, self.terms)), **self.placed)


class OwnNoiseTable(PlaceTable):
    """Noise from your own code: the ``module:name`` of a function that draws the terms of a sum of sinusoids."""

    tag: ClassVar[str] = "own"

    kind: Reference
    """The function; it receives the parameters, and ``duration`` [s] if it accepts one."""
    parameters: Parameters = {}
    """Parameters of the function, by name, including its seed."""
    output: str | None = None
    """Name of the output, as the observer reads it."""

    def source(self) -> None:
        """Nothing before its code has drawn it (:meth:`drawn`)."""

    def drawn(self, code: Code, duration: float) -> dict[str, Any]:
        """The table of kind ``sinusoids`` for a run of ``duration`` [s], whose terms ``code`` draws.

        Raises:
            RunFileError: if the code may not be run, fails, or draws no terms.
        """
        make = code.named(self.kind)
        told = code.made(self.kind, **{**accepted(make, {"duration": duration}), **self.parameters})
        try:
            terms = np.atleast_2d(np.asarray(told, dtype=float))
        except (TypeError, ValueError):
            terms = np.zeros((0, 0))
        if terms.ndim != 2 or terms.shape[1] not in (3, 5) or not len(terms):
            raise RunFileError(f"{self.kind}: expected rows (a, ω, φ) or (a, ω, φ, start, end), got {short(told)}")
        kept = self.model_dump(exclude={"kind", "parameters"}, exclude_unset=True, mode="json")
        drawn = {"terms": np.clip(terms, -LARGEST, LARGEST).tolist(), "made_by": self.kind, "sha256": digest_of(make)}
        return {**kept, "kind": "sinusoids", **drawn}


def drawn_of(tables: Sequence[Any], code: Code, folder: Path, duration: float) -> dict[int, dict[str, Any]]:
    """Those of these tables that stand for code or a file in ``folder``, as numbers for a run of ``duration`` [s].

    Raises:
        RunFileError: if the code may not be run, fails, or draws nothing, or a file cannot be read.
    """
    return {
        i: table.drawn(code, duration) if isinstance(table, OwnNoiseTable) else table.drawn(folder, duration)
        for i, table in enumerate(tables)
        if isinstance(table, OwnNoiseTable | FileTable)
    }


def _kind(table: Any) -> str | None:
    kind = table.get("kind") if isinstance(table, Mapping) else getattr(table, "kind", None)
    return "own" if isinstance(kind, str) and ":" in kind else None if kind is None else str(kind)


SourceTable = Annotated[
    Annotated[ImpulseTable, Tag("impulse")]
    | Annotated[StepTable, Tag("step")]
    | Annotated[NoiseTable, Tag("noise")]
    | Annotated[GaussianTable, Tag("gaussian")]
    | Annotated[BiasTable, Tag("bias")]
    | Annotated[SinusoidsTable, Tag("sinusoids")]
    | Annotated[SinesTable, Tag("sines")]
    | Annotated[TernaryTable, Tag("ternary")]
    | Annotated[RampTable, Tag("ramp")]
    | Annotated[SampledTable, Tag("sampled")]
    | Annotated[FileTable, Tag("file")]
    | Annotated[OwnNoiseTable, Tag("own")],
    Discriminator(_kind),
]
"""A disturbance of a run file, by its ``kind``."""
