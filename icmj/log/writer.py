"""Writing a log: one ``.rrd`` with everything in it, in whole columns, complete or not at all."""

from __future__ import annotations

import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from icmj.base.files import whole
from icmj.base.text import one_line
from icmj.case.comparison import compare
from icmj.case.result import Result
from icmj.errors import LogError
from icmj.log import archive
from icmj.log.blueprint import make_blueprint
from icmj.log.figure import write_figures
from icmj.log.groups import Entity, list_groups
from icmj.log.phase_plane import write_phase_plane
from icmj.log.summary import Properties, summarise, write_markdown
from icmj.log.target import write_in_memory
from icmj.log.timeline import time_column

APPLICATION = "icmj"
LITTLE = 20_000_000  # bytes; the longest shipped run logs half of it
FORMAT = 1
"""Version of what the archive holds; raised when an older reader could misread a newer log."""


def write_log(result: Result, path: Path | str) -> None:
    """Write ``result`` to ``path`` as a rerun recording.

    The log is written under a temporary name, read back to check that it is complete, and renamed, so a log is
    either complete or absent. It contains an archive with its own digest, which :func:`icmj.read_log` reads.

    Raises:
        LogError: if the result cannot be stored or the file cannot be written.
    """
    tree, arrays = archive.pack(result)
    with open_target(Path(path), "log", "archive") as sink:
        _write(result, tree, arrays, sink)


@contextmanager
def open_target(path: Path, what: str, entity: str) -> Iterator[Path]:
    """Where rerun writes ``what`` to: it is at ``path`` if the block ends well and ``entity`` is in what was written.

    Raises:
        LogError: if it cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # a run that diverged is logged too
        with whole(path) as part, _raise_errors(), np.errstate(invalid="ignore", over="ignore"):
            with write_in_memory(part) as sink:
                yield sink
            _verify(part, entity)
    except (OSError, RuntimeError, ValueError, TypeError) as error:
        raise LogError(f"{path}: the {what} cannot be written ({_reason(error, path.parent)})") from error


@contextmanager
def _raise_errors() -> Iterator[None]:
    """Within the block, rerun raises an error on a wrong argument instead of dropping the data with a warning."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)


def _write(result: Result, tree: str, arrays: archive.Flat, sink: Path) -> None:
    digest = archive.digest(tree, arrays)
    title = f"{result.run.title} ({result.simulation.plant})"
    with open_recording(sink, digest, title, make_blueprint(result)) as recording:
        compared = None if result.prediction is None else compare(result)
        write_facts(recording, summarise(result, compared), write_markdown(result, compared))
        head = {"format": pa.array([FORMAT]), "tree": pa.array([tree]), "sha256": pa.array([digest])}
        write_archive(recording, "archive", head, arrays)
        for group in list_groups(result):
            write_group(recording, group)
        if compared is not None:
            write_phase_plane(recording, result)
        if result.scene is not None:
            write_figures(recording, result.scene)


@contextmanager
def open_recording(sink: Path, digest: str, title: str, blueprint: rrb.Blueprint) -> Iterator[rr.RecordingStream]:
    """A recording that is whole in ``sink`` after the block."""
    # one identity for one content: two versions of a case stay two recordings in the viewer
    identity = uuid.uuid5(uuid.NAMESPACE_OID, digest)
    # every chunk straight to the file, in this order: of a log cut short the summary and the archive come first
    recording = rr.RecordingStream(
        APPLICATION, recording_id=identity, batcher_config=rr.ChunkBatcherConfig(flush_num_rows=1)
    )
    recording.save(sink, default_blueprint=blueprint)
    recording.set_log_time_enabled(False)
    recording.set_log_tick_enabled(False)
    recording.send_recording_name(title)
    yield recording
    recording.flush(timeout_sec=60.0)
    recording.disconnect()


def write_facts(recording: rr.RecordingStream, topics: Properties, words: str) -> None:
    """What a recording tells of itself: facts by topic, and the page of its summary."""
    for name, facts in topics.items():
        if facts:
            properties: list[Any] = [rr.AnyBatchValue(key, pa.array([value])) for key, value in facts.items()]
            recording.send_property(name, properties)
    recording.log("summary", rr.TextDocument(words, media_type=rr.MediaType.MARKDOWN), static=True)


def write_group(recording: rr.RecordingStream, group: Entity) -> None:
    colours, names = list(group.colours), list(group.names)
    style = (
        rr.SeriesPoints(colors=colours, names=names, marker_sizes=[group.width] * len(names))
        if group.kind == "points"
        else rr.SeriesLines(
            colors=colours, names=names, widths=[group.width] * len(names), aggregation_policy=group.aggregation
        )
    )
    recording.log(group.path, style, static=True)
    M, w = group.values.shape
    columns = rr.Scalars.columns(scalars=np.ascontiguousarray(group.values).reshape(-1)).partition(np.full(M, w))
    recording.send_columns(group.path, [time_column(group.t)], columns)


def write_archive(recording: rr.RecordingStream, entity: str, head: dict[str, pa.Array], arrays: archive.Flat) -> None:
    """One static row: ``head``, and every array as a plain list of numbers that other tools read too."""
    columns = head | {key: pa.array(values) for key, values in arrays.items()}
    row: list[Any] = [
        rr.AnyBatchValue(f"{ARCHIVE}:{key}", values, drop_untyped_nones=False) for key, values in columns.items()
    ]
    recording.log(entity, row, static=True)


ARCHIVE = "icmj"


def _verify(part: Path, entity: str) -> None:
    """Check that the file opens and contains its manifest and the entity; a full disk is noticed only here."""
    if not part.is_file():
        raise ValueError("rerun wrote no file; is it switched off by RERUN in the environment?")
    if f"/{entity}" not in RrdReader(part).store().summary():
        raise ValueError("what was written does not read back")


def _reason(error: BaseException, folder: Path) -> str:
    """The cause of an error in one line, including a full disk, which rerun does not report."""
    why = error.strerror if isinstance(error, OSError) and error.strerror else one_line(error, 300)
    with suppress(OSError):
        free = shutil.disk_usage(folder).free
        if free < LITTLE:
            why += f"; only {free / 1e6:.1f} MB are free there"
    return why
