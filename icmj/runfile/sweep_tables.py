"""The sweep file: one case at many points.

It says which fields vary, and what is computed at each point.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, model_validator

from icmj.base.array import Finite, Seed
from icmj.errors import RunFileError
from icmj.plant.body import What
from icmj.runfile.reading import FileOfRuns, parse_toml, read_text
from icmj.runfile.schema import RunFile
from icmj.runfile.table import Line, Name, TomlTable
from icmj.work.shipped import SWEEPS

MOST_POINTS = 10**9
RESERVED = (
    r"point|root_(real|imag)|status|words|attractors?(_.*)?|(predicted|linear|mujoco)_.*"  # columns of what comes out
)
_TABLES = ("assumed", "actual", "design", "controller", "analysis", "simulation")
_Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=60)]
_Plant = Literal["linear", "mujoco"]


class SweepHeadTable(TomlTable):
    """Name and title of the sweep, its run file, and how samples are drawn."""

    name: Name
    """Name of the sweep and of its folder."""
    title: Line = ""
    """Title in tables and figures (default: the title of the case, and what varies)."""
    run: str
    """Run file whose fields vary, relative to the sweep file, or the name of a shipped case."""
    samples: Annotated[int, Field(ge=1, le=MOST_POINTS)] | None = None
    """Number of samples of the fields that have only ``low`` and ``high``."""
    method: Literal["random", "sobol"] = "sobol"
    """How samples are drawn: independently, or as a scrambled Sobol sequence, which fills the space evenly."""
    seed: Seed = 0
    """Seed of the samples."""
    chunk: Annotated[int, Field(ge=1, le=100_000)] | None = None
    """Number of points in a task of a process (default: a few seconds of work)."""


class DeviationTable(TomlTable):
    """A change of the actual plant whose factor or value varies; see :mod:`icmj.plant.body`."""

    what: What
    """Property to change."""
    of: str | None = None
    """Name of the element whose property changes (default: all elements that have the property)."""
    by: Literal["factor", "value"] = "factor"
    """Whether a factor on the property varies, or its value."""


class VaryTable(TomlTable):
    """One field or change that varies.

    Its values are ``values``, or ``count`` values from ``low`` to ``high``, or, without a count, samples between them.
    """

    field: str | Annotated[list[str], Field(min_length=1, max_length=20)] | None = None
    """Field of the run file by its dotted key, such as ``actual.gain``; a list of fields gets the same value."""
    change: DeviationTable | None = None
    """Change of the actual plant that varies, instead of a field."""
    name: _Name | None = None
    """Name of the column (default: the last part of the key)."""
    values: Annotated[list[Any], Field(min_length=1, max_length=100_000)] | None = None
    """Values: numbers, texts or lists that the field accepts."""
    low: Finite | None = None
    """Lowest value."""
    high: Finite | None = None
    """Highest value."""
    count: Annotated[int, Field(ge=2, le=100_000)] | None = None
    """Number of values from ``low`` to ``high``, both included."""
    spacing: Literal["linear", "log"] = "linear"
    """Spacing of the values or samples: equal differences or equal ratios."""

    @property
    def fields(self) -> tuple[str, ...]:
        """Dotted keys of the run file that get the value; none for a change."""
        return () if self.field is None else (self.field,) if isinstance(self.field, str) else tuple(self.field)

    @property
    def column(self) -> str:
        """Name of the column."""
        if self.name:
            return self.name
        if self.change:
            return "_".join(part.replace(" ", "_") for part in (self.change.what, self.change.of) if part)
        return self.fields[0].rpartition(".")[2]

    @property
    def sampled(self) -> bool:
        """Whether values are sampled rather than listed."""
        return self.values is None and self.count is None

    @model_validator(mode="after")
    def _is_one_thing(self) -> VaryTable:
        if (self.field is None) == (self.change is None):
            raise ValueError("give one of field and change")
        if (self.values is None) == (self.low is None and self.high is None):
            raise ValueError("give either values, or low and high")
        if self.values is not None and self.count is not None:
            raise ValueError("values have no count")
        if self.values is not None and "spacing" in self.model_fields_set:
            raise ValueError("values have no spacing")
        if self.values is None:
            if self.low is None or self.high is None or not self.low < self.high:
                raise ValueError("low must be given and be less than high")
            if self.spacing == "log" and self.low <= 0:
                raise ValueError("a log spacing needs a low greater than 0")
        for key in self.fields:
            table, _, rest = key.partition(".")
            if table not in _TABLES or not rest:
                raise ValueError(f"{key!r} is no field that varies; expected table.key of {', '.join(_TABLES)}")
        return self


class AskTable(TomlTable):
    """The results that are computed at each point in addition to the prediction."""

    motion: Annotated[list[_Plant], Field(max_length=2)] = []
    """Plants on which the case is simulated and its motion measured; under noise, its statistics."""
    cycle: Annotated[list[_Plant], Field(max_length=2)] = []
    """Plants whose exact cycle is computed by Newton's method, attracting or not; needs a run file
    without a set-point."""
    attractors: Annotated[int, Field(ge=0, le=1000)] = 0
    """Number of random starts of the linear plant in the search for coexisting motions; seed and scale are those of the
    run file."""


class SweepFile(FileOfRuns):
    """A validated sweep file; ``base`` is the run file that it names."""

    sweep: SweepHeadTable
    """Name, run file and sampling."""
    vary: Annotated[list[VaryTable], Field(min_length=1, max_length=20)]
    """Fields or changes that vary."""
    ask: AskTable = AskTable()
    """What is computed."""
    set: dict[str, Any] = {}
    """Values of the run file that are replaced at every point, such as ``set.simulation.duration = 20.0``."""

    _base: RunFile = PrivateAttr()

    @classmethod
    def validated(
        cls,
        data: Mapping[str, Any],
        path: Path,
        text: str = "",
        base: RunFile | None = None,
        allow_code: bool = False,
    ) -> SweepFile:
        """A sweep file of plain data; its run file lies beside ``path``, if ``base`` is not it.

        Raises:
            RunFileError: one line that names the file, the key, and what was expected.
        """
        made = cls._read(data, path, text)
        varied = {name: "[[vary]] gives its values" for vary in made.vary for name in vary.fields}
        made._base = made._run(base or made.sweep.run, made.set, "set", allow_code, varied)
        if not made._base.has_events and (made.ask.cycle or made.ask.attractors):
            raise RunFileError(
                f"{path}: [ask] cycle and attractors are for intermittent control; the controller is of kind "
                f"{made._base.controller.kind!r}, ask for its motion"
            )
        if made._base.setpoint and made.ask.cycle:
            raise RunFileError(f"{path}: [ask] a cycle is that of r = 0; take setpoint out of the run file")
        return made

    @model_validator(mode="after")
    def _fits_together(self) -> SweepFile:
        drawn = [vary.column for vary in self.vary if vary.sampled]
        if drawn and self.sweep.samples is None:
            raise ValueError(f"{drawn[0]} is drawn between low and high: sweep.samples says how often, or give a count")
        if self.sweep.samples is not None and not drawn:
            raise ValueError("sweep.samples: nothing is drawn; give a field low and high without a count")
        if not drawn and (unused := {"method", "seed"} & self.sweep.model_fields_set):
            raise ValueError(f"sweep.{min(unused)}: nothing is drawn; leave it out")
        if self.sweep.method == "sobol" and (self.sweep.samples or 0) > 2**30:
            raise ValueError("sweep.samples: a Sobol sequence has at most 2^30 points")
        seen: set[str] = set()
        for name in (vary.column for vary in self.vary):
            if re.fullmatch(RESERVED, name, re.IGNORECASE):
                raise ValueError(
                    f"what varies is called {name!r}, which the table calls what comes out; give it another name"
                )
            if name in seen:
                raise ValueError(f"two things that vary are called {name!r}; give one a name")
            seen.add(name)
        return self

    @property
    def base(self) -> RunFile:
        """The run file whose fields vary."""
        return self._base


def load_sweep(path: Path | str, *, allow_code: bool = False) -> SweepFile:
    """Read and validate a sweep file and the run file that it names; ``allow_code`` as of :func:`icmj.load_run`.

    Raises:
        RunFileError: one line that names the file, the line or key, and what was expected.
    """
    path, text = read_text(Path(path), SWEEPS)
    return SweepFile.validated(parse_toml(text, path), path, text, allow_code=allow_code)
