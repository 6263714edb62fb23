"""The archive: a result as one JSON tree and named flat arrays, bit-exact both ways.

The walk knows dataclasses, arrays, run files and plain values, and nothing else; it builds only the classes listed
here, so a log can carry data but no code. A digest over everything tells when a stored bit has changed. The files of a
run file go with it, so that the log can be analysed where these files do not exist.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from icmj.base.files import read_bytes
from icmj.base.text import one_line
from icmj.case.references import plant_files
from icmj.case.result import AmplitudeLaw, Attractor, Growth, Result
from icmj.controller.controller import Controller
from icmj.controller.delay import Delay
from icmj.controller.design import Design
from icmj.controller.hold import Hold
from icmj.controller.law import RecordedLaw
from icmj.controller.layout import Layout
from icmj.controller.realisation import Guard, Mode, Rates, Realisation
from icmj.controller.rules import RULES
from icmj.controller.setpoint import Setpoint
from icmj.controller.trigger import ClockTrigger, Continuous, RecordedRule
from icmj.errors import IcmjError, LogError
from icmj.log.validation import validate
from icmj.measurement.measurement import Measurement
from icmj.measurement.statistics import Estimate, Spectrum, Statistics
from icmj.plant.linear_plant import LinearPlant, Push
from icmj.runfile.controllers import CONTROLLERS
from icmj.runfile.reading import parse_run
from icmj.runfile.schema import MOST_BYTES, BundledFiles, RunFile
from icmj.simulation.disturbance import make_acting
from icmj.simulation.ending import Outcome
from icmj.simulation.labels import Labels
from icmj.simulation.pressure import Pressure
from icmj.simulation.rows import collect_drives
from icmj.simulation.simulation import Events, Simulation
from icmj.theory.crossing import Crossing
from icmj.theory.neutral_modes import NeutralMode
from icmj.theory.orbit import Orbit
from icmj.theory.orbit_family import OrbitFamily
from icmj.theory.prediction import PredictedOrbit, Prediction

_DATA: tuple[type, ...] = (
    *(LinearPlant, Push, Design, Hold, Delay, Setpoint, Controller),
    *(*RULES.collect("RULE"), ClockTrigger, Continuous, RecordedRule),
    *(Crossing, NeutralMode, OrbitFamily, Orbit, PredictedOrbit, Prediction),
    *(Events, Labels, Outcome, Pressure, Simulation, Measurement),
    *(Estimate, Spectrum, Statistics),
    *(Growth, AmplitudeLaw, Attractor, Result),
    *(Layout, Rates, Mode, Guard, Realisation, RecordedLaw),
    *(law for laws in CONTROLLERS.collect("LAWS") for law in laws),
)
_CLASSES = {cls.__name__: cls for cls in _DATA}
_FORMER = {"Family": OrbitFamily}  # as logs of before call them
_LEFT_OUT = {("Result", "scene")}  # stored as what it is for, the 3D entities

_KINDS = "fciub"  # float, complex, integers, bool

Flat = dict[str, NDArray[Any]]


def pack(result: Result) -> tuple[str, Flat]:
    """The tree as JSON text, and the arrays by their dotted place in it, flattened row by row.

    Complex arrays are stored as (re, im) pairs; dtype and shape are in the tree.

    Raises:
        LogError: if the result holds something that has no place in a log.
    """
    arrays: Flat = {}
    # of a rule, or a controller, of somebody's own a log carries the numbers, and says where the code is
    result = replace(result, controller=result.controller.to_record())
    return json.dumps(_encode(result, "", arrays), ensure_ascii=False), arrays


def unpack(tree: str, arrays: Flat) -> Result:
    """The result from what :func:`pack` gave, every array bit for bit.

    Raises:
        LogError: if tree and arrays do not make a result of this version of icmj, or what they make does not hold
            what its dataclasses promise.
    """
    try:
        result = _decode(parts := json.loads(tree), arrays)
        # of a log of before, its run file says when what is given jumps
        if type(result) is Result and "edges" not in parts["simulation"]:
            acting = make_acting(result.actual, result.run.simulation.settings())
            drives = collect_drives(result.controller, acting, result.simulation.t)
            result = replace(result, simulation=replace(result.simulation, edges=drives["edges"]))
        # a prediction of before called a cycle predicted by the paper's condition
        if type(result) is Result and result.prediction and "others" not in parts["prediction"]:
            result = replace(result, prediction=_judged_by_orbit(result.prediction))
    except IcmjError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, MemoryError, RecursionError) as error:
        raise LogError(f"the archive is not one of this version of icmj ({one_line(error, 200)})") from error
    if type(result) is not Result:
        raise LogError("the archive holds no result")
    validate(result)
    return result


def _judged_by_orbit(prediction: Prediction) -> Prediction:
    """The prediction of a log of before: a cycle is predicted where its orbit attracts."""
    cycle = prediction.verdict == "attracting" and prediction.orbit is not None
    return replace(prediction, cycle=cycle, period=prediction.orbit.period if cycle and prediction.orbit else None)


def digest(tree: str, arrays: Flat) -> str:
    """SHA-256 over the tree and every array with its name, as hexadecimal text."""
    total = hashlib.sha256(tree.encode())
    for key in sorted(arrays):
        total.update(f"\0{key}\0".encode())
        total.update(np.ascontiguousarray(arrays[key]).tobytes())
    return total.hexdigest()


def _encode(value: Any, key: str, arrays: Flat) -> Any:
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in _KINDS:
            raise LogError(f"{key}: an array of {value.dtype} has no place in a log")
        flat = np.ascontiguousarray(value).reshape(-1)
        if value.dtype.kind == "c":
            flat = flat.view(flat.real.dtype)
        elif value.dtype.kind == "b":
            flat = flat.view(np.uint8)
        arrays[key] = flat
        return {"@array": key, "dtype": value.dtype.str, "shape": list(value.shape)}
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return float(value)
    if isinstance(value, complex):
        return {"@complex": [value.real, value.imag]}
    if isinstance(value, RunFile):
        told: dict[str, Any] = {"@run": value.text, "path": value.path.as_posix()}
        if value.changes:
            told["changes"] = dict(value.changes)
        if (carried := keep_files(value)).files:
            told["kept"] = {"place": carried.place, "assumed": carried.assumed, "actual": carried.actual}
            told["files"] = [
                [name, _encode(np.frombuffer(content, np.uint8), f"{key}.files.{i}", arrays)]
                for i, (name, content) in enumerate(carried.files.items())
            ]
        return told
    if is_dataclass(value) and type(value).__name__ in _CLASSES:
        name = type(value).__name__
        kept = [f.name for f in fields(value) if (name, f.name) not in _LEFT_OUT]
        return {"@": name} | {f: _encode(getattr(value, f), f"{key}.{f}".lstrip("."), arrays) for f in kept}
    if isinstance(value, tuple | list):
        items = [_encode(item, f"{key}.{i}", arrays) for i, item in enumerate(value)]
        return {"@tuple": items} if isinstance(value, tuple) else items
    if isinstance(value, Mapping) and not any(str(k).startswith("@") for k in value):
        return {str(k): _encode(v, f"{key}.{k}", arrays) for k, v in value.items()}
    raise LogError(f"{key}: a {type(value).__name__} has no place in a log")


def _decode(value: Any, arrays: Flat) -> Any:
    if isinstance(value, list):
        return [_decode(item, arrays) for item in value]
    if not isinstance(value, dict):
        return value
    if "@array" in value:
        dtype = np.dtype(value["dtype"])
        if dtype.kind not in _KINDS:
            raise ValueError(f"array of {dtype}")
        return np.array(arrays[value["@array"]]).view(dtype).reshape(value["shape"])
    if "@complex" in value:
        return complex(*value["@complex"])
    if "@tuple" in value:
        return tuple(_decode(item, arrays) for item in value["@tuple"])
    if "@run" in value:
        run = parse_run(value["@run"], value["path"]).recall(value.get("changes", {}))
        files = {str(name): _decode(content, arrays).tobytes() for name, content in value.get("files", ())}
        told = {key: str(text) for key, text in value.get("kept", {}).items()}
        return run.keeping(BundledFiles(files=files, **told)) if files else run
    parts = {k: _decode(v, arrays) for k, v in value.items() if k != "@"}
    if value.get("@") == "Tried":  # a run without a prediction, as it was called before
        return Result(controller=parts.pop("law"), prediction=None, **parts)
    return (_FORMER | _CLASSES)[value["@"]](**parts) if "@" in value else parts


def keep_files(run: RunFile) -> BundledFiles:
    """The files of a run file: as they are on disk, else as the log had them that it was read from; or none."""
    home = run.path.absolute()
    try:
        paths = [path.absolute() for path in (run.assumed_path, run.actual_path)]
        files = dict.fromkeys(path.resolve() for path in plant_files(run))
        if not files or sum(path.stat().st_size for path in files) > MOST_BYTES:
            return run.kept
        root = Path(os.path.commonpath([home.parent, *(path.parent for path in files)]))
        contents = {path.relative_to(root).as_posix(): read_bytes(path, MOST_BYTES) for path in files}
    except (OSError, ValueError, IcmjError):
        return run.kept
    named = (run.assumed.model or run.assumed.matrices, run.actual.model or run.actual.matrices)
    absolute = [
        # what does not lie beside the run file: an absolute path, or a shipped model by its name
        path.relative_to(root).as_posix() if name and (Path(name).is_absolute() or path != home.parent / name) else ""
        for name, path in zip(named, paths, strict=True)
    ]
    return BundledFiles(home.relative_to(root).as_posix(), contents, *absolute)
