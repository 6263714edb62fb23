"""The files of a model: its own, those of the models that it includes or attaches, and what they refer to."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterator
from html import unescape
from itertools import islice
from pathlib import Path

from icmj.base.files import read_bytes
from icmj.errors import ModelError

MOST_BYTES = 20_000_000  # of one MJCF file
FOLDERS = 20  # of meshes and textures that are looked into

_MODELS = re.compile(r"""<(?:include|model)\b[^>]*?\bfile\s*=\s*["']([^"']*)["']""")
_FILES = re.compile(r"""\bfile\w*\s*=\s*["']([^"']*)["']""")
_FOLDERS = re.compile(r"""\b(?:mesh|texture|asset)dir\s*=\s*["']([^"']*)["']""")
_STRIPPED = re.compile(r"""\bstrippath\s*=\s*["']true["']""")
_NO_UTF8 = re.compile("[\udc80-\udcff]")  # what "surrogateescape" makes of such bytes


def list_files(path: Path) -> tuple[Path, ...]:
    """A model's file, those of the models that it includes or attaches, and all others that they refer to.

    Raises:
        ModelError: if one cannot be read.
    """
    return tuple(found for found, _ in read_contents(path))


def read_contents(model: Path) -> list[tuple[Path, bytes]]:
    """The files of a model with their contents; for files other than models, with size and time of change.

    Folders of meshes and textures that one file names hold for the files of all: which wins is the compiler's to say.
    """
    found: dict[Path, bytes] = {}
    seen: set[Path] = set()
    named: dict[tuple[Path, str], bool] = {}  # whether it is a model
    folders: dict[Path, None] = {Path(): None}

    def places(models: bool) -> Iterator[tuple[Path, os.stat_result]]:
        for (parent, name), is_model in sorted(named.items()):
            for path in (parent / folder / name for folder in folders if is_model is models):
                if (state := _state(model, path)) is not None and path.resolve() not in seen:
                    yield path, state

    left, stripped = [model], False
    while left:
        for path in left:
            if path.resolve() in seen:
                continue
            seen.add(path.resolve())
            text, found[path] = _text(path)
            listed = map(Path, map(unescape, _FOLDERS.findall(text)))
            folders |= dict.fromkeys(islice(listed, max(FOLDERS - len(folders), 0)))
            models, stripped = set(_MODELS.findall(text)), stripped or bool(_STRIPPED.search(text))
            for name in {*_FILES.findall(text)}:
                named |= {(parent, unescape(name)): name in models for parent in (model.parent, path.parent)}
        # of all, as a folder may be named after those files that refer to what is in it
        left = [path for path, _ in places(models=True)]
    if stripped:
        named |= {(parent, re.split(r"[/\\]", name)[-1]): False for (parent, name), of in named.items() if not of}
    for path, state in places(models=False):
        found.setdefault(path, f"{path} {state.st_size} {state.st_mtime_ns}".encode(errors="surrogateescape"))
    return list(found.items())


def _text(path: Path) -> tuple[str, bytes]:
    """The text of a model without its comments, and its content.

    Raises:
        ModelError: if it cannot be read, or is not UTF-8.
    """
    try:
        content = read_bytes(path, MOST_BYTES)
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {error.strerror}") from error
    text = content.decode(errors="surrogateescape")
    text = re.sub(r"<!--.*?-->", lambda comment: "\n" * comment.group().count("\n"), text, flags=re.DOTALL)
    if wrong := _NO_UTF8.search(text):
        line, byte = text.count("\n", 0, wrong.start()) + 1, ord(wrong.group()) - 0xDC00
        raise ModelError(f"{path}: line {line} is not UTF-8 (byte 0x{byte:02x}); save the file as UTF-8")
    return text, content


def _state(model: Path, path: Path) -> os.stat_result | None:
    """Size and time of change of a file that a model refers to; only regular files, as reading a pipe would block."""
    try:
        state = path.stat()
    except (OSError, ValueError):
        return None  # no name of a file; MuJoCo says so
    if stat.S_ISREG(state.st_mode):
        return state
    if not stat.S_ISDIR(state.st_mode):
        raise ModelError(f"{model}: refers to {path}, which is not a file")
    return None
