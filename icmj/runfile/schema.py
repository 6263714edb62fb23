"""The run file as a whole: its tables, read from TOML text, and changes of single values.

A dotted key leads to a value, ``simulation.disturbance[0].size``, which is given as TOML writes it:
``controller.q_t=0.02``. A log stores the text with the files that it names: models with what they include, matrices,
set-points.
"""

from __future__ import annotations

import hashlib
import json
import re
import tempfile
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast, get_args

import numpy as np
from pydantic import Field, PrivateAttr, ValidationError, model_validator

from icmj.base.array import MOST_ENTRIES, Positive
from icmj.base.text import one_line
from icmj.errors import RunFileError, explain_refusal
from icmj.plant.activation import Activation
from icmj.plant.person import Person
from icmj.runfile.control_tables import Analysis, Control, ControllerTable, Weights
from icmj.runfile.controllers import CONTROLLERS
from icmj.runfile.messages import in_words
from icmj.runfile.place import DisturbanceTable
from icmj.runfile.plant_tables import ON_ENGINE, Actual, Assumed
from icmj.runfile.run_tables import SimulationTable, StudyTable
from icmj.runfile.shapes import SHAPES
from icmj.runfile.table import CHOICE, Line, Name, TomlTable, kind_of, one_of, tag_of
from icmj.runfile.target import TargetTable, find_files
from icmj.work.own_code import Code
from icmj.work.shipped import MODELS

CONTROLLER_TABLES = (Control, *(table for tables in CONTROLLERS.collect("TABLES") for table in tables))


def _tell_controller(data: Any) -> str | None:
    """The tag of the table that data of ``[controller]`` are to be; intermittent, where they do not say it."""
    if not isinstance(data, Mapping):
        return tag_of(type(data)) or tag_of(Control)
    kind = data.get("kind", tag_of(Control))
    tag = kind_of({"kind": kind})
    same = (table for table in CONTROLLER_TABLES if kind and _kind_of_table(table) == kind and table.takes(data))
    return next(map(tag_of, same), tag)


def _kind_of_table(table: type[ControllerTable]) -> str | None:
    """The one kind of a table; ``None`` where it is ``module:name`` of somebody's own."""
    kinds = get_args(table.model_fields["kind"].annotation)
    return str(kinds[0]) if kinds else None


if TYPE_CHECKING:
    AnyController = ControllerTable
    SetpointTable = TargetTable
else:
    _known = dict.fromkeys(repr(kind) for table in CONTROLLER_TABLES if (kind := _kind_of_table(table)))
    AnyController = one_of(
        CONTROLLER_TABLES,
        _tell_controller,
        custom_error_type="controller_kind",
        custom_error_message=f"kind must be {', '.join(_known)} or the module:name of a controller of your own",
    )
    SetpointTable = one_of(SHAPES.collect("SETPOINT"))  # by its kind

Place = tuple[str | int, ...]

_PART = re.compile(r"""(?:"([^"]*)"|'([^']*)'|([^."'\[\]]+))((?:\[\d{1,6}\])*)(\.|$)""")


def place_of(key: str) -> Place:
    """Tables, lists and the key that ``simulation.disturbance[0].size`` leads through; quotes hold dots together.

    Raises:
        RunFileError: if it is not a dotted key.
    """
    parts: list[str | int] = []
    at, end = 0, "."
    while end == ".":
        found = _PART.match(key, at)
        if found is None:
            raise RunFileError(f"{one_line(key, 80)!r} is no key; expected one such as actual.gain")
        *names, indices, end = found.groups()
        parts.append(next(name for name in names if name is not None).strip())
        parts += [int(index) for index in re.findall(r"\d+", indices)]
        at = found.end()
    return tuple(parts)


def put(data: dict[str, Any], key: str, value: object) -> None:
    """Put a value at its place into plain data, and tables where there are none on the way; ``None`` takes it out.

    Raises:
        RunFileError: if something on the way is no table, or a list has no such entry.
    """
    *way, last = place_of(key)
    inside: Any = data
    said = "the run file"
    for part in way:
        _check(key, said, inside, part)
        inside = inside[part] if isinstance(part, int) else inside.setdefault(part, {})
        said = f"{said}[{part}]" if isinstance(part, int) else part
    _check(key, said, inside, last)
    if value is None and isinstance(inside, dict):
        inside.pop(last, None)
    else:
        inside[last] = value


def _value_at(data: Any, place: Place) -> Any:
    """What plain data have at a place; ``None`` where they have nothing."""
    for part in place:
        inside = isinstance(data, list) and part < len(data) if isinstance(part, int) else isinstance(data, Mapping)
        data = (data[part] if isinstance(part, int) else data.get(part)) if inside else None
    return data


def plain(value: object) -> Any:
    """A copy in the types of TOML: of NumPy's numbers and arrays, and of tuples."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, list | tuple) else deepcopy(value)


def _without_zeros(value: Any) -> Any:
    """Numbers such as 1.0 as 1, in lists and tables, too."""
    if isinstance(value, Mapping):
        return {key: _without_zeros(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_without_zeros(each) for each in value]
    return int(value) if isinstance(value, float) and value.is_integer() and abs(value) < 1e9 else value


def _check(key: str, said: str, inside: object, part: str | int) -> None:
    if isinstance(part, int) and not (isinstance(inside, list) and part < len(inside)):
        raise RunFileError(f"{key}: {said} has no entry [{part}]")
    if isinstance(part, str) and not isinstance(inside, dict):
        raise RunFileError(f"{key}: {said} is no table")


def to_toml(data: Mapping[str, Any]) -> str:
    """``data`` as TOML: tables of numbers, texts, lists and tables; what is ``None`` is left out."""
    return "\n".join(_table(data, ())).strip() + "\n"


def _table(data: Mapping[str, Any], at: tuple[str, ...]) -> Iterator[str]:
    below = {}
    for key, value in data.items():
        if isinstance(value, Mapping) or (isinstance(value, list) and value and isinstance(value[0], Mapping)):
            below[key] = value
        elif value is not None:
            yield f"{key_text(key)} = {value_text(value)}"
    for key, value in below.items():
        name = ".".join(map(key_text, (*at, key)))
        for entry in value if isinstance(value, list) else [value]:
            yield f"\n[[{name}]]" if isinstance(value, list) else f"\n[{name}]"
            yield from _table(entry, (*at, key))


def key_text(key: str) -> str:
    """A key as TOML writes it."""
    return key if key.replace("_", "").replace("-", "").isalnum() and key.isascii() else value_text(key)


def value_text(value: Any) -> str:
    """A value as TOML writes it, on one line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        # JSON's escapes are TOML's, but for one that TOML wants and JSON does not
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(value_text, value))}]"
    if isinstance(value, Mapping):
        inside = ", ".join(f"{key_text(key)} = {value_text(each)}" for key, each in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    return repr(value)


_MODEL_ERROR, _NUMBER = re.compile(r"\bb = [-+]?\d+(\.\d+)?"), re.compile(r"[-+]?\d+(\.\d+)?([eE][-+]?\d+)?")
_UNKNOWN = object()  # what a file had of which a log keeps only that it was changed
MOST_BYTES = 10_000_000  # of all files together; a log of more goes without them


@dataclass(frozen=True)
class BundledFiles:
    """Files by their paths below a folder that holds them all, and the run file, too.

    Attributes:
        place: path of the run file there.
        files: contents by path.
        assumed, actual: paths of the two plants' files, where the run file names them by absolute paths; else "".
    """

    place: str = "run.toml"
    files: Mapping[str, bytes] = field(default_factory=dict)
    assumed: str = ""
    actual: str = ""

    @contextmanager
    def written(self) -> Iterator[tuple[Path, dict[str, str]]]:
        """A temporary folder with the files: the run file's path there, and the keys of it that change."""
        with tempfile.TemporaryDirectory(prefix="icmj-models-") as folder:
            place = self.write(Path(folder))
            named = {"assumed": self.assumed, "actual": self.actual}
            yield (
                place,
                {
                    f"{plant}.{'matrices' if name.endswith(('.npz', '.json')) else 'model'}": str(Path(folder, name))
                    for plant, name in named.items()
                    if name
                },
            )

    def write(self, folder: Path) -> Path:
        """Write the files into ``folder``; returns the path that the run file has there.

        Raises:
            RunFileError: if a path leads out of the folder, or a file cannot be written.
        """
        with explain_refusal(RunFileError, f"{folder}: the model of the log cannot be written"):
            for name, content in self.files.items():
                target = folder / _inside(name)
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content)
            place = folder / _inside(self.place)
            place.parent.mkdir(parents=True, exist_ok=True)
        return place


def _inside(name: str) -> PurePosixPath:
    path = PurePosixPath(name)
    if path.is_absolute() or not path.parts or {"..", ""} & set(path.parts) or "\\" in name or ":" in name:
        raise RunFileError(f"the log carries a file at {one_line(name, 80)!r}, which leads out of a folder")
    return path


class Paper(TomlTable):
    """The statements of the paper about this case; they are shown beside the results and never used in a computation.

    ``fingerprint`` is that of the run file which the block describes (:attr:`RunFile.fingerprint`). In a copy with
    another plant, design or rule the block is ignored, with a note. Without a fingerprint it is never ignored.
    """

    figure: str = ""
    """Name of the figure in the source of the paper, by which the report finds its statements."""
    delta_crit: Positive | None = None
    """Critical interval as printed [s]."""
    eigenvalue: Annotated[Literal[1, -1], CHOICE] | None = None
    """Eigenvalue at the critical interval."""
    cycle: bool | None = None
    """Whether a limit cycle is reported."""
    statements: list[str] = []
    """Statements of the paper on the case, paraphrased."""
    note: str = ""
    """Note on the case for the report."""
    fingerprint: str = ""
    """Fingerprint of the run file that the block describes."""


class Identity(TomlTable):
    """Name and title of the case."""

    name: Name
    """Short name without blanks; also the name of the log."""
    title: Line
    """Title in tables and figures."""
    paper: Paper = Paper()
    """The statements of the paper about this case."""


class RunFile(TomlTable):
    """A validated run file."""

    case: Identity
    """Name and title."""
    assumed: Assumed
    """The plant that the controller assumes."""
    actual: Actual = Actual()
    """The actual plant, as differences from the assumed one."""
    design: Weights = Weights()
    """Weights of the linear-quadratic design."""
    controller: AnyController
    """The controller: hold and event rule of the intermittent one, or another one by its ``kind``."""
    setpoint: Annotated[list[SetpointTable], Field(max_length=MOST_ENTRIES)] = []
    """Set-points over time, each for one output or combination; without them the plant is to remain upright."""
    analysis: Analysis = Analysis()
    """Range of the analysis."""
    simulation: SimulationTable = SimulationTable()
    """Settings of the run."""
    study: StudyTable = StudyTable()
    """Further results of ``icmj study``, in addition to one run on each plant."""

    _text: str = PrivateAttr(default="")
    _path: Path = PrivateAttr(default=Path("run.toml"))
    _disowned: bool = PrivateAttr(default=False)
    _allows_code: bool = PrivateAttr(default=False)
    _kept: BundledFiles = PrivateAttr(default_factory=BundledFiles)
    _changes: dict[str, str] = PrivateAttr(default_factory=dict)  # by key, in the order in which they were made
    _of_file: dict[str, Any] = PrivateAttr(default_factory=dict)  # what the file had, of each key that was changed

    @classmethod
    def validated(cls, data: Mapping[str, Any], path: Path) -> RunFile:
        """Validate plain data as a run file; paths of models are relative to ``path``.

        Raises:
            RunFileError: one line that names the file, the key, and what was expected.
        """
        try:
            run = cls.model_validate(data)
        except ValidationError as error:
            raise RunFileError(f"{path}: {one_line(in_words(error, cls))}") from error
        run._path = path
        return run

    def with_(self, **changes: Any) -> RunFile:
        """The same run file with some values changed, by dotted keys: ``run.with_(**{"actual.gain": 0.85})``.

        An entry of a list is named by its number: ``simulation.disturbance[0].size``. ``None`` removes a key, so that
        its default applies. What has changed is known from then on (:attr:`changes`, :attr:`title`).

        Raises:
            RunFileError: if a key is unknown or a value not allowed.
        """
        changed = self._with(changes)
        before, after = self.model_dump(), changed.model_dump()
        for key in changes:
            place = place_of(key)
            if (value := _value_at(after, place)) != _value_at(before, place):
                asked = value if changes[key] is None else plain(changes[key])
                changed._changes[key] = "none" if asked is None else value_text(_without_zeros(asked))
                if changed._of_file.setdefault(key, _value_at(before, place)) == value:
                    del changed._changes[key]  # as it was
        return changed

    def _with(self, changes: Mapping[str, Any]) -> RunFile:
        """The same run file with some values put in, which is not remembered as a change of it."""
        data = self._data()
        for key, value in changes.items():
            try:
                put(data, key, plain(value))
            except RunFileError as error:
                raise RunFileError(f"{self._path}: {error}") from error
        changed = type(self).validated(data, self._path)
        changed._allows_code, changed._kept = self._allows_code, self._kept
        changed._changes, changed._of_file = dict(self._changes), dict(self._of_file)
        return changed

    @property
    def changes(self) -> Mapping[str, str]:
        """The values changed since the file was read, by dotted key, each as TOML writes it."""
        return self._changes

    def recall(self, changes: Mapping[str, str]) -> RunFile:
        """The same run file, of which these values are known to have been changed before."""
        same = self.model_copy()
        same._changes = {str(key): str(value) for key, value in dict(changes).items()}
        same._of_file = dict.fromkeys(same._changes, _UNKNOWN)
        return same

    @property
    def changes_in_words(self) -> str:
        """What of plants, controller and run has changed since the file was read, in one sentence; or nothing."""
        each = [one_line(f"{key} = {value}", 100) for key, value in self._changes.items() if key[:5] != "case."]
        return f"Changed from the file: {', '.join(each)}." if each else ""

    @property
    def title(self) -> str:
        """The title of the case; where values have changed since, it is marked so, and names the model error of now."""
        if not self.changes_in_words or "case.title" in self._changes:
            return self.case.title
        gain = self._changes.get("actual.gain", "")
        now = _MODEL_ERROR.sub(f"b = {gain}", self.case.title) if _NUMBER.fullmatch(gain) else self.case.title
        return f"{now} (changed)"

    def resolve(self) -> RunFile:
        """The same run file, with what user code draws and columns of files replaced by numbers, which a log keeps.

        Raises:
            RunFileError: if the code may not be executed, fails, or draws no sinusoids, or a file cannot be read.
        """
        shaped: dict[str, DisturbanceTable | TargetTable] = {
            f"simulation.disturbance[{i}]": table for i, table in enumerate(self.simulation.disturbance)
        }
        shaped |= {f"setpoint[{i}]": table for i, table in enumerate(self.setpoint)}
        given = self.code, self._path.parent, self.simulation.duration
        try:
            drawn = {key: one for key, table in shaped.items() if (one := table.resolve(*given)) is not None}
        except RunFileError as error:
            raise RunFileError(f"{self._path}: {error}") from error
        return self._with(drawn) if drawn else self

    def _data(self) -> dict[str, Any]:
        """The contents as plain data without defaults."""
        return self.model_dump(exclude_defaults=True, exclude_none=True)

    @property
    def fingerprint(self) -> str:
        """Twelve hexadecimal digits that depend on the plants, the design, the hold and the weight of the rule.

        Folders of model files, thresholds and the settings of the run do not affect them.
        """
        data = {name: self._data().get(name, {}) for name in ("assumed", "actual", "design")}
        for table in (data["assumed"], data["actual"]):
            if "model" in table:
                table["model"] = Path(table["model"]).name.removesuffix(".xml") + ".xml"
        content = json.dumps(data | {"rule": self.controller.identity()}, sort_keys=True)
        return hashlib.sha256(content.encode()).hexdigest()[:12]

    @property
    def disowned(self) -> bool:
        """Whether it has a ``[case.paper]`` block that belongs to another case."""
        return self._disowned

    @model_validator(mode="after")
    def _paper_speaks_of_this(self) -> RunFile:
        stated = self.case.paper.fingerprint
        if stated and stated != self.fingerprint:
            object.__setattr__(self, "case", self.case.model_copy(update={"paper": Paper()}))
            self._disowned = True
        return self

    @model_validator(mode="after")
    def _matrices_are_not_changed_as_models_are(self) -> RunFile:
        if self.assumed.given and not self.actual.given and self.actual.model is None:
            self.actual.refuse((*ON_ENGINE, "units"), "actual: a plant given by matrices")
        return self

    @model_validator(mode="after")
    def _only_a_controller_with_a_model_follows(self) -> RunFile:
        if self.setpoint and not self.controller.follows:
            raise ValueError(
                "a set-point is for the intermittent or the predictor controller; one of kind "
                f"{self.controller.kind!r} has none"
            )
        return self

    @model_validator(mode="after")
    def _law_needs_two_points(self) -> RunFile:
        if len(self.study.law_q_t) == 1:
            raise ValueError("study.law_q_t needs at least two thresholds to fit a slope")
        return self

    @property
    def intermittent(self) -> Control:
        """Hold and event rule.

        Raises:
            RunFileError: if the controller is another one, for which there are no theory, cycles and thresholds.
        """
        if self.has_events:
            return cast(Control, self.controller)
        raise RunFileError(
            f"{self._path}: the controller is of kind {self.controller.kind!r}, which has no event rule and no "
            "critical interval; icmj analyse prints the roots of its loop, icmj run and icmj study simulate it"
        )

    @property
    def has_events(self) -> bool:
        """Whether its controller has an event rule, and with it a prediction; others are simulated without one."""
        return self.controller.has_events

    @property
    def code(self) -> Code:
        """The folder of code that it names, and whether this code may be executed."""
        return Code(self._path.parent, self._allows_code)

    @property
    def text(self) -> str:
        """The TOML text as read or, if values have been changed since, the text of the changed run file."""
        if self._text:
            said = type(self).model_validate(tomllib.loads(self._text))
            if said.model_dump() == self.model_dump():
                return self._text
        how = self.changes_in_words or "written from values that were changed in code."
        return f"# {self._path.name}: {how}\n{to_toml(self._data())}"

    @property
    def path(self) -> Path:
        """The path from which it was read; model files are relative to its folder."""
        return self._path

    @property
    def kept(self) -> BundledFiles:
        """The files to which it refers, if it was read from a log that contains them; otherwise empty."""
        return self._kept

    def keeping(self, kept: BundledFiles) -> RunFile:
        """The same run file with these files."""
        same = self.model_copy()
        same._kept = kept
        return same

    @contextmanager
    def at_hand(self) -> Iterator[RunFile]:
        """The run file itself if its files exist; else a copy in a temporary folder with the files from its log.

        Raises:
            RunFileError: if the files cannot be written.
        """
        files = (self.assumed_path, self.actual_path, *find_files(self.setpoint, self._path))
        if not self._kept.files or all(file.exists() for file in files):
            yield self
            return
        with self._kept.written() as (place, changes):
            here = self._with(changes) if changes else self.model_copy()
            here._path = place
            yield here

    @property
    def actual_measures(self) -> Person | None:
        """The person of the actual plant: by default, for the same model, the person of the assumed plant."""
        own = self.actual.measures
        return own if own or self.actual.model else self.assumed.measures

    @property
    def assumed_activation(self) -> Activation | None:
        """The lag of the assumed plant's inputs."""
        return self.assumed.activation.activation() if self.assumed.activation else None

    @property
    def actual_activation(self) -> Activation | None:
        """The lag of the actual plant's inputs: by default that of the assumed plant's."""
        own = self.actual.activation
        return own.activation() if own else self.assumed_activation

    @property
    def on_engine(self) -> bool:
        """Whether MuJoCo can simulate the actual plant, because it is a model and not given by matrices."""
        return not self.actual.given and (self.actual.model or self.assumed.model) is not None

    @property
    def assumed_path(self) -> Path:
        """The MJCF file of the assumed plant, or the file of its matrices, which may be this run file."""
        table = self.assumed
        return self._file(table.model, table.matrices or self._path.name)

    @property
    def actual_path(self) -> Path:
        """The same for the actual plant; by default that of the assumed plant."""
        table = self.actual
        own = self._path.name if table.A else table.model or table.matrices
        return self._file(None if table.A else table.model, own) if own else self.assumed_path

    def _file(self, model: str | None, other: str) -> Path:
        """A model, which may be a shipped one, or another file that this one names."""
        folder = self._path.parent
        return folder / other if model is None else MODELS.beside(folder, model)


_WORD = re.compile(r"[A-Za-z][\w .-]*")


def overridden(run: RunFile, changes: Iterable[str]) -> RunFile:
    """The run file with values changed as ``KEY=VALUE`` says, all at once; the same one if there are none.

    A value is TOML; a plain word that is none, such as zero-order, is text, for the quotes that a shell takes away;
    ``KEY=`` takes the key out, so that its default holds.

    Raises:
        RunFileError: if a change is not written so, a key is unknown, or a value not allowed.
    """
    changes = tuple(changes)
    if not changes:
        return run
    try:
        values = dict(_read(change) for change in changes)
        changed = run.with_(**values)
        for key, value in values.items():
            _expect_beside(key, value, changed)
        return changed
    except RunFileError as error:
        given = one_line(" ".join(f"--set {change}" for change in changes), 200)
        raise RunFileError(f"{given}: {error}") from error


def _expect_beside(key: str, value: object, run: RunFile) -> None:
    """Refuse a file that lies in the current folder and not where a run file looks for it, which is beside itself."""
    plant, _, name = key.partition(".")
    if plant not in ("assumed", "actual") or name not in ("model", "matrices") or not isinstance(value, str):
        return
    path, here = run.assumed_path if plant == "assumed" else run.actual_path, Path(value).absolute()
    if not path.exists() and here.is_file():
        raise RunFileError(
            f"{key} is relative to the run file, and {path} does not exist; for the file in the current folder, give "
            f"its absolute path, as in --set '{key}=\"{here}\"'"
        )


def _read(change: str) -> tuple[str, object]:
    key, equals, value = change.partition("=")
    if not equals or not key.strip():
        raise RunFileError("expected KEY=VALUE, such as actual.gain=0.85")
    return key.strip(), _value(value.strip()) if value.strip() else None


def _value(text: str) -> object:
    try:
        data = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError) as error:
        if _WORD.fullmatch(text):
            return text
        raise RunFileError(f"{one_line(text, 60)} is not a value as TOML writes it") from error
    if len(data) > 1:
        raise RunFileError(f"{one_line(text, 60)} is more than one value")
    return data["value"]
