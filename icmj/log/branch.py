"""A branch of cycles in the viewer: the cycles one after another, with the moving body and the place on the branch.

The timeline runs along the branch: each cycle takes its own period, again and again for a second or so, then comes the
next. The branch itself is in the file bit for bit (:func:`read_branch_log`).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
import rerun.blueprint as rrb

from icmj.base.array import Array
from icmj.base.text import one_line
from icmj.cycle.branch import Branch, pack, unpack
from icmj.errors import IcmjError, LogError
from icmj.log import palette
from icmj.log.archive import digest
from icmj.log.blueprint import arrange, follow_cursor, show_body, show_plane
from icmj.log.figure import write_figures
from icmj.log.groups import Entity
from icmj.log.phase_plane import WIDE
from icmj.log.reader import read_static_row
from icmj.log.summary import Properties
from icmj.log.timeline import time_column
from icmj.log.writer import ARCHIVE, open_recording, open_target, write_archive, write_facts, write_group
from icmj.simulation.scene import Scene

LASTS = 1.5  # s on each cycle, at least
ENTITY = "branch_archive"


def write_branch_log(branch: Branch, path: Path | str) -> None:
    """Write a branch as a rerun recording; under its name the file is whole.

    Raises:
        LogError: if the file cannot be written.
    """
    with open_target(Path(path), "branch", ENTITY) as sink:
        _write(branch, sink)


def read_branch_log(path: Path | str) -> Branch:
    """The branch that a recording was written from, every number bit for bit.

    Raises:
        LogError: if it is not a recording of a branch.
    """
    path = Path(path)
    row = {key.removeprefix(f"{ARCHIVE}:"): values for key, values in read_static_row(path, f"/{ENTITY}").items()}
    try:
        head = row.pop("head")[0].as_py()
        flat = {name: values.to_numpy(zero_copy_only=False) for name, values in row.items()}
        return unpack(head, {name: flat.get(name, np.zeros(0)) for name in (*flat, "qpos")})
    except IcmjError as error:
        raise LogError(f"{path}: {error}") from error
    except (LookupError, TypeError, ValueError) as error:
        raise LogError(f"{path}: a rerun recording, but not of a branch ({one_line(error, 100)})") from error


def _write(branch: Branch, sink: Path) -> None:
    head, flat = pack(branch)
    scene, t, laid = _lay_out(branch)
    at = laid["cycle"].astype(int)
    title = f"{branch.run.title}: along {branch.parameter} ({branch.plant})"
    with open_recording(sink, digest(head, flat), title, _blueprint(branch, scene)) as recording:
        facts: Properties = {
            "case": {"name": branch.run.case.name, "title": title},
            "outcome": {"kind": "completed", "time": float(t[-1])},
        }
        write_facts(recording, facts, _markdown(branch, title))
        known = {key: values for key, values in flat.items() if values.size}
        write_archive(recording, ENTITY, {"head": pa.array([head])}, known)
        multipliers = np.column_stack([branch.largest[at], 1 + 0 * at])
        for path, values, names in (
            ("outputs", laid["y"], branch.outputs),
            ("inputs", laid["u"], branch.inputs),
            ("along/parameter", branch.value[at, None], (branch.parameter,)),
            ("along/interval", branch.intervals[at], ("Δ_ol",) * branch.intervals.shape[1]),
            ("along/multiplier", multipliers, ("largest |μ|", "1")),
        ):
            write_group(recording, Entity(path, t, values, names, palette.choose_colours(len(names))))
        _diagram(recording, branch, t, at)
        if scene is not None:
            write_figures(recording, scene)


def _lay_out(branch: Branch) -> tuple[Scene | None, Array, dict[str, Array]]:
    """All cycles one after another: the moving body, times [s], and signals by name."""
    times, parts, start = [], {name: [] for name in ("x", "y", "u", "cycle")}, 0.0  # type: ignore[var-annotated]
    position = []
    plant, moved = _body(branch)
    for i, period in enumerate(branch.period):
        own = branch.t[i]
        halves = [(own, 1)] + ([(own + period / 2, -1)] if branch.mirrored else [])
        for turn in range(min(max(int(np.ceil(LASTS / period)), 1), 40)):
            for begin, sign in halves:
                times.append(start + turn * period + begin)
                for name in ("x", "y", "u"):
                    parts[name].append(sign * getattr(branch, name)[i])
                parts["cycle"].append(np.full(len(own), float(i)))
                position.append(sign * moved[i] if moved is not None else own[:, None])
        start = float(times[-1][-1]) + 1e-6
    t = np.concatenate(times)
    # two rows at one instant, as at an event, may swap on a timeline of nanoseconds
    t = np.maximum.accumulate(t + 1e-9 * np.arange(len(t)))
    scene = None
    if plant is not None:
        from icmj.engine.pose import pose_departures

        scene = pose_departures(plant, t, np.concatenate(position), branch.run.study.magnification)
    return scene, t, {name: np.concatenate(values) for name, values in parts.items()}


def _body(branch: Branch) -> tuple[Any, Array | None]:
    """The actual plant on the engine and how its positions depart on each cycle, (M, K, nv); ``None`` by matrices."""
    from icmj.case.plants import actual_plant, assumed_plant
    from icmj.engine.plant import MujocoPlant
    from icmj.engine.pose import measure_departures

    plant = actual_plant(branch.run, assumed_plant(branch.run))
    if not isinstance(plant, MujocoPlant):
        return None, None
    if branch.qpos.shape[-1]:
        return plant, np.array([measure_departures(plant, qpos) for qpos in branch.qpos])
    return plant, plant.linearisation.ports.whole(branch.x)[..., : plant.model.nv]


def _diagram(recording: rr.RecordingStream, branch: Branch, t: Array, at: np.ndarray) -> None:
    """Intervals against the parameter in a frame, with the place of the cycle that is shown."""
    value = np.log(branch.value) if branch.value.min() > 0 and np.ptp(np.log(branch.value)) > 2.3 else branch.value
    top = min(float(branch.intervals.max()), 4 * float(np.median(branch.intervals)))
    middle, half = (value.max() + value.min()) / 2, np.ptp(value) / 2 or 1.0

    def place_points(x: Array, y: Array) -> Array:
        return np.column_stack([WIDE * (x - middle) / half, 1 - 2 * np.minimum(y, 1.05 * top) / top])

    frame = [[-WIDE, -1.0], [-WIDE, 1.0], [WIDE, 1.0]]
    recording.log("diagram/frame", rr.LineStrips2D([frame], colors=[palette.GREY], radii=[-0.75]), static=True)
    ends = [f"{branch.parameter} = {branch.value[np.argmin(value)]:.4g}", f"{branch.value[np.argmax(value)]:.4g}"]
    labels = rr.Points2D(
        [[-WIDE, 1.12], [WIDE, 1.12], [-WIDE, -1.1]], labels=[*ends, f"Δ_ol = {top:.3g} s"], radii=[0.0] * 3,
        colors=[palette.GREY] * 3, show_labels=True,
    )  # fmt: skip
    recording.log("diagram/labels", labels, static=True)
    strips, colours = [], []
    for j in range(branch.intervals.shape[1]):
        points = place_points(value, branch.intervals[:, j])
        for i in range(len(branch) - 1):
            strips.append(points[i : i + 2])
            colours.append(palette.SKY if branch.attracting[i] and branch.attracting[i + 1] else palette.VERMILION)
    recording.log("diagram/branch", rr.LineStrips2D(strips, colors=colours, radii=[-1.2]), static=True)
    here = place_points(value[at], branch.intervals[at].mean(axis=1))
    recording.log("diagram/here", rr.Points2D.from_fields(colors=[palette.YELLOW], radii=[0.05]), static=True)
    recording.send_columns("diagram/here", [time_column(t)], rr.Points2D.columns(positions=here))


def _blueprint(branch: Branch, scene: Scene | None) -> rrb.Blueprint:
    def plot(name: str, origin: str) -> rrb.TimeSeriesView:
        return rrb.TimeSeriesView(name=name, origin=origin)

    def near(name: str, origin: str) -> rrb.TimeSeriesView:
        return rrb.TimeSeriesView(name=name, origin=origin, axis_x=follow_cursor(2 * LASTS, 2 * LASTS))

    figures: list[Any] = [show_body(scene)] if scene is not None else []
    diagram = show_plane(f"Intervals along {branch.parameter}: blue attracting, red repelling", "diagram", -1.3)
    return arrange(
        rrb.Vertical(*figures, diagram),
        rrb.Vertical(near("Outputs", "outputs"), near("Inputs", "inputs"), plot("Intervals [s]", "along/interval")),
        rrb.Vertical(
            rrb.TextDocumentView(origin="summary", name="Summary"),
            plot("Parameter", "along/parameter"),
            plot("Largest multiplier", "along/multiplier"),
        ),
    )


def _markdown(branch: Branch, title: str) -> str:
    lines = [
        f"# {title}",
        *([branch.run.changes_in_words, ""] if branch.run.changes else ()),
        f"{len(branch)} {branch.name}, {branch.parameter} from {branch.value[0]:.6g} to {branch.value[-1]:.6g}, "
        f"{int(branch.attracting.sum())} of them attracting.",
        "",
        "## On the way",
        *(f"- {special.words}" for special in branch.specials),
        "",
        f"End: {branch.end}",
    ]
    return "\n".join(lines) + "\n"
