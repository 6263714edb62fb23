"""A program: ``c3d_reader.py FILE.c3d FOUND.npz`` reads one file with ezc3d and writes its signals as arrays.

It imports nothing of this package. A damaged file may ask for all memory there is, which whoever starts it bounds.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

REFUSED = 3  # exit status with a reason on standard error


def read(path: str) -> dict[str, Any]:
    """Arrays by the number of the group and what they are; see :class:`icmj.series.formats.Group`.

    ``frames`` is the number of frames that were read; ``ends`` are the first and the last one as the group TRIAL has
    them, in two words each.
    """
    import ezc3d

    try:
        file = ezc3d.c3d(path, extract_forceplat_data=True)
    except MemoryError:
        raise
    except Exception:  # plates that are described wrongly leave points and channels as they are
        file = ezc3d.c3d(path)
    parameters, data, header = file["parameters"], file["data"], file["header"]
    start = float(header["points"]["first_frame"]) / float(header["points"]["frame_rate"] or 1)
    analog_rate = float(header["analogs"]["frame_rate"])
    trial = parameters.get("TRIAL", {})
    ends = [int(word) for end in ("START", "END") for word in trial.get(f"ACTUAL_{end}_FIELD", {}).get("value", [])]
    found: dict[str, Any] = {"frames": np.array([file.c3d_swig.data().nbFrames()]), "ends": np.array(ends, int)}

    def keep(group: int, names: list[str], units: list[str], rate: float, values: Any) -> None:
        if len(names) and values.size and rate > 0:
            found.update(
                {f"{group} names": np.array(names, str), f"{group} units": np.array(units, str)}
                | {f"{group} rate": rate, f"{group} start": start, f"{group} values": values}
            )

    plates = list(enumerate(data.get("platform") or [], 1))
    if plates:
        names = [f"plate{number}.cop.{axis}" for number, _ in plates for axis in "xy"]
        units = [str(plate["unit_position"]) for _, plate in plates for _ in "xy"]
        keep(0, names, units, analog_rate, np.vstack([plate["center_of_pressure"][:2] for _, plate in plates]).T)
        names = [f"plate{number}.force.{axis}" for number, _ in plates for axis in "xyz"]
        units = [str(plate["unit_force"]) for _, plate in plates for _ in "xyz"]
        keep(1, names, units, analog_rate, np.vstack([plate["force"] for _, plate in plates]).T)
    labels = _labels(parameters["POINT"])[: data["points"].shape[1]]
    values = data["points"][:3, : len(labels)].transpose(2, 1, 0).reshape(data["points"].shape[2], -1)
    unit = next(iter(parameters["POINT"].get("UNITS", {}).get("value", [])), "")
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


def _labels(group: Any) -> list[str]:
    """Names of a group, also those in the parameters LABELS2, LABELS3, … of more than 255."""
    more = [key for key in group if key.startswith("LABELS") and key[6:].isdigit()]
    keys = ["LABELS", *sorted(more, key=lambda key: int(key[6:]))]
    return [str(label).strip() for key in keys for label in group.get(key, {}).get("value", [])]


if __name__ == "__main__":
    try:
        np.savez(sys.argv[2], **read(sys.argv[1]))
    except Exception as error:
        full = isinstance(error, MemoryError) or "bad_alloc" in str(error)
        words = "it takes too much memory to read it" if full else f"{type(error).__name__}: {error}"
        sys.stderr.write(f"{words}\n")
        sys.exit(REFUSED)
