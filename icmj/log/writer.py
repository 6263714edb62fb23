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
from icmj.log.summary import summarise, write_markdown
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
    path = Path(path)
    tree, arrays = archive.pack(result)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # a run that diverged is logged too
        with whole(path) as part, raise_errors(), np.errstate(invalid="ignore", over="ignore"):
            with write_in_memory(part) as sink:
                _write(result, tree, arrays, sink)
            _verify(part)
    except (OSError, RuntimeError, ValueError, TypeError) as error:
        raise LogError(f"{path}: the log cannot be written ({_reason(error, path.parent)})") from error


@contextmanager
def raise_errors() -> Iterator[None]:
    """Within the block, rerun raises an error on a wrong argument instead of dropping the data with a warning."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)


def _write(result: Result, tree: str, arrays: archive.Flat, sink: Path) -> None:
    digest = archive.digest(tree, arrays)
    # one identity for one content: two versions of a case stay two recordings in the viewer
    identity = uuid.uuid5(uuid.NAMESPACE_OID, digest)
    # every chunk straight to the file, in this order: of a log cut short the summary and the archive come first
    recording = rr.RecordingStream(
        APPLICATION, recording_id=identity, batcher_config=rr.ChunkBatcherConfig(flush_num_rows=1)
    )
    recording.save(sink, default_blueprint=make_blueprint(result))
    recording.set_log_time_enabled(False)
    recording.set_log_tick_enabled(False)
    recording.send_recording_name(f"{result.run.title} ({result.simulation.plant})")
    compared = None if result.prediction is None else compare(result)
    properties, words = summarise(result, compared), write_markdown(result, compared)
    for name, facts in properties.items():
        if facts:
            recording.send_property(name, [_fact(key, value) for key, value in facts.items()])
    recording.log("summary", rr.TextDocument(words, media_type=rr.MediaType.MARKDOWN), static=True)
    _write_archive(recording, tree, arrays, digest)
    for group in list_groups(result):
        _write_group(recording, group)
    if compared is not None:
        write_phase_plane(recording, result)
    if result.scene is not None:
        write_figures(recording, result.scene)
    recording.flush(timeout_sec=60.0)
    recording.disconnect()


def _write_group(recording: rr.RecordingStream, group: Entity) -> None:
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


def _write_archive(recording: rr.RecordingStream, tree: str, arrays: archive.Flat, digest: str) -> None:
    """One static row: the tree, its digest, and every array as a plain list of numbers that other tools read too."""
    head = {"format": pa.array([FORMAT]), "tree": pa.array([tree]), "sha256": pa.array([digest])}
    body = {key: pa.array(values) for key, values in arrays.items()}
    recording.log("archive", _batches(head | body), static=True)


def _batches(columns: dict[str, pa.Array]) -> list[Any]:
    return [rr.AnyBatchValue(f"{ARCHIVE}:{key}", values, drop_untyped_nones=False) for key, values in columns.items()]


ARCHIVE = "icmj"


def _fact(key: str, value: float | int | bool | str) -> Any:
    return rr.AnyBatchValue(key, pa.array([value]))


def _verify(part: Path) -> None:
    """Check that the file opens and contains its manifest and the archive; a full disk is noticed only here."""
    if not part.is_file():
        raise ValueError("rerun wrote no file; is it switched off by RERUN in the environment?")
    if "/archive" not in RrdReader(part).store().summary():
        raise ValueError("what was written does not read back")


def _reason(error: BaseException, folder: Path) -> str:
    """The cause of an error in one line, including a full disk, which rerun does not report."""
    why = error.strerror if isinstance(error, OSError) and error.strerror else one_line(error, 300)
    with suppress(OSError):
        free = shutil.disk_usage(folder).free
        if free < LITTLE:
            why += f"; only {free / 1e6:.1f} MB are free there"
    return why
