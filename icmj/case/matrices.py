"""Plants that a run file gives by matrices: written out in it, or in a file beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from icmj.base.array import real
from icmj.base.files import read_bytes
from icmj.base.npz import read_npz
from icmj.base.text import one_line, parse_json
from icmj.errors import AnalysisError, IcmjError, RunFileError
from icmj.plant.activation import Activation
from icmj.plant.linear_plant import LinearPlant, deviate, match_ports, refuse_unusual
from icmj.plant.quality import MatrixPlant
from icmj.runfile.plant_tables import LETTERS, PlantTable
from icmj.runfile.schema import RunFile

KINDS = ("states", "inputs", "outputs")
BESIDE = ("D", "E", "dt")
PUSHED = "B_d"
MOST_BYTES = 10_000_000  # a plant of 200 states takes less than one, even as text


def assumed_matrices(run: RunFile) -> MatrixPlant:
    """The assumed plant of a run file that gives it by matrices.

    Raises:
        RunFileError: if they, or their names, do not make a plant.
    """
    plant = _plant(run, run.assumed, "assumed", None)
    try:
        return MatrixPlant.of(_behind(run.assumed_activation, plant))
    except IcmjError as error:
        raise RunFileError(f"{run.path}: assumed: {error}") from error


def actual_matrices(run: RunFile, assumed: LinearPlant) -> MatrixPlant:
    """The actual plant of a run file that gives it by matrices: its own, or the assumed plant's, and its input gain.

    ``assumed`` is the assumed plant without activation dynamics. ρ takes it from there to what the run file says (the
    paper's family A = Â − ρÃ₁).

    Raises:
        RunFileError: if they do not make a plant, or none that fits the assumed one.
    """
    table = run.actual
    plant = _plant(run, table, "actual", assumed) if table.given else assumed
    try:
        if table.given:
            plant = _align(plant, assumed)
            plant = deviate(assumed, plant, table.rho) if table.rho != 1.0 else plant
        gain = np.asarray(table.gain, dtype=float)
        if gain.ndim and gain.size != plant.n_u:
            raise AnalysisError(f"gain has {gain.size} entries for {plant.n_u} inputs")
        return MatrixPlant.of(_behind(run.actual_activation, plant).scaled(1 + table.rho * (gain - 1)))
    except IcmjError as error:
        raise RunFileError(f"{run.path}: actual: {error}") from error


def read_matrices(path: Path) -> dict[str, Any]:
    """A, B, C and names of states, inputs and outputs, as far as they are there, from ``.npz`` or ``.json``.

    Raises:
        RunFileError: if the file cannot be read, or lacks one of the matrices.
    """
    try:
        if path.suffix == ".json":
            found = parse_json(read_bytes(path, MOST_BYTES))
        elif path.suffix == ".npz":
            content = BytesIO(read_bytes(path, MOST_BYTES))
            arrays = read_npz(content, MOST_BYTES, (*LETTERS, PUSHED, *BESIDE, *KINDS))
            found = {name: array.tolist() for name, array in arrays.items()}
        else:
            raise RunFileError(f"{path}: matrices are read from .npz and .json")
    except OSError as error:
        raise RunFileError(f"{path}: cannot be read ({error.strerror or one_line(error, 200)})") from error
    except (ValueError, RecursionError, MemoryError) as error:
        raise RunFileError(f"{path}: holds no matrices that can be read ({one_line(error, 200)})") from error
    if not isinstance(found, dict) or not all(letter in found for letter in LETTERS):
        raise RunFileError(f"{path}: expected the matrices A, B and C by these names")
    return found


def _plant(run: RunFile, table: PlantTable, which: str, like: LinearPlant | None) -> LinearPlant:
    """The plant of one table; names that it lacks are those of the plant ``like``, which must have the same sizes."""
    data: Mapping[str, Any] = {letter: getattr(table, letter) for letter in (*LETTERS, PUSHED)}
    where = f"{run.path}: {which}"
    if table.matrices is not None:
        data = read_matrices(run.path.parent / table.matrices)
        where = f"{where}: {table.matrices}"
    try:
        A, B, C = (_matrix(data[letter], letter) for letter in LETTERS)
        refuse_unusual(**{name: data.get(name) for name in BESIDE})
        B_d = np.zeros((0, 0)) if data.get(PUSHED) is None else _matrix(data[PUSHED], PUSHED)
        plant = LinearPlant(A, B, C, *(_names(table, data, kind) for kind in KINDS), B_d=B_d)
        if like is not None:
            plant = _name_ports(plant, like, [kind for kind in KINDS if not _names(table, data, kind)])
        return _add_units(plant, table, data)
    except AnalysisError as error:
        raise RunFileError(f"{where}: {error}") from error


def _align(plant: LinearPlant, assumed: LinearPlant) -> LinearPlant:
    """The plant with inputs and outputs in the order of the assumed one's."""
    for kind in KINDS[1:]:
        here, there = getattr(plant, kind), getattr(assumed, kind)
        if sorted(here) != sorted(there):
            raise AnalysisError(
                f"{kind} {', '.join(here)}; expected those of the assumed plant, {', '.join(there)}, in any order"
            )
    return match_ports(plant, assumed)


def _behind(activation: Activation | None, plant: LinearPlant) -> LinearPlant:
    """The plant behind the lags of its muscles."""
    return plant if activation is None else activation.before(plant)


def _matrix(rows: object, letter: str) -> np.ndarray:
    M = real(rows, letter, AnalysisError)  # type: ignore[arg-type]
    if M.ndim == 1:  # of a single input, or output
        M = M[:, None] if letter in ("B", PUSHED) else M[None, :]
    if M.ndim != 2 or 0 in M.shape:
        raise AnalysisError(f"{letter} is not a matrix; it has shape {M.shape}")
    return M


def _names(table: PlantTable, data: Mapping[str, Any], kind: str) -> tuple[str, ...]:
    names = getattr(table, kind)
    if names is None:
        names = data.get(kind) or ()
        if not (isinstance(names, list | tuple) and all(isinstance(name, str) for name in names)):
            raise AnalysisError(f"{kind} are not names")
    twice = {name for name in names if list(names).count(name) > 1}
    if twice:
        raise AnalysisError(f"{kind}: {min(twice)!r} is named twice")
    return tuple(names)


def _name_ports(plant: LinearPlant, like: LinearPlant, nameless: list[str]) -> LinearPlant:
    for kind in nameless:
        if len(getattr(plant, kind)) == len(getattr(like, kind)):
            unit = f"{kind.removesuffix('s')}_units"
            plant = replace(plant, **{kind: getattr(like, kind), unit: getattr(like, unit)})
    return plant


def _add_units(plant: LinearPlant, table: PlantTable, data: Mapping[str, Any]) -> LinearPlant:
    """The plant with its units: those in the file, list by list, and those in the run file, by name."""
    in_file = data.get("units")
    known = {*plant.states, *plant.inputs, *plant.outputs}
    for name in table.units:
        if name not in known:
            raise AnalysisError(f"units: no {name!r} in the plant; expected one of {', '.join(sorted(known))}")
    units: dict[str, Any] = {}
    for kind in KINDS:
        key = f"{kind.removesuffix('s')}_units"
        before = getattr(plant, key)
        listed = in_file.get(kind) if isinstance(in_file, dict) else None
        if isinstance(listed, list) and len(listed) == len(before):
            before = tuple(str(unit) for unit in listed)
        units[key] = tuple(table.units.get(name, unit) for name, unit in zip(getattr(plant, kind), before, strict=True))
    return replace(plant, **units)
