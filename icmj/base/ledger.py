"""Files that are trusted when they are read again: written with their digests beside them, and compared with these.

The digests are in ``SHA256SUMS`` of a folder, for it and the folders in it; ``sha256sum -c`` reads them. A digest is
there before its file is, so that a process that dies in between leaves a file that is either new or as it was before.
A file may have several: any content that was written there is known.
"""

from __future__ import annotations

import errno
import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from icmj.base.files import open_file, read_bytes, regular, whole

SUMS = "SHA256SUMS"
_MOST_SUMS = 200e6  # bytes: two million files
_LARGEST = 1e11  # bytes of a file whose digest is asked for


class Ledger:
    """The digests of the files in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known: frozenset[str] = frozenset()

    @contextmanager
    def seal(self, target: Path) -> Iterator[Path]:
        """A path to write to, as of :func:`icmj.base.files.whole`; the digest of what is written there is noted.

        Raises:
            OSError: if it cannot be written, or its digest cannot.
        """
        with whole(target) as part:
            yield part
            with open(part, "r+b") as file:
                os.fsync(file.fileno())
            self._note(self._line(target, digest_of(part)))

    def read(self, path: Path, most: float) -> bytes:
        """The content of a file of at most ``most`` bytes that was sealed.

        Raises:
            OSError: if it cannot be read, or is not as it was written; the reason is in its ``strerror``.
        """
        content = read_bytes(path, most)
        line = self._line(path, hashlib.sha256(content).hexdigest())
        if line not in self._known:
            self._known = self._read()
            if line not in self._known:
                words = f"{path.name} is not as it was written: its SHA-256 is not in {SUMS}"
                raise OSError(errno.EINVAL, words, str(path))
        return content

    def _line(self, path: Path, digest: str) -> str:
        return f"{digest}  {path.relative_to(self._folder).as_posix()}"

    def _read(self) -> frozenset[str]:
        try:
            content = read_bytes(self._folder / SUMS, _MOST_SUMS)
        except FileNotFoundError:
            return frozenset()
        return frozenset(content.decode(errors="replace").split("\n"))

    def _note(self, line: str) -> None:
        """Add a line, after the end of one that a process or a full disk left unfinished."""
        path = self._folder / SUMS
        with os.fdopen(regular(path, os.O_RDWR | os.O_APPEND | os.O_CREAT), "a+b", buffering=0) as file:
            torn = file.seek(0, os.SEEK_END) > 0 and file.seek(-1, os.SEEK_END) >= 0 and file.read(1) != b"\n"
            text = b"\n" * torn + line.encode() + b"\n"
            if file.write(text) != len(text):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
            os.fsync(file.fileno())


def digest_of(path: Path) -> str:
    """SHA-256 of a regular file, as hexadecimal text.

    Raises:
        OSError: if it cannot be read.
    """
    with open_file(path, _LARGEST) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
