"""Reading run files: TOML text in, a validated run file out, or one line that says what is wrong."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from icmj.errors import RunFileError
from icmj.runfile.schema import RunFile


def load_run(path: Path | str) -> RunFile:
    """Read and validate a run file.

    Raises:
        RunFileError: one line that names the file, the line or key, and what was expected.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise RunFileError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise RunFileError(f"{path}: not UTF-8 text at byte {error.start}") from error
    return parse_run(text, path)


def parse_run(text: str, path: Path | str = "run.toml") -> RunFile:
    """Validate the text of a run file; ``path`` locates its models and names it in errors.

    Raises:
        RunFileError: one line that names the file, the line or key, and what was expected.
    """
    path = Path(path)
    try:
        data: dict[str, Any] = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise RunFileError(f"{path}: not TOML: {error}") from error
    run = RunFile.validated(data, path)
    run._text = text
    return run
