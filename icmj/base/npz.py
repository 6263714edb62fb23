"""Arrays from an untrusted npz file: without pickles, within bounds, with one kind of error.

A few kilobytes may stand for gigabytes: repeated values take no room in a file. What a file says of its sizes is
checked before anything is read.
"""

from __future__ import annotations

import zipfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from icmj.base.files import open_file
from icmj.base.text import one_line

_END = ".npy"
_LARGEST = 1e9  # bytes of a file


def read_npz(path: Path | BinaryIO, most_bytes: float, only: Collection[str] = ()) -> dict[str, Any]:
    """The arrays of a file, or of one that is open, by name, or only those of some names.

    What is pickled is refused, files other than arrays are left out.

    Raises:
        ValueError: in one line, if they are more than so many bytes, or it cannot be read as an npz file.
        OSError: if the file cannot be opened.
    """
    return dict(iterate_npz(path, most_bytes, only))


def iterate_npz(path: Path | BinaryIO, most_bytes: float, only: Collection[str] = ()) -> Iterator[tuple[str, Any]]:
    """The arrays of :func:`read_npz`, one after the other, so that not all need be in memory at once.

    Raises:
        ValueError, OSError: as :func:`read_npz`.
    """
    with _open_npz(path) as packed:
        members = {member.filename.removesuffix(_END): member for member in _arrays(packed)}
        chosen = {name: member for name, member in members.items() if not only or name in only}
        size = sum(member.file_size for member in chosen.values())
        for name, member in chosen.items() if size <= most_bytes else ():
            with packed.open(member) as stream:
                array = np.lib.format.read_array(stream, allow_pickle=False)
            yield name, array
    if size > most_bytes:
        raise ValueError(f"{size / 1e6:.0f} MB of arrays; expected at most {most_bytes / 1e6:g} MB")


def read_npz_headers(path: Path) -> dict[str, tuple[tuple[int, ...], np.dtype[Any]]]:
    """Shape and type of each array in ``path`` by name, from their headers alone.

    Raises:
        ValueError: in one line, if it cannot be read as an npz file, or holds what is pickled.
        OSError: if the file cannot be opened.
    """
    found = {}
    with _open_npz(path) as packed:
        for member in _arrays(packed):
            with packed.open(member) as stream:
                version = np.lib.format.read_magic(stream)
                read = getattr(np.lib.format, f"read_array_header_{min(version[0], 2)}_0")
                shape, _, kind = read(stream)
            if kind.hasobject:
                raise TypeError(f"{member.filename!r} is pickled")
            found[member.filename.removesuffix(_END)] = shape, kind
    return found


def _arrays(packed: zipfile.ZipFile) -> list[zipfile.ZipInfo]:
    return [member for member in packed.infolist() if member.filename.endswith(_END)]


@contextmanager
def _open_npz(path: Path | BinaryIO) -> Iterator[zipfile.ZipFile]:
    with open_file(path, _LARGEST) if isinstance(path, Path) else nullcontext(path) as stream:
        try:
            with zipfile.ZipFile(stream) as packed:
                yield packed
        except Exception as error:  # zipfile, zlib and numpy's reader of headers raise a dozen types on damaged files
            raise ValueError(f"not an npz file of plain arrays ({one_line(error, 160)})") from error
