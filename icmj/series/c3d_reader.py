"""A program: ``c3d_reader.py FILE.c3d FOUND.npz`` reads one file with ezc3d and writes its signals as arrays.

It imports nothing of this package. A damaged file may ask for all memory there is, which whoever starts it bounds.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

REFUSED = 3  # exit status with a reason on standard error
LEAST_LOAD = 20.0
"""Vertical force below which a plate has no centre of pressure [N], the default of C-Motion's force-platform plugin."""
_LENGTHS, _FORCES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}, {"N": 1.0, "kN": 1e3}
_MOMENTS = {f"{force}{length}": a * b for force, a in _FORCES.items() for length, b in _LENGTHS.items()}
_AXES = "xyz"
_OFF, _BESIDE = 0.1, 0.05
"""Share of a plate's diagonal that its opposite corners' middles may be apart, and that a centre may lie beside it."""


def read(path: str, folder: str) -> dict[str, Any]:
    """Arrays by the number of the group and what they are; see :class:`icmj.series.formats.c3d.Group`.

    ``frames`` is the number of frames that were read; ``ends`` are the first and the last one as the group TRIAL has
    them, in two words each; ``fault`` says why there is no centre of pressure though there are plates, or is empty;
    ``odd`` says what is odd about centres that there are.

    Args:
        path: of the file.
        folder: for a copy of the file, should one be needed.
    """
    import ezc3d

    fault, plates = "", []
    try:
        file = ezc3d.c3d(path, extract_forceplat_data=True)
        plates = _plates(file, Path(folder, "scaled.c3d"))
    except MemoryError:
        raise
    except Exception as error:  # plates that are described wrongly leave points and channels as they are
        file, fault = ezc3d.c3d(path), " ".join(str(error).split())
    parameters, data, header = file["parameters"], file["data"], file["header"]
    used = parameters.get("FORCE_PLATFORM", {}).get("USED", {}).get("value", [])
    if len(used) and used[0] != len(plates) and not fault:
        fault = f"{int(used[0])} plates are in use, of which {len(plates)} are described"
    if crossed := [number for number, plate in enumerate(plates, 1) if _is_crossed(plate["corners"])]:
        fault, plates = f"the corners of plate {crossed[0]} are not in their order around it", []
    start = float(header["points"]["first_frame"]) / float(header["points"]["frame_rate"] or 1)
    analog_rate = float(header["analogs"]["frame_rate"])
    trial = parameters.get("TRIAL", {})
    ends = [int(word) for end in ("START", "END") for word in trial.get(f"ACTUAL_{end}_FIELD", {}).get("value", [])]
    found: dict[str, Any] = {"frames": np.array([file.c3d_swig.data().nbFrames()]), "ends": np.array(ends, int)}
    found["fault"] = np.array(fault)

    def keep(group: int, names: list[str], units: list[str], rate: float, values: Any) -> None:
        if len(names) and values.size and rate > 0:
            found.update(
                {f"{group} names": np.array(names, str), f"{group} units": np.array(units, str)}
                | {f"{group} rate": rate, f"{group} start": start, f"{group} values": values}
            )

    unit = next(iter(parameters["POINT"].get("UNITS", {}).get("value", [])), "")
    if plates:
        axes = _plane(plates[0]["corners"])
        # whatever the library calls it, the force is in the unit of its channel
        known, third = _channel_units(parameters), np.asarray(parameters["FORCE_PLATFORM"]["CHANNEL"]["value"])[2]
        forces = [known[channel] if 0 <= channel < len(known) else "" for channel in third.astype(int).ravel() - 1]
        loads = np.array([np.abs(plate["force"][axes[2]]) for plate in plates])
        loads *= np.array([_FORCES.get(unit, 1.0) for unit in forces[: len(plates)]])[:, None]
        loads[~(loads >= LEAST_LOAD)] = 0.0
        centres = np.array([plate["center_of_pressure"][axes[:2]] for plate in plates])
        centres[np.broadcast_to(loads[:, None] == 0, centres.shape)] = np.nan
        beside = [
            _beside(i, c, plate["corners"][axes[:2]])
            for i, (c, plate) in enumerate(zip(centres, plates, strict=True), 1)
        ]
        found["odd"] = np.array("; ".join(filter(None, beside)))
        names = [f"plate{number}.cop.{_AXES[axis]}" for number in range(1, len(plates) + 1) for axis in axes[:2]]
        keep(0 if len(plates) == 1 else 4, names, [unit] * len(names), analog_rate, np.concatenate(centres).T)
        if len(plates) > 1:  # where the ground's force on both feet acts
            with np.errstate(invalid="ignore"):
                whole = (loads[:, None] * np.nan_to_num(centres)).sum(axis=0) / loads.sum(axis=0)
            keep(0, [f"cop.{_AXES[axis]}" for axis in axes[:2]], [unit] * 2, analog_rate, whole.T)
        names = [f"plate{number}.force.{axis}" for number in range(1, len(plates) + 1) for axis in _AXES]
        stated = [
            unit if unit in _FORCES else str(plate["unit_force"]) for unit, plate in zip(forces, plates, strict=False)
        ]
        units = [unit for unit in stated for _ in _AXES]
        keep(1, names, units, analog_rate, np.vstack([plate["force"] for plate in plates]).T)
    labels = _labels(parameters["POINT"])[: data["points"].shape[1]]
    values = data["points"][:3, : len(labels)].transpose(2, 1, 0).reshape(data["points"].shape[2], -1)
    keep(
        2,
        [f"{label}.{axis}" for label in labels for axis in "xyz"],
        [unit] * values.shape[1],
        float(header["points"]["frame_rate"]),
        values,
    )
    labels = _labels(parameters["ANALOG"])[: data["analogs"].shape[1]]
    units = [*parameters["ANALOG"].get("UNITS", {}).get("value", []), *[""] * len(labels)][: len(labels)]
    keep(3, labels, units, analog_rate, data["analogs"][0, : len(labels)].T)
    return found


def _plates(file: Any, copy: Path) -> list[Any]:
    """The plates; with moments in the unit of force times that of the points, which the library takes for granted.

    Args:
        file: with its plates.
        copy: to write where a moment is in another unit.
    """
    import ezc3d

    parameters, found = file["parameters"], list(file["data"].get("platform") or [])
    if not found:
        return []
    units = _channel_units(parameters)
    point = next(iter(parameters["POINT"].get("UNITS", {}).get("value", [])), "")
    given = file["data"]["analogs"].copy()
    for i, kind in enumerate(parameters["FORCE_PLATFORM"]["TYPE"]["value"][: len(found)]):
        channels = np.asarray(parameters["FORCE_PLATFORM"]["CHANNEL"]["value"])[:6, i].astype(int) - 1
        if kind != 2 or len(channels) < 6 or channels.max() >= len(units):  # others have no moments, or none in a unit
            continue
        force = _FORCES.get(units[channels[2]], math.nan)
        for channel in channels[3:]:
            factor = _MOMENTS.get(units[channel], math.nan) / (force * _LENGTHS.get(point, math.nan))
            if math.isfinite(factor) and abs(factor - 1) > 1e-9:
                file["data"]["analogs"][0, channel] *= factor
    if np.array_equal(given, file["data"]["analogs"], equal_nan=True):
        return found
    file.write(str(copy))
    file["data"]["analogs"] = given  # the channels stay in the units that they state
    return list(ezc3d.c3d(str(copy), extract_forceplat_data=True)["data"]["platform"])


def _channel_units(parameters: Any) -> list[str]:
    """Units of the analog channels as the file states them, without blanks and signs of multiplication."""
    stated = parameters["ANALOG"].get("UNITS", {}).get("value", [])
    return [str(unit).translate(str.maketrans("", "", " .*·")) for unit in stated]


def _is_crossed(corners: Any) -> bool:
    """Whether the corners of a plate, on which its axes depend, are not in their order around it."""
    apart = np.linalg.norm(corners[:, 0] + corners[:, 2] - corners[:, 1] - corners[:, 3])
    return bool(apart > 2 * _OFF * np.linalg.norm(corners[:, 0] - corners[:, 2]))


def _beside(number: int, centre: Any, corners: Any) -> str:
    """In how many rows the centre of pressure is beside its plate, in words; or nothing."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    room = _BESIDE * np.linalg.norm(high - low)
    out = ((centre < (low - room)[:, None]) | (centre > (high + room)[:, None])).any(axis=0)
    if not out.any():
        return ""
    return (
        f"plate {number}: the centre of pressure is beside it in {out.sum()} of {len(out)} rows; are units, origin and "
        "corners right?"
    )


def _plane(corners: Any) -> list[int]:
    """The two axes nearest to the plane of a plate, in their order, and then that nearest to its normal."""
    normal = np.cross(corners[:3, 1] - corners[:3, 0], corners[:3, 2] - corners[:3, 0])
    upright = int(np.argmax(np.abs(normal)))
    return [*(axis for axis in range(3) if axis != upright), upright]


def _labels(group: Any) -> list[str]:
    """Names of a group, also those in the parameters LABELS2, LABELS3, … of more than 255."""
    more = [key for key in group if key.startswith("LABELS") and key[6:].isdigit()]
    keys = ["LABELS", *sorted(more, key=lambda key: int(key[6:]))]
    return [str(label).strip() for key in keys for label in group.get(key, {}).get("value", [])]


if __name__ == "__main__":
    try:
        np.savez(sys.argv[2], **read(sys.argv[1], str(Path(sys.argv[2]).parent)))
    except Exception as error:
        full = isinstance(error, MemoryError) or "bad_alloc" in str(error)
        words = "it takes too much memory to read it" if full else f"{type(error).__name__}: {error}"
        sys.stderr.write(f"{words}\n")
        sys.exit(REFUSED)
