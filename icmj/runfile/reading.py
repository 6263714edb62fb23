"""Reading run files: from TOML text to a validated run file, or to one line that says what is wrong."""

from __future__ import annotations

import errno
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Self

from pydantic import PrivateAttr, ValidationError

from icmj.base.files import read_bytes
from icmj.base.text import one_line
from icmj.errors import RunFileError
from icmj.runfile.messages import in_words
from icmj.runfile.schema import RunFile
from icmj.runfile.table import TomlTable
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
        raise RunFileError(f"{path}: cannot be read: {error.strerror}{shelf.near(path)}") from error
    except OSError as error:
        more = "; a run file is a few kB of TOML" if error.errno == errno.EFBIG else ""
        raise RunFileError(f"{path}: cannot be read: {error.strerror}{more}") from error
    except ValueError as error:  # a name with a zero byte in it
        raise RunFileError(f"{path}: cannot be read: {error}") from error
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
        raise RunFileError(f"{path}: not TOML: {one_line(error, 200)}") from error
    except RecursionError as error:
        raise RunFileError(f"{path}: not TOML that can be read: nested too deeply") from error
    except ValueError as error:  # an integer of thousands of digits, a date that is none
        why = "an integer of thousands of digits" if "digits" in str(error) else one_line(error, 200)
        raise RunFileError(f"{path}: not TOML that can be read: {why}") from error


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

    def _run(self, run: RunFile | str, changes: Mapping[str, Any], key: str, allow_code: bool) -> RunFile:
        """A run file, or the one of this name beside it or shipped, with the values changed that ``key`` gives."""
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
