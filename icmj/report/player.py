"""A run as the page's script plays it: shapes of the body as seen from its right, poses and outputs over time.

Numbers go in columns of whole steps between their least and their largest value, as letters; a column that does not
change is one number. A frame of a standing person takes some 40 bytes of the page.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import fields, replace
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.base.text import one_line
from icmj.case.motion import output_rate
from icmj.case.quantity import quantities
from icmj.case.result import Result
from icmj.report.style import NAME
from icmj.simulation.scene import Geom, Scene, select_frames

if TYPE_CHECKING:
    from icmj.engine.planar_chain import Chain


MOST = 4000  # frames, the last of a run: 80 s of 50 Hz
KEPT = 1600  # of them, at equal distances, between which the page interpolates
LONGEST = 30.0  # s: a longer cycle is not what is played first
LARGEST = 1e6  # of a number that is drawn
STEPS = 2**16 - 1  # of times, outputs and rates, which are read, and zoomed into
STEPS_OF_POSES = 2**12 - 1  # which are drawn some 300 pixels high
LETTERS = np.frombuffer(b"0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz-_", np.uint8)


def script(motions: Mapping[str, dict[str, Any]]) -> Markup:
    """The motions as JSON for a script element, escaped so that no text in it can end the element."""
    text = json.dumps(motions, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for sign in "<>&\u2028\u2029":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return Markup(text)


def join_scripts(*names: str) -> Markup:
    """Modules of ``templates/`` as one, each after those that it imports."""
    here = files("icmj.report") / "templates"
    text = "\n".join((here / name).read_text(encoding="utf-8") for name in names)
    return Markup(re.sub(r"^import .*\n|^export (?=\w)", "", text, flags=re.M))


def moving(run: Result) -> dict[str, Any] | None:
    """The motion of a run for the script; ``None`` of one without two frames of finite numbers.

    Its columns are ``t``, ``y`` and ``v`` (outputs and their rates, as people read them), and of a body, true and
    magnified, for every part the position and the quaternion x, z, q_w, q_x, q_y, q_z, and its centre of mass x, z.
    """
    simulation = run.simulation
    scene = run.scene if run.scene is not None and run.scene.geoms else None
    rows = select_frames(simulation.t) if scene is None else np.searchsorted(simulation.t, scene.t - 1e-8)
    rows = np.minimum(rows, len(simulation.t) - 1)[-MOST:]
    shown = quantities(run.actual)
    scale = np.array([quantity.factor for quantity in shown])
    with np.errstate(over="ignore", invalid="ignore"):
        y, v = simulation.y[rows] * scale, output_rate(run, simulation.x[rows], simulation.u[rows]) * scale
    parts = [y, v] if scene is None else [y, v, *_poses(scene)]
    table = np.column_stack([simulation.t[rows], *(part[-MOST:] for part in parts)])
    drawn = np.isfinite(table).all(axis=1) & (np.abs(table) < LARGEST).all(axis=1)
    table = table[: len(drawn) if drawn.all() else int(np.argmin(drawn))]
    if len(table) < 2 or not run.actual.n_y:
        return None
    every = -(-len(table) // KEPT)
    table = table[(len(table) - 1) % every :: every]  # with the last
    events = simulation.events.t[simulation.events.t >= table[0, 0]]
    read = 1 + y.shape[1] + v.shape[1]
    return {
        "title": f"{one_line(run.run.title)}, {NAME[simulation.plant]}",
        "outputs": [
            [one_line(name, 100), unit.unit.replace("deg", "°")]
            for name, unit in zip(run.actual.outputs, shown, strict=True)
        ],
        "events": [round(float(t), 4) for t in events],
        "cycle": _cycle(run),
        "columns": [_column(values, STEPS if i < read else STEPS_OF_POSES) for i, values in enumerate(table.T)],
        "body": None if scene is None else body_of(scene),
    }


def _cycle(run: Result) -> float | None:
    """Period [s] of what the run settled on, if it did."""
    measured = run.measurement
    if measured is None or measured.kind != "cycle" or not measured.period or measured.period > LONGEST:
        return None
    return round(float(measured.period), 6)


def _column(values: Array, steps: int) -> list[Any]:
    """The least value, the size of a step, and second differences of the steps: of a smooth motion they are small."""
    low, high = float(values.min()), float(values.max())
    step = (high - low) / steps
    if step < 1e-12:
        return [round(low, 9)]
    whole = np.rint((values - low) / step).astype(np.int64)
    return [float(f"{low:.9g}"), float(f"{step:.9g}"), _write_letters(np.diff(whole, n=2, prepend=[0, 0]))]


def _write_letters(whole: NDArray[np.int64]) -> str:
    """Whole numbers below 2^19: five bits a letter, lowest first, 32 where more follow; the lowest bit is the sign."""
    bits = np.where(whole < 0, ~whole, whole) << 1 | (whole < 0)
    left = bits[:, None] >> 5 * np.arange(4)
    kept, more = left > 0, left >> 5 > 0
    kept[:, 0] = True
    return LETTERS[(left & 31) + 32 * more][kept].tobytes().decode()


def _poses(scene: Scene) -> list[Array]:
    found = []
    for prefix in ("", "magnified_"):
        xpos, xquat, com = (getattr(scene, f"{prefix}{of}") for of in ("xpos", "xquat", "com"))
        for body in range(len(scene.bodies)):
            found += [xpos[:, body, ::2], xquat[:, body]]
        found.append(com[:, ::2])
    return found


def body_of(scene: Scene) -> dict[str, Any]:
    """The constant part of a motion: shapes (farthest first), floor, top and middle."""
    geoms = [geom for geom in scene.geoms if geom.type != "plane"]
    geoms.sort(key=lambda geom: -float(scene.xpos[0, geom.body, 1] + geom.pos[1]))
    reach = [scene.xpos[0, geom.body, 2] + geom.pos[2] + float(geom.size.max()) for geom in geoms]
    planes = [float(geom.pos[2]) for geom in scene.geoms if geom.type == "plane"]
    floor = planes[0] if planes else float(scene.xpos[0, :, 2].min())
    height = max(reach, default=0.0) - floor
    return {
        "parts": len(scene.bodies),
        "floor": round(floor, 4),
        "height": round(height, 4) if height > 1e-6 else 1.0,
        "middle": round(float(np.median(scene.com[:, 0])), 4),
        "magnification": scene.magnification,
        "shapes": [
            {"part": geom.body, "colour": np.rint(255 * geom.rgba[:3]).astype(int).tolist(), **_outline(geom)}
            for geom in geoms
        ],
    }


def _outline(geom: Geom) -> dict[str, Any]:
    """What is drawn of a shape, in its part's own frame.

    An ellipsoid has a ``centre`` and three half ``axes``. Any other shape is what a ball of a ``radius`` sweeps over
    the convex hull of ``points``.
    """
    a, b, c = geom.size
    ring = np.array([[np.cos(angle), np.sin(angle)] for angle in np.linspace(0, 2 * np.pi, 24, endpoint=False)])
    none, radius = np.zeros(len(ring)), 0.0
    if geom.type == "sphere":
        points, radius = np.zeros((1, 3)), a
    elif geom.type == "capsule":
        points, radius = np.array([[0, 0, -b], [0, 0, b]]), a
    elif geom.type == "cylinder":
        points = np.vstack([np.column_stack([a * ring, none + end]) for end in (-b, b)])
    elif geom.type == "box":
        points = np.array([[x, y, z] for x in (-a, a) for y in (-b, b) for z in (-c, c)])
    else:
        points = np.diag(geom.size)
    turned = turn(geom.quat, points)
    if geom.type == "ellipsoid":
        return {"centre": np.round(geom.pos, 4).tolist(), "axes": np.round(turned, 4).tolist()}
    return {"radius": round(float(radius), 4), "points": np.round(turned + geom.pos, 4).tolist()}


def turn(quat: Array, points: Array) -> Array:
    """Points turned by a unit quaternion (wxyz), shape (N, 3)."""
    q, r = quat[0], quat[1:]
    return np.asarray(points + 2 * np.cross(r, np.cross(r, points) + q * points))


def links_of(chain: Chain) -> dict[str, Any]:
    """The numbers of a chain, as the loop of the live page reads them."""
    names = [field.name for field in fields(chain) if field.name not in ("rates", "link", "scene")]
    return {name: getattr(chain, name).tolist() for name in names} | {"lags": chain.rates.tolist()}


def chain_body(chain: Chain, positions: list[int], magnification: float) -> dict[str, Any]:
    """The shapes by link, each from the link's joint at the operating point; part 0 is what does not move.

    ``positions`` are the plant's states of the links, −1 for one that is no state.
    """
    scene, place = chain.scene, np.zeros((1 + len(chain.parent), 3))
    for i, parent in enumerate(chain.parent):
        place[1 + i, ::2] = place[1 + parent, ::2] + chain.joint[i]
    geoms = []
    for geom in scene.geoms:
        turned, part = scene.xquat[0, geom.body], 1 + int(chain.link[geom.body])
        pos = turn(turned, geom.pos[None])[0] + scene.xpos[0, geom.body] - place[part]
        q, r, v, w = turned[0], turned[1:], geom.quat[0], geom.quat[1:]
        quat = np.concatenate([[q * v - r @ w], q * w + v * r + np.cross(r, w)])
        geoms.append(replace(geom, body=part, pos=pos, quat=quat))
    still = np.tile([1.0, 0.0, 0.0, 0.0], (1, len(place), 1))
    parts = Scene(scene.t, ("",) * len(place), tuple(geoms), *(place[None], still, scene.com) * 2, magnification)
    return body_of(parts) | {"chain": links_of(chain), "positions": positions}
