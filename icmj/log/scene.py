"""Reading the 3D figures of a log back: the scene that they were written from, in single precision."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from icmj.base.array import Array
from icmj.base.text import one_line
from icmj.errors import LogError
from icmj.log.figure import ROOT
from icmj.log.sink import TIMELINE
from icmj.simulation.scene import Geom, Scene

KINDS = {"capsule": "Capsules3D", "cylinder": "Cylinders3D", "box": "Boxes3D", "ellipsoid": "Ellipsoids3D"}
KINDS["sphere"] = "Ellipsoids3D"

Columns = dict[str, Array]


def read_scene(path: Path | str) -> Scene | None:
    """The moving body of a log that was read without error before; ``None`` where it shows none.

    Floors and the world's geoms that do not move belong to it as they are drawn.

    Raises:
        LogError: if what is there is not as it is written.
    """
    from rerun.chunk import RrdReader

    found: dict[str, Columns] = {}
    try:
        for chunk in RrdReader(Path(path)).store().stream().filter(content=f"/{ROOT}/**"):
            batch = chunk.to_record_batch()
            of = found.setdefault(chunk.entity_path.removeprefix(f"/{ROOT}/"), {})
            for name, column in zip(batch.schema.names, batch.columns, strict=True):
                if name == TIMELINE:
                    of["t"] = column.cast("int64").to_numpy(zero_copy_only=False) * 1e-9
                elif not name.startswith("rerun."):
                    of[name.partition(":")[2]] = _numbers(column)
        return _scene(found) if any(name.startswith("true/") for name in found) else None
    except Exception as error:  # rerun's bindings raise what their Rust side fails with, of several types
        raise LogError(f"{path}: the moving body cannot be read ({one_line(error, 200)})") from error


def _numbers(column: Any) -> Any:
    """The values of a component: one row for each instant of each thing; words as they are."""
    from pyarrow import types

    flat, width = column.flatten(), []
    while types.is_fixed_size_list(flat.type):
        width.append(flat.type.list_size)
        flat = flat.flatten()
    return flat.to_pylist() if types.is_string(flat.type) else flat.to_numpy(zero_copy_only=False).reshape(-1, *width)


def _scene(found: dict[str, Columns]) -> Scene:
    # a body's name may have a slash
    bodies = [name.removeprefix("true/") for name, of in found.items() if name[:5] == "true/" and "quaternion" in of]
    t = max((of["t"] for of in found.values() if "t" in of), key=len, default=np.zeros(1))
    geoms: list[Geom] = []
    for index, body in enumerate(bodies):
        for kind, archetype in KINDS.items():
            if f"true/{body}/{kind}" in found:
                geoms += _geoms(kind, archetype, index, found[f"true/{body}/{kind}"])
    top = found["floor"]["centers"][0, 2] + found["floor"]["half_sizes"][0, 2]
    geoms.append(
        Geom("floor", 0, "plane", np.zeros(3), np.array([0.0, 0.0, top]), np.array([1.0, 0, 0, 0]), np.ones(4))
    )
    label = found["magnified/label"]["labels"][0]
    figures = [_poses(found, name, bodies, len(t)) for name in ("true", "magnified")]
    return Scene(t, tuple(bodies), tuple(geoms), *figures[0], *figures[1], magnification=float(label.split("×")[1]))


def _poses(found: dict[str, Columns], name: str, bodies: list[str], count: int) -> tuple[Array, Array, Array]:
    def over_time(of: Array) -> Array:
        return np.broadcast_to(of, (count, of.shape[1])).astype(float)

    at = [over_time(found[f"{name}/{body}"]["translation"]) for body in bodies]
    turned = [over_time(found[f"{name}/{body}"]["quaternion"])[:, [3, 0, 1, 2]] for body in bodies]
    com = over_time(found[f"{name}/centre_of_mass/point"]["positions"])
    return np.stack(at, axis=1), np.stack(turned, axis=1), com


def _geoms(kind: str, archetype: str, body: int, of: Columns) -> list[Geom]:
    quat = of["quaternions"][:, [3, 0, 1, 2]].astype(float)
    w, x, y, z = quat.T
    axis = np.column_stack([2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z])
    if archetype in ("Capsules3D", "Cylinders3D"):
        size = np.column_stack([of["radii"], of["lengths"] / 2, 0 * of["radii"]])
        # capsules start at z = 0, MuJoCo's are centred
        pos = of["translations"] + size[:, 1:2] * axis if kind == "capsule" else of["centers"]
    else:
        size, pos = of["half_sizes"], of["centers"]
    colours = (of["colors"].astype(np.uint32)[:, None] >> np.array([24, 16, 8, 0])) & 255
    return [
        Geom(str(name), body, kind, *(part[i].astype(float) for part in (size, pos, quat, colours / 255)))
        for i, name in enumerate(of["labels"])
    ]
