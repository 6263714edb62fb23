"""A branch of cycles along a parameter, with its special points, as data that is stored and read again.

In a Parquet file there is one row for each cycle, all other data in the metadata, restored bit for bit.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.base.files import read_bytes, whole
from icmj.base.parquet import read_parquet, refuse_fatal
from icmj.base.text import one_line, parse_json
from icmj.cycle.return_map import PlantKind
from icmj.errors import IcmjError, LogError
from icmj.runfile.reading import parse_run
from icmj.runfile.schema import RunFile

Kind = Literal[
    "fold", "flip", "symmetry breaking", "Neimark–Sacker", "branch point", "grazing", "least interval", "homoclinic",
    "fall", "end",
]  # fmt: skip
KINDS: tuple[Kind, ...] = get_args(Kind)
FORMAT = 1
_KEY = b"icmj branch"
_MOST_BYTES, _MOST_CYCLES = 400e6, 1_000_000
OF_POINTS = ("value", "intervals", "states", "y_peak", "y_range", "multipliers", "closure", "graze")
ALONG = ("x", "y", "u", "qpos")
COLUMNS = (*OF_POINTS, "t", *ALONG)
_LISTED = ("scale", "alternating")


@dataclass(frozen=True, eq=False)
class SpecialPoint:
    """A bifurcation or an end on a branch.

    Attributes:
        kind: ``fold``: the branch turns back; ``flip``: a cycle with twice as many intervals branches off; ``symmetry
            breaking``: the same for a mirrored cycle, whose halves become different; ``Neimark–Sacker``: a complex
            pair of multipliers crosses the unit circle; ``branch point``: two branches meet; ``grazing``: the event
            function touches zero before the event, or only touches it at the event; ``least interval``: an interval
            decreases to Δ_min or the delay; ``homoclinic``: an interval grows without bound; ``fall``: a position
            reaches its limit; ``end``: the branch ends for another reason.
        value: value of the parameter, to 1e-6 or better.
        index: index of the preceding point of the branch.
        state: z at an event of this cycle, shape (N,); for ``homoclinic`` and ``grazing``, that of the last cycle
            before it.
        intervals: its open-loop intervals [s], shape (p,).
        y_peak: largest magnitude of every output over the period, shape (n_y,).
        multiplier: the multiplier that crosses the unit circle; NaN if none does.
        words: a description in one sentence.
    """

    kind: Kind
    value: float
    index: int
    state: Array
    intervals: Array
    y_peak: Array
    multiplier: complex
    words: str


@dataclass(frozen=True, eq=False)
class Branch:
    """Cycles of one run file along one parameter.

    Attributes:
        run: the run file.
        parameter: name of the parameter.
        plant: ``linear`` or ``mujoco``.
        mirrored: whether the second half of each cycle is the first with opposite sign.
        value: value of the parameter at each of M cycles, shape (M,).
        intervals: open-loop intervals over the period, or over its first half if it is mirrored [s]; shape (M, p).
        states: z at the events, deviations from the operating point, shape (M, p, N).
        scale: size of z on the first cycle, shape (N,).
        y_peak, y_range: largest magnitude and peak-to-peak range of the outputs over the period, shape (M, n_y).
        multipliers: multipliers of P^p, by decreasing magnitude, shape (M, N).
        closure: relative closure errors, shape (M,).
        graze: highest inner maximum of the event function over the threshold squared, shape (M,).
        neutral: number of multipliers that are ±1 by construction.
        alternating: whether each cycle is a mirrored one of a family; see :class:`icmj.cycle.Cycle`. Then one more is
            +1. Shape (M,).
        t: times along each cycle from its first event on [s], K times in each interval; shape (M, p K).
        x, y, u: states, outputs and commands at these times, shapes (M, p K, ...).
        qpos: MuJoCo's positions, shape (M, p K, nq); (M, p K, 0) on the linear plant.
        outputs, inputs, names, units: names of outputs, inputs and plant states; units of the outputs.
        specials: special points, in the order of the branch.
        end: the reason why the branch ends, in one sentence.
    """

    run: RunFile
    parameter: str
    plant: PlantKind
    mirrored: bool
    value: Array
    intervals: Array
    states: Array
    scale: Array
    y_peak: Array
    y_range: Array
    multipliers: NDArray[np.complex128]
    closure: Array
    graze: Array
    neutral: int
    t: Array
    x: Array
    y: Array
    u: Array
    qpos: Array
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    specials: tuple[SpecialPoint, ...]
    end: str
    alternating: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.value)

    @property
    def sign(self) -> int:
        """−1 for mirrored cycles, else +1."""
        return -1 if self.mirrored else 1

    @property
    def events(self) -> int:
        """Number of events per period."""
        return self.intervals.shape[1] * (2 if self.mirrored else 1)

    @property
    def period(self) -> Array:
        """Period [s], shape (M,)."""
        return np.asarray(self.intervals.sum(axis=1) * (2 if self.mirrored else 1))

    @property
    def interval(self) -> Array:
        """Mean open-loop interval [s], shape (M,)."""
        return np.asarray(self.intervals.mean(axis=1))

    @property
    def largest(self) -> Array:
        """Largest magnitude among the multipliers that are not ±1 by construction, shape (M,)."""
        order = np.argsort(np.abs(self.multipliers - self.sign), axis=1)[:, self.neutral :]
        left = np.take_along_axis(self.multipliers, order, axis=1)
        sizes, structural = np.abs(left), np.abs(left - 1).argmin(axis=1)
        sizes[self.alternating, structural[self.alternating]] = 0.0
        return np.asarray(sizes.max(axis=1, initial=0.0))

    @property
    def attracting(self) -> NDArray[np.bool_]:
        """Whether each cycle attracts, shape (M,)."""
        return np.asarray(self.largest < 1)

    @property
    def name(self) -> str:
        """A description, such as ``mirrored period-2 cycles``."""
        return f"{'mirrored ' if self.mirrored else ''}period-{self.events} cycles"


def write_branch(branch: Branch, path: Path | str) -> None:
    """Write a branch as Parquet; the file is either complete or absent.

    Each column contains a list of numbers for each cycle, in row-major order; the shapes are in the metadata.
    ``multipliers`` are pairs (re, im).

    Raises:
        LogError: if the file cannot be written.
    """
    import pyarrow as pa
    from pyarrow import parquet

    path = Path(path)
    head, flat = pack(branch)
    columns = {}
    for name, values in flat.items():
        width = values.size // len(branch)
        ends = np.arange(len(branch) + 1, dtype=np.int64) * width
        one = getattr(branch, name).ndim == 1
        columns[name] = pa.array(values) if one else pa.LargeListArray.from_arrays(pa.array(ends), pa.array(values))
    table = pa.table(columns).replace_schema_metadata({_KEY: head.encode()})
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as part:
            parquet.write_table(table, part)
    except (OSError, pa.ArrowException) as error:
        raise LogError(f"{path}: the branch cannot be written ({one_line(error, 200)})") from error


def read_branch(path: Path | str) -> Branch:
    """Read a branch that :func:`icmj.cycle.write_branch` wrote.

    Raises:
        LogError: if the file does not exist, or is not a branch of this version.
    """
    import pyarrow as pa

    path = Path(path)
    try:
        refuse_fatal(path)
        table = read_parquet(read_bytes(path, _MOST_BYTES), _MOST_CYCLES, _MOST_BYTES)
        flat = {}
        for name in COLUMNS:
            column = table.column(name).combine_chunks()
            values = column.flatten() if isinstance(column, pa.LargeListArray) else column
            flat[name] = values.to_numpy(zero_copy_only=False)
        return unpack(table.schema.metadata[_KEY].decode(), flat)
    except IcmjError as error:
        raise LogError(f"{path}: {error}") from error
    except (OSError, pa.ArrowException, LookupError, TypeError, ValueError) as error:
        raise LogError(f"{path}: not a branch that icmj wrote ({one_line(error, 200)})") from error


def read_branches(paths: Sequence[Path]) -> tuple[list[Branch], list[Path]]:
    """The branches that Parquet files among some paths hold, and the other paths.

    Raises:
        LogError: if a Parquet file is no branch.
    """
    parquet = [path for path in paths if path.suffix == ".parquet"]
    return [read_branch(path) for path in parquet], [path for path in paths if path not in parquet]


def pack(branch: Branch) -> tuple[str, dict[str, Array]]:
    """A branch as JSON text and flat arrays of numbers by name."""
    shapes, flat = {}, {}
    for name in COLUMNS:
        values = getattr(branch, name)
        if np.iscomplexobj(values):
            values = np.stack([values.real, values.imag], axis=-1)
        shapes[name] = list(values.shape[1:])
        flat[name] = np.ascontiguousarray(values, dtype=float).ravel()
    return json.dumps(make_head(branch, shapes)), flat


def unpack(text: str, flat: Mapping[str, Array]) -> Branch:
    """The branch from what :func:`pack` gave.

    Raises:
        LogError: if it is of another version.
        LookupError, TypeError, ValueError: if it is none.
    """
    head = parse_json(text)
    if head["format"] != FORMAT:
        raise LogError(f"a branch of format {head['format']}; this version reads {FORMAT}")
    parts: dict[str, Any] = {}
    for name in COLUMNS:
        parts[name] = np.array(flat[name], dtype=float).reshape([len(flat["value"]), *head["shapes"][name]])
    parts["multipliers"] = parts["multipliers"][..., 0] + 1j * parts["multipliers"][..., 1]
    return make_branch(head, parts)


def make_head(branch: Branch, shapes: dict[str, list[int]]) -> dict[str, Any]:
    rest = {f.name: getattr(branch, f.name) for f in fields(branch) if f.name not in (*COLUMNS, "run", "specials")}
    return {
        **{name: value.tolist() if name in _LISTED else value for name, value in rest.items()},
        "format": FORMAT,
        "shapes": shapes,
        "run": {"text": branch.run.text, "path": branch.run.path.as_posix(), "changes": dict(branch.run.changes)},
        "specials": [
            {
                **{name: getattr(s, name) for name in ("kind", "value", "index", "words")},
                "state": s.state.tolist(),
                "intervals": s.intervals.tolist(),
                "y_peak": s.y_peak.tolist(),
                "multiplier": [s.multiplier.real, s.multiplier.imag],
            }
            for s in branch.specials
        ],
    }


def make_branch(head: dict[str, Any], parts: dict[str, Any]) -> Branch:
    specials = []
    for s in head["specials"]:
        if s["kind"] not in KINDS:
            raise ValueError(f"a special point of kind {s['kind']!r}")
        arrays = {name: np.array(s[name], dtype=float) for name in ("state", "intervals", "y_peak")}
        specials.append(SpecialPoint(**{**s, **arrays, "multiplier": complex(*s["multiplier"])}))
    rest: dict[str, Any] = {name: head[name] for name in ("parameter", "plant", "mirrored", "neutral", "end")}
    # of a file that says it once, or not at all, it holds for all
    rest["alternating"] = np.broadcast_to(head.get("alternating", False), parts["value"].shape).astype(bool)
    names: dict[str, Any] = {name: tuple(head[name]) for name in ("outputs", "inputs", "names", "units")}
    run = parse_run(head["run"]["text"], head["run"]["path"]).recall(head["run"].get("changes", {}))
    return Branch(
        run=run, **rest, **names, **parts, scale=np.array(head["scale"], dtype=float), specials=tuple(specials)
    )
