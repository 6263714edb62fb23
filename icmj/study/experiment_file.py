"""The experiment file: cases, plants and repetitions, and the table of one kind of experiment."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import Field, PrivateAttr, create_model, model_validator

from icmj.base.text import one_line
from icmj.errors import IcmjError, RunFileError
from icmj.runfile.reading import FileOfRuns, parse_toml, read_text
from icmj.runfile.schema import RunFile
from icmj.runfile.table import Interval, Line, Name, TomlTable
from icmj.study.kind import Kind, find_kind
from icmj.study.kinds import KINDS
from icmj.work.own_code import REFERENCE, Code
from icmj.work.shipped import EXPERIMENTS

MOST_TRIALS = 100_000


class ExperimentTable(TomlTable):
    """Name of the experiment, plants and repetitions."""

    name: Name
    """Name of the experiment and of its folder."""
    title: Line = ""
    """Title in tables and figures (default: the name)."""
    plants: Annotated[list[Literal["linear", "mujoco"]], Field(min_length=1, max_length=2)] = ["linear", "mujoco"]
    """Plants on which each case is simulated. Cases given by matrices have the linear plant only."""
    repetitions: Annotated[int, Field(ge=1, le=MOST_TRIALS)] = 1
    """Number of trials of each case on each plant."""
    seed: Annotated[int, Field(ge=0, le=2**62)] = 0
    """Seed of the first trial; the next ones have the following numbers. It changes the seeds of noise and stimulus."""


class CaseTable(TomlTable):
    """One case: a run file with some values replaced, and the kind of control."""

    run: str
    """Run file, relative to the experiment file, or the name of a shipped case."""
    name: Name | None = None
    """Name of the case in results (default: that of the run file)."""
    title: Line = ""
    """Title in tables and figures (default: the name, or the title of the run file)."""
    control: Literal["own", "continuous", "clock"] = "own"
    """Kind of control: the controller of the run file, the continuous controller of the same design (with a delay, a
    clock with an interval of a twentieth of it), or a clock instead of the event rule."""
    interval: Interval | None = None
    """Interval of the clock [s]."""
    set: dict[str, Any] = {}
    """Values of the run file that are replaced, such as ``set.controller.q_t = 0.01``."""

    @model_validator(mode="after")
    def _a_clock_has_an_interval(self) -> CaseTable:
        if (self.control == "clock") != (self.interval is not None):
            raise ValueError('interval is that of control = "clock", which needs it')
        return self


class ExperimentFile(FileOfRuns):
    """A validated experiment file. One of the tables determines the kind of experiment and its analysis."""

    experiment: ExperimentTable
    """Name, plants and repetitions."""
    case: Annotated[list[CaseTable], Field(min_length=1, max_length=50)]
    """Cases that are compared."""

    _runs: tuple[RunFile, ...] = PrivateAttr(default=())

    @classmethod
    def validated(cls, data: Mapping[str, Any], path: Path, text: str = "", allow_code: bool = False) -> ExperimentFile:
        """Validate plain data as an experiment file; run files are in the folder of ``path``, or shipped ones.

        A table of the name ``module:name`` is of a kind of the user's own.

        Raises:
            RunFileError: one line that names the file, the key, and what was expected.
        """
        try:
            code = Code(path.parent, allow_code)
            own = {key: find_kind(code, key) for key in data if re.fullmatch(REFERENCE, key)}
        except RunFileError as error:
            raise RunFileError(f"{path}: {error}") from error
        try:
            made = (_add_tables(cls, own) if own else cls)._read(data, path, text)
        except IcmjError:
            raise
        except Exception as error:  # of the code that checks such a table
            if not own:
                raise
            raise RunFileError(f"{path}: {next(iter(own))} fails ({one_line(repr(error), 200)})") from error
        try:
            made.settings.find_code(code)
        except IcmjError as error:
            raise RunFileError(f"{path}: {made.kind}: {error}") from error
        made._runs = tuple(
            made._run(case.run, case.set, f"case[{i}].set", allow_code) for i, case in enumerate(made.case)
        )
        twice = sorted({name for name in made.names if made.names.count(name) > 1})
        if twice:
            raise RunFileError(f"{path}: two cases are called {twice[0]!r}; give one a name")
        return made

    @model_validator(mode="after")
    def _is_of_one_kind(self) -> Self:
        if len(self._given) != 1:
            said = " and ".join(f"[{name}]" for name in self._given) or "none"
            raise ValueError(f"expected one table of {', '.join(f'[{name}]' for name in KINDS.names)}, got {said}")
        return self

    @property
    def _given(self) -> list[str]:
        """The names of the tables of kinds that are there."""
        tables = [name for name in type(self).model_fields if name not in ("experiment", "case")]
        return [name for name in tables if getattr(self, name) is not None]

    @property
    def kind(self) -> str:
        """The kind of experiment: the name of its table."""
        return self._given[0]

    @property
    def settings(self) -> Kind:
        """The table of its kind."""
        found: Kind = getattr(self, self.kind)
        return found

    @property
    def runs(self) -> tuple[RunFile, ...]:
        """The run file of each case, with its values replaced."""
        return self._runs

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cases."""
        return tuple(case.name or run.case.name for case, run in zip(self.case, self._runs, strict=True))

    @property
    def titles(self) -> tuple[str, ...]:
        """Titles of the cases."""
        return tuple(case.title or case.name or run.case.title for case, run in zip(self.case, self._runs, strict=True))


def _add_tables(file: type[ExperimentFile], kinds: Mapping[str, type[Kind]]) -> type[ExperimentFile]:
    """The schema of a file that may have one more table of each of these kinds."""
    tables: dict[str, Any] = {
        name: (kind | None, Field(None, description=kind.meaning)) for name, kind in kinds.items()
    }
    return create_model(file.__name__, __base__=file, __module__=file.__module__, __doc__=file.__doc__, **tables)


if not TYPE_CHECKING:
    ExperimentFile = _add_tables(ExperimentFile, {name: KINDS[name].KIND for name in KINDS.names})


def load_experiment(path: Path | str, *, allow_code: bool = False) -> ExperimentFile:
    """Read and validate an experiment file and the run files that it names; the name of a shipped one stands for it.

    Args:
        path: the file, or the name.
        allow_code: whether Python code that the file or a run file names (``module:name``) may be run.

    Raises:
        RunFileError: one line that names the file, the line or key, and what was expected.
    """
    path, text = read_text(Path(path), EXPERIMENTS)
    return ExperimentFile.validated(parse_toml(text, path), path, text, allow_code)
