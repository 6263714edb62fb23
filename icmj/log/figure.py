"""The 3D figures of a log, written and read back: the body as it sways at the left, magnified at the right.

Each geom is written once, then whole columns of body poses. What is read back is the scene that they were written from,
in single precision.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from icmj.base.array import Array
from icmj.base.text import one_line
from icmj.errors import LogError
from icmj.log.palette import PURPLE, VERMILION, WHITE, YELLOW
from icmj.log.timeline import TIMELINE, time_column
from icmj.simulation.scene import Geom, Scene, select_frames

ROOT = "scene"
FLOOR_COLOUR = (150, 156, 164, 255)


def write_figures(recording: rr.RecordingStream, scene: Scene) -> None:
    """Write both figures with centre of mass and its path."""
    shown = select_frames(scene.t)
    time = time_column(scene.t[shown])
    apart = 0.36 * measure_height(scene)
    recording.log(ROOT, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    _write_floor(recording, scene, apart)
    for name, label, x, prefix in (
        ("true", "true sway", -apart, ""),
        ("magnified", f"sway × {scene.magnification:g}", apart, "magnified_"),
    ):
        xpos, xquat, com, target = (getattr(scene, f"{prefix}{of}") for of in ("xpos", "xquat", "com", "target"))
        root = f"{ROOT}/{name}"
        recording.log(root, rr.Transform3D(translation=[x, 0.0, 0.0]), static=True)
        _write_bodies(recording, root, scene, xpos[shown], xquat[shown], time)
        _write_com(recording, root, x, scene, com[shown], time)
        if target is not None:
            _write_target(recording, f"{root}/centre_of_mass/target", target[shown], time)
        recording.log(
            f"{root}/label",
            rr.Points3D(
                [[0, 0, _top(scene) + 0.04 * measure_height(scene)]],
                labels=[label],
                colors=[WHITE],
                radii=[0.0],
                show_labels=True,
            ),
            static=True,
        )


def _write_bodies(
    recording: rr.RecordingStream, root: str, scene: Scene, xpos: Array, xquat: Array, time: rr.TimeColumn
) -> None:
    for index, body in enumerate(scene.bodies):
        geoms = [geom for geom in scene.geoms if geom.body == index and geom.type != "plane"]
        if not geoms:
            continue
        path = f"{root}/{body}"
        at, turned = xpos[:, index], xquat[:, index][:, [1, 2, 3, 0]]
        if (at == at[0]).all() and (turned == turned[0]).all():
            pose = rr.Transform3D(translation=at[0], quaternion=rr.Quaternion(xyzw=turned[0]))
            recording.log(path, pose, static=True)
        else:
            recording.send_columns(path, [time], rr.Transform3D.columns(translation=at, quaternion=turned))
        for kind in sorted({geom.type for geom in geoms}):
            recording.log(f"{path}/{kind}", _shapes(kind, [g for g in geoms if g.type == kind]), static=True)


def _shapes(kind: str, geoms: list[Geom]) -> Any:
    """All geoms of one kind on one body, as one archetype. MuJoCo's capsules are centred, rerun's start at z = 0."""
    size, pos = np.array([g.size for g in geoms]), np.array([g.pos for g in geoms])
    quat = np.array([g.quat for g in geoms])
    common: dict[str, Any] = {
        "quaternions": quat[:, [1, 2, 3, 0]],
        "colors": np.array([g.rgba for g in geoms]),
        "labels": [g.name for g in geoms],
        "show_labels": False,
        "fill_mode": rr.components.FillMode.Solid,
    }
    if kind == "capsule":
        start = pos - size[:, 1:2] * _z_axis(quat)
        return rr.Capsules3D(lengths=2 * size[:, 1], radii=size[:, 0], translations=start, **common)
    if kind == "cylinder":
        return rr.Cylinders3D(lengths=2 * size[:, 1], radii=size[:, 0], centers=pos, **common)
    if kind == "box":
        return rr.Boxes3D(half_sizes=size, centers=pos, **common)
    half = size if kind == "ellipsoid" else np.repeat(size[:, :1], 3, axis=1)
    return rr.Ellipsoids3D(half_sizes=half, centers=pos, **common)


def _z_axis(quat: Array) -> Array:
    """The direction to which each quaternion (wxyz) turns the z axis, shape (M, 3)."""
    w, x, y, z = quat.T
    return np.column_stack([2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z])


def _write_com(
    recording: rr.RecordingStream, root: str, x: float, scene: Scene, com: Array, time: rr.TimeColumn
) -> None:
    """The centre of mass and its path, with the vertical of the operating point, of the figure that stands at ``x``.

    All three are inside the body. They are drawn between it and the eye, shrunk about the eye: from where the replay
    opens they cover exactly the places where they are.
    """
    root = f"{root}/centre_of_mass"
    seen_from = place_eye(scene)[0] - [x, 0.0, 0.0]
    nearer = (_half_width(scene) + 0.06) / abs(float(seen_from[1]))
    towards = rr.Transform3D(translation=nearer * seen_from, scale=1 - nearer)
    recording.log(root, towards, static=True)
    point = rr.Points3D.from_fields(colors=[YELLOW], radii=[0.028])
    recording.log(f"{root}/point", point, static=True)
    recording.send_columns(f"{root}/point", [time], rr.Points3D.columns(positions=com))
    recording.log(f"{root}/path", rr.LineStrips3D([com], colors=[VERMILION], radii=[-2.0]), static=True)
    plumb = [[[0, 0, _floor(scene)], [0, 0, _top(scene)]]]
    recording.log(f"{root}/vertical", rr.LineStrips3D(plumb, colors=[WHITE], radii=[-0.75]), static=True)


def _write_target(recording: rr.RecordingStream, path: str, target: Array, time: rr.TimeColumn) -> None:
    """The posture that the set-point asks for, as lines, which are drawn as near to the eye as the centre of mass."""
    recording.log(path, rr.LineStrips3D.from_fields(colors=[PURPLE], radii=[-2.5]), static=True)
    strips = rr.LineStrips3D.columns(strips=list(target.reshape(-1, 2, 3))).partition([target.shape[1]] * len(target))
    recording.send_columns(path, [time], strips)


def _half_width(scene: Scene) -> float:
    """The sideways extent (y) of the body at the start."""
    reach = [abs(scene.xpos[0, g.body, 1] + g.pos[1]) + float(g.size.min()) for g in scene.geoms if g.type != "plane"]
    return max(reach, default=0.0)


def _write_floor(recording: rr.RecordingStream, scene: Scene, apart: float) -> None:
    z, reach = _floor(scene), 1.7 * apart
    recording.log(
        f"{ROOT}/floor",
        rr.Boxes3D(
            half_sizes=[[reach, 0.9 * apart, 0.01]],
            centers=[[0, 0, z - 0.01]],
            colors=[FLOOR_COLOUR],
            fill_mode=rr.components.FillMode.Solid,
        ),
        static=True,
    )


def measure_height(scene: Scene) -> float:
    """The height from the floor to slightly above the highest geom [m]; 1 without visible geoms."""
    tall = _top(scene) - _floor(scene)
    return tall if tall > 1e-6 else 1.0


def place_eye(scene: Scene) -> tuple[Array, Array]:
    """The positions of the eye and of the point it looks at, so that both figures fill the view [m]."""
    z, h = _floor(scene), measure_height(scene)
    return np.array([0.12 * h, -1.42 * h, z + 0.66 * h]), np.array([0.0, 0.0, z + 0.49 * h])


def _floor(scene: Scene) -> float:
    """Height of the floor: the model's plane, or the lowest body."""
    planes = [geom.pos[2] for geom in scene.geoms if geom.type == "plane"]
    return float(planes[0]) if planes else float(scene.xpos[0, :, 2].min())


def _top(scene: Scene) -> float:
    """A little above the highest geom at the start."""
    reach = [
        scene.xpos[0, g.body, 2] + float(np.linalg.norm(g.pos)) + float(g.size.max())
        for g in scene.geoms
        if g.type != "plane"
    ]
    return 1.04 * max(reach, default=float(scene.xpos[0, :, 2].max()))


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
    if archetype in ("Capsules3D", "Cylinders3D"):
        size = np.column_stack([of["radii"], of["lengths"] / 2, 0 * of["radii"]])
        # capsules start at z = 0, MuJoCo's are centred
        pos = of["translations"] + size[:, 1:2] * _z_axis(quat) if kind == "capsule" else of["centers"]
    else:
        size, pos = of["half_sizes"], of["centers"]
    colours = (of["colors"].astype(np.uint32)[:, None] >> np.array([24, 16, 8, 0])) & 255
    return [
        Geom(str(name), body, kind, *(part[i].astype(float) for part in (size, pos, quat, colours / 255)))
        for i, name in enumerate(of["labels"])
    ]
