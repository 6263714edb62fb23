"""Reading run files: from TOML text to a validated run file, or to one line that says what is wrong.

A run file is also composed in Python, from a linear plant, a controller and the settings of its run.
"""

from __future__ import annotations

import errno
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

import numpy as np
from pydantic import PrivateAttr, ValidationError

from icmj.base.files import read_bytes
from icmj.base.numbers import pick
from icmj.base.text import one_line
from icmj.controller.controller import Controller
from icmj.controller.rules import name_of
from icmj.errors import AnalysisError, RunFileError, expect
from icmj.plant.linear_plant import LinearPlant, expect_linear
from icmj.runfile.messages import in_words
from icmj.runfile.schema import RunFile, plain, to_toml
from icmj.runfile.shapes import kind_of_course
from icmj.runfile.table import TomlTable
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Gaussian, Source
from icmj.work.shipped import RUNS, Shelf

MOST_BYTES = 1_000_000  # the shipped ones have two thousand


def load_run(path: Path | str, *, allow_code: bool = False) -> RunFile:
    """Read and validate a run file; the bare name of a shipped case, such as three-link-0.9, stands for its run file.

    Args:
        path: the file, or the name of a shipped case.
        allow_code: whether Python code that it names (``module:name``) may be executed when the case is prepared.

    Raises:
        RunFileError: one line that names the file, the line or key, and what was expected.
    """
    where, text = read_text(Path(path), RUNS)
    run = parse_run(text, where)
    run._allows_code = allow_code
    return run


def read_text(path: Path, shelf: Shelf) -> tuple[Path, str]:
    """A small file, the one of this path or the shipped one of this name: where it lies, and its text.

    Raises:
        RunFileError: if it cannot be read, is not UTF-8 or is plainly no file that people write.
    """
    try:
        path = shelf.meant(path)
        content = read_bytes(path, MOST_BYTES)
    except FileNotFoundError as error:
        raise RunFileError(f"{path}: cannot be read ({error.strerror}){shelf.near(path)}") from error
    except OSError as error:
        more = "; a run file is a few kB of TOML" if error.errno == errno.EFBIG else ""
        raise RunFileError(f"{path}: cannot be read ({error.strerror}){more}") from error
    except ValueError as error:  # a name with a zero byte in it
        raise RunFileError(f"{path}: cannot be read ({error})") from error
    try:
        text = content.decode("utf-8-sig")  # some editors begin a file with a byte-order mark
    except UnicodeDecodeError as error:
        raise RunFileError(f"{path}: not UTF-8 text at byte {error.start}") from error
    return path, text.replace("\r\n", "\n")


def parse_run(text: str, path: Path | str = "run.toml") -> RunFile:
    """Validate the text of a run file; ``path`` locates its models and names it in errors.

    Raises:
        RunFileError: one line that names the file and every line or key that is wrong, and what was expected.
    """
    path = Path(path)
    data = parse_toml(text, path)
    try:
        run = RunFile.validated(data, path)
    except RecursionError as error:
        raise RunFileError(f"{path}: nested too deeply") from error
    run._text = text
    return run


def parse_toml(text: str, path: Path) -> dict[str, Any]:
    """TOML as plain data.

    Raises:
        RunFileError: if it is not TOML; the message names ``path``.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise RunFileError(f"{path}: not TOML ({one_line(error, 200)})") from error
    except RecursionError as error:
        raise RunFileError(f"{path}: not TOML that can be read (nested too deeply)") from error
    except ValueError as error:  # an integer of thousands of digits, a date that is none
        why = "an integer of thousands of digits" if "digits" in str(error) else one_line(error, 200)
        raise RunFileError(f"{path}: not TOML that can be read ({why})") from error


class FileOfRuns(TomlTable):
    """Base of the files that name run files: of sweeps, families and experiments."""

    _text: str = PrivateAttr(default="")
    _path: Path = PrivateAttr(default=Path("file.toml"))

    @property
    def text(self) -> str:
        """The TOML text as read."""
        return self._text

    @property
    def path(self) -> Path:
        """The path from which it was read."""
        return self._path

    @classmethod
    def _read(cls, data: Mapping[str, Any], path: Path, text: str) -> Self:
        try:
            made = cls.model_validate(data)
        except ValidationError as error:
            raise RunFileError(f"{path}: {one_line(in_words(error, cls))}") from error
        made._path, made._text = path, text
        return made

    def _run(
        self,
        run: RunFile | str,
        changes: Mapping[str, Any],
        key: str,
        allow_code: bool,
        replaced: Mapping[str, str] | None = None,
    ) -> RunFile:
        """A run file, or the one of this name beside it or shipped, with the values changed that ``key`` gives.

        Args:
            run: the run file, or its name.
            changes: values by key.
            key: where the file has them.
            allow_code: as of :func:`icmj.load_run`.
            replaced: keys whose value is replaced by another one afterwards, and what gives that, in words.
        """
        for name, _ in leaves(changes):
            if name in (replaced or {}):
                raise RunFileError(
                    f"{self._path}: {key}: {name} has no effect, as {(replaced or {})[name]}; leave it out"
                )
        if isinstance(run, str):
            beside = self._path.parent / run
            run = load_run(beside if beside.is_file() else RUNS.meant(Path(run)), allow_code=allow_code)
        try:
            return run.with_(**dict(leaves(changes))) if changes else run
        except RunFileError as error:
            raise RunFileError(f"{self._path}: {key}: {error}") from error


def leaves(table: Mapping[str, Any], at: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys and values of a table of tables."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from leaves(value, f"{at}{key}.")
        else:
            yield f"{at}{key}", value


FIRST = "# written from a plant and a controller that were put together in code\n"


def compose_run(
    actual: LinearPlant, controller: Controller, settings: Settings | None = None, *, name: str, title: str = ""
) -> RunFile:
    """The run file of a linear plant under a controller, both given by their matrices.

    Plants, gains k and L, the matrix of the hold, the rule and the delay are written to it, so that the run file is
    complete: :func:`icmj.prepare` makes the same case from it, and :func:`icmj.run_case` a result that can be logged.

    Args:
        actual: the actual plant; the assumed plant is that of the controller's design.
        controller: the controller; its trigger must be an event rule that run files support.
        settings: settings of its runs; the defaults if ``None``.
        name: name of the case and of its log.
        title: title for figures and tables; by default the name.

    Raises:
        RunFileError: if a run file cannot represent a part of it.
    """
    try:
        expect(controller, Controller, "a composed run file", "write the table [controller] of another kind yourself")
        expect_linear(actual, "the actual plant")
    except AnalysisError as error:
        raise RunFileError(str(error)) from error
    if controller.setpoint:
        raise RunFileError(
            "the controller has a set-point, which a run file has in tables of its own; compose it with "
            "replace(controller, setpoint=None), and add them with run.with_(setpoint=[...])"
        )
    design, delay = controller.design, controller.delay
    rule = dict(controller.trigger.facts())
    data = {
        "case": {"name": name, "title": title or name},
        "assumed": _plant(design.plant) | ({"delay": delay.predicted} if delay else {}),
        "actual": _plant(actual) | ({"delay": delay.t_d} if delay else {}),
        "design": {"k": design.k, "L": design.L},
        "controller": {"hold": "own", "A_h": controller.hold.A_h, "rule": name_of(controller.trigger)}
        | rule
        | ({"sampling_delay": controller.sampling_delay} if controller.sampling_delay else {}),
        "simulation": _settings(settings or Settings()),
    }
    return parse_run(FIRST + to_toml(plain(data)), Path(f"{name}.toml"))


def _plant(plant: LinearPlant) -> dict[str, Any]:
    named = (
        (plant.states, plant.state_units),
        (plant.inputs, plant.input_units),
        (plant.outputs, plant.output_units),
    )
    units = {name: unit for names, of in named for name, unit in zip(names, of, strict=True) if unit}
    given = pick(plant, "A", "B", "C") | ({} if np.array_equal(plant.B_d, plant.B) else {"B_d": plant.B_d})
    return given | pick(plant, "states", "inputs", "outputs") | ({"units": units} if units else {})


def _settings(settings: Settings) -> dict[str, Any]:
    sources = [{"kind": kind_of_course(type(source)), **_source(source)} for source in settings.disturbance]
    given = {name: value for name, value in vars(settings).items() if name != "disturbance"}
    return given | ({"disturbance": sources} if sources else {})


def _source(source: Source) -> dict[str, Any]:
    foreign = set() if getattr(source, "body", None) is not None else {"force", "torque", "point"}
    if isinstance(source, Gaussian):
        foreign.add("size" if source.share else "share")
    return {key: value for key, value in asdict(source).items() if key not in foreign}
