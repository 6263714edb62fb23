"""Arrays from an npz file that somebody else may have made: without pickles, within bounds, one kind of error."""

from __future__ import annotations

import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from icmj.base.text import one_line


def read_npz(path: Path, most_bytes: float, only: Collection[str] = ()) -> dict[str, Any]:
    """The arrays in ``path`` by name, or only those of some names; what is pickled is refused, other files left out.

    Raises:
        ValueError: in one line, if there is more in it than so many bytes, or it cannot be read as an npz file.
        OSError: if the file cannot be opened.
    """
    with path.open("rb") as stream:
        try:
            with zipfile.ZipFile(stream) as packed:
                members = {member.filename: member.file_size for member in packed.infolist()}
            if (size := sum(members.values())) <= most_bytes:
                stream.seek(0)
                with np.load(stream, allow_pickle=False) as file:
                    named = [name.removesuffix(".npy") for name in members if name.endswith(".npy")]
                    arrays = {name: file[name] for name in named if not only or name in only}
                if wrong := [name for name, array in arrays.items() if not isinstance(array, np.ndarray)]:
                    raise TypeError(f"{wrong[0]!r} is no array")
                return arrays
        except Exception as error:  # zipfile, zlib and numpy's reader of headers raise a dozen types on damaged files
            raise ValueError(f"not an npz file of plain arrays ({one_line(error, 160)})") from error
    raise ValueError(f"{size / 1e6:.0f} MB of arrays; expected at most {most_bytes / 1e6:g} MB")
