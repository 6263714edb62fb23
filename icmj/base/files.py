"""Files that appear under their name only when they are complete."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

SUFFIX = ".tmp"
"""Ends the name of a file under way; whatever has it was left by a run that ended, and may be deleted."""


@contextmanager
def whole(target: Path) -> Iterator[Path]:
    """A path beside ``target`` to write to; renamed to it if the block ends well, removed if it does not.

    The path is of this block alone, so that two processes may write the same target; the later one wins.

    Raises:
        OSError: if it cannot be renamed.
    """
    part = target.with_name(f".{target.name}.{uuid.uuid4().hex[:8]}{SUFFIX}")
    try:
        yield part
        os.replace(part, target)
    finally:
        with suppress(OSError):
            part.unlink()


def write_text(target: Path, text: str) -> None:
    """Write ``text`` as UTF-8, whole or not at all.

    Raises:
        OSError: if it cannot be written.
    """
    with whole(target) as part:
        part.write_text(text, encoding="utf-8")


def write_bytes(target: Path, content: bytes) -> None:
    """Write ``content``, whole or not at all.

    Raises:
        OSError: if it cannot be written.
    """
    with whole(target) as part:
        part.write_bytes(content)
