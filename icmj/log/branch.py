"""A branch of cycles in the viewer: the cycles one after another, with the moving body and the place on the branch.

The timeline runs along the branch: each cycle takes its own period, again and again for a second or so, then comes the
next. The branch itself is in the file bit for bit (:func:`read_branch_log`).
"""

from __future__ import annotations

import hashlib
import uuid
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
import rerun.blueprint as rrb

from icmj.base.array import Array
from icmj.base.files import whole
from icmj.base.text import one_line
from icmj.cycle.branch import Branch, pack, unpack
from icmj.errors import IcmjError, LogError
from icmj.log import palette
from icmj.log.blueprint import BACKGROUND, arrange
from icmj.log.figure import place_eye, write_figures
from icmj.log.reader import read_static_row
from icmj.log.target import write_in_memory
from icmj.log.timeline import time_column
from icmj.log.writer import APPLICATION, ARCHIVE, raise_errors
from icmj.simulation.scene import Scene

LASTS = 1.5  # s on each cycle, at least
WIDE = 1.6  # width of the diagram's frame over its height
ENTITY = "branch_archive"


def write_branch_log(branch: Branch, path: Path | str) -> None:
    """Write a branch as a rerun recording; under its name the file is whole.

    Raises:
        LogError: if the file cannot be written.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as part, raise_errors():
            with write_in_memory(part) as sink:
                _write(branch, sink)
            if not part.is_file():
                raise ValueError("rerun wrote no file; is it switched off by RERUN in the environment?")
    except (OSError, RuntimeError, ValueError, TypeError) as error:
        raise LogError(f"{path}: the branch cannot be written ({one_line(error, 200)})") from error


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
    identity = uuid.uuid5(uuid.NAMESPACE_OID, hashlib.sha256(head.encode()).hexdigest())
    config = rr.ChunkBatcherConfig(flush_num_rows=1)
    recording = rr.RecordingStream(APPLICATION, recording_id=identity, batcher_config=config)
    recording.save(sink, default_blueprint=_blueprint(branch, scene))
    recording.set_log_time_enabled(False)
    recording.set_log_tick_enabled(False)
    title = f"{branch.run.title}: along {branch.parameter} ({branch.plant})"
    recording.send_recording_name(title)
    recording.send_property("case", _facts(name=branch.run.case.name, title=title))
    recording.send_property("outcome", _facts(kind="completed", time=float(t[-1])))
    words = rr.TextDocument(_markdown(branch, title), media_type=rr.MediaType.MARKDOWN)
    recording.log("summary", words, static=True)
    columns = {"head": pa.array([head]), **{key: pa.array(values) for key, values in flat.items() if values.size}}
    archive: list[Any] = [
        rr.AnyBatchValue(f"{ARCHIVE}:{key}", v, drop_untyped_nones=False) for key, v in columns.items()
    ]
    recording.log(ENTITY, archive, static=True)
    for path, values, names in (("outputs", laid["y"], branch.outputs), ("inputs", laid["u"], branch.inputs)):
        _series(recording, path, t, values, names)
    at = laid["cycle"].astype(int)
    _series(recording, "along/parameter", t, branch.value[at, None], (branch.parameter,))
    _series(recording, "along/interval", t, branch.intervals[at], ("Δ_ol",) * branch.intervals.shape[1])
    _series(recording, "along/multiplier", t, np.column_stack([branch.largest[at], 1 + 0 * at]), ("largest |μ|", "1"))
    _diagram(recording, branch, t, at)
    if scene is not None:
        write_figures(recording, scene)
    recording.flush(timeout_sec=60.0)
    recording.disconnect()


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


def _series(recording: rr.RecordingStream, path: str, t: Array, values: Array, names: tuple[str, ...]) -> None:
    style = rr.SeriesLines(
        colors=list(palette.choose_colours(len(names))), names=list(names), widths=[1.5] * len(names)
    )
    recording.log(path, style, static=True)
    flat = np.ascontiguousarray(values, dtype=float).reshape(-1)
    columns = rr.Scalars.columns(scalars=flat).partition(np.full(len(t), values.shape[1]))
    recording.send_columns(path, [time_column(t)], columns)


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
        start, end = (rr.TimeRangeBoundary.cursor_relative(seconds=s) for s in (-2 * LASTS, 2 * LASTS))
        axis = rrb.TimeAxis(view_range=rr.TimeRange(start=start, end=end))
        return rrb.TimeSeriesView(name=name, origin=origin, axis_x=axis)

    figures: list[Any] = []
    if scene is not None:
        position, target = place_eye(scene)
        controls = rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=position, look_target=target, eye_up=(0.0, 0.0, 1.0)
        )
        frame = rrb.SpatialInformation(target_frame="tf#/scene", show_axes=False, show_bounding_box=False)
        figures.append(
            rrb.Spatial3DView(
                name="Body, and its sway magnified", origin="scene", background=BACKGROUND, eye_controls=controls,
                line_grid=rrb.LineGrid3D(visible=False), spatial_information=frame,
            )
        )  # fmt: skip
    diagram = rrb.Spatial2DView(
        name=f"Intervals along {branch.parameter}: blue attracting, red repelling",
        origin="diagram",
        background=(24, 27, 31, 255),
        visual_bounds=rrb.VisualBounds2D(x_range=[-1.3 * WIDE, 1.3 * WIDE], y_range=[-1.3, 1.35]),
    )
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


def _facts(**facts: Any) -> list[Any]:
    return [rr.AnyBatchValue(key, pa.array([value])) for key, value in facts.items()]
