"""NumPy's npz: a vector for each signal; arrays of text hold their names and units, and a text the facts as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from icmj.base.npz import iterate_npz, read_npz, read_npz_headers
from icmj.errors import DataError
from icmj.series.columns import MOST_NUMBERS, choose_columns
from icmj.series.long_table import find_labels
from icmj.series.series import Series

SUFFIXES = (".npz",)
_MOST_WORDS = 10_000_000  # bytes of names and units
_MOST_LABELS = 200_000_000  # bytes of what names trials


def read(path: Path, file: BinaryIO, columns: Sequence[str], rate: float | None) -> tuple[Series, ...]:
    import pyarrow as pa

    try:
        headers = read_npz_headers(path)
        told = read_npz(path, _MOST_WORDS, ("names", "units")) if "names" in headers else {}
        if any(texts.dtype.kind not in "US" for texts in told.values()):
            raise DataError("names and units are not arrays of text")
        kept = {name: one for name, one in headers.items() if name not in ("names", "units", "facts")}
        labels = {list(kept)[at] for at in find_labels(list(kept), columns)}
        texts = [name for name, (_, kind) in kept.items() if name in labels or (kind.kind in "US" and not columns)]
        cells = read_npz(path, _MOST_LABELS, tuple(texts)) if texts else {}
        kept = {name: one for name, one in kept.items() if name not in labels}
        shapes = {name: shape for name, (shape, kind) in kept.items() if kind.kind in "fiu" and shape}
        several = [name for name, shape in shapes.items() if len(shape) == 2 and shape[1] > 1]
        if several:
            raise DataError(f"{several[0]} has shape {shapes[several[0]]}; save each column under a name of its own")
        vectors = [name for name, shape in shapes.items() if shape[1:] in ((), (1,))]
        left = [f"{name}, which is no vector of numbers" for name in kept if name not in vectors]
        lengths = {headers[name][0][0] for name in vectors} | {
            cells[name].shape[0] if cells[name].ndim == 1 else -1 for name in labels
        }
        if len(lengths) != 1:
            raise DataError("expected one-dimensional arrays of numbers, all of the same length")
        names, own = (told.get(key, np.zeros(0, str)).astype(str).ravel().tolist() for key in ("names", "units"))
        known = dict(zip(names, own, strict=False))
        choice = choose_columns(vectors, [known.get(name, "") for name in vectors], columns, rate, left)
        data = choice.room(lengths.pop())
        chosen = [vectors[i] for i in choice.at]
        for name, values in iterate_npz(path, 8 * MOST_NUMBERS * 2, chosen):
            data[:, [i for i, other in enumerate(chosen) if other == name]] = values.reshape(-1, 1)
    except DataError:
        raise
    except ValueError as error:
        raise DataError(str(error)) from error
    alike = [(name, each.astype(str)) for name, each in cells.items() if each.shape == (len(data),)]
    return choice.to_trials(data, [(name, pa.chunked_array([each])) for name, each in alike])


def write(series: Series, part: Path) -> None:
    arrays = {"t": series.t, **{name: series.values[:, i] for i, name in enumerate(series.names)}}
    own = sorted({"t", "names", "units", "facts"} & set(series.names))
    if own:
        raise DataError(f"the name {own[0]!r} is reserved in npz files; rename the signal")
    facts = {
        "names": np.array(["t", *series.names]),
        "units": np.array(["s", *series.units]),
        "facts": np.array(json.dumps(dict(series.facts), ensure_ascii=False)),
    }
    with open(part, "wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays, **facts)
