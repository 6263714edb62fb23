"""Reading a log back: the result that it was written from, bit for bit, and its summary."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from icmj.base.blas_threads import ignore_warnings
from icmj.base.text import one_line
from icmj.case.result import Result
from icmj.controller.controller import expect_intermittent
from icmj.controller.trigger import RecordedRule
from icmj.errors import IcmjError, LogError, RunFileError
from icmj.log import archive
from icmj.log.program import verify
from icmj.log.writer import ARCHIVE, FORMAT
from icmj.work.own_code import Code

_OF_ROWS = "/outputs/run"  # has a row for each of the run
_REPLACED = 5  # how often a log may be replaced while it is read


class DamagedLog(LogError):
    """The file is not a complete recording; a part of it may still be readable."""


def read_log(path: Path | str, *, allow_code: bool = False) -> Result:
    """Read the result from which a log was written, bit for bit; ``scene`` is ``None``.

    An event rule from user code is read as its numbers (:class:`icmj.controller.trigger.RecordedRule`), and so is a
    controller (:class:`icmj.controller.law.RecordedLaw`). Logs of controllers without an event rule that earlier
    versions wrote are read, too.

    Args:
        path: the log.
        allow_code: whether the class of the rule may be imported, from the folder of the run file or as an installed
            module, and instantiated with its parameters; if it is missing or its source has changed, the numbers are
            used.

    Raises:
        LogError: if the file is missing, not a log of icmj, cut short, or its archive has changed since it was
            written.
    """
    result = _read(path)
    return _own(result) if allow_code else result


def _read(path: Path | str) -> Result:
    path = Path(path)
    row, rows, styled = dict[str, Any](), 0, False
    for entity, found, count in _rows(path, "/archive", _OF_ROWS):
        row |= found if entity == "/archive" else {}
        rows += count
        styled |= entity == _OF_ROWS and not count
    columns = {name.removeprefix(f"{ARCHIVE}:"): values for name, values in row.items() if name.startswith(ARCHIVE)}
    try:
        version, tree, digest = (columns.pop(name)[0].as_py() for name in ("format", "tree", "sha256"))
        if not isinstance(tree, str):
            raise KeyError("tree")
    except (KeyError, IndexError) as error:
        raise LogError(f"{path}: a rerun recording, but not a log of icmj; it has no archive") from error
    if version != FORMAT:
        raise LogError(
            f"{path}: log format {version}, this version of icmj reads {FORMAT}; use the version that wrote it"
        )
    arrays = {name: values.to_numpy(zero_copy_only=False) for name, values in columns.items()}
    if archive.digest(tree, arrays) != digest:
        raise LogError(f"{path}: the archive has changed since it was written (SHA-256 differs); take another copy")
    try:
        result = archive.unpack(tree, arrays)
    except IcmjError as error:
        raise LogError(f"{path}: {one_line(error)}") from error
    if styled and rows != (whole := len(result.simulation.t)):
        raise LogError(
            f"{path}: has {rows} of the {whole} rows of its run, as what `rerun rrd split` makes; take the whole log"
        )
    return result


def _own(result: Result) -> Result:
    """The result with its event rule made from user code, if that is available and unchanged."""
    rule = result.controller.event_rule
    if not isinstance(rule, RecordedRule):
        return result
    code = Code(result.run.path.parent, allowed=True)
    if code.digest(rule.reference) != rule.sha256:
        return result
    try:
        made = code.make(rule.reference, **rule.parameters)
    except RunFileError:  # the name is not there, or what it makes fails here
        return result
    return replace(result, controller=expect_intermittent(result.controller).triggered_by(made))


def read_summary(path: Path | str) -> dict[str, dict[str, Any]]:
    """The properties of a log by topic (case, outcome, predicted, measured, precision, provenance, run_file).

    Raises:
        LogError: if the file is missing, not a log of icmj, or cut short.
    """
    path = Path(path)
    topics: dict[str, dict[str, Any]] = {}
    for entity, row, _ in _rows(path, "/__properties/**"):
        name = entity.removeprefix("/__properties").strip("/")
        facts = {key: values[0].as_py() for key, values in row.items() if len(values)}
        if name and facts:
            topics.setdefault(name, {}).update(facts)
    if "case" not in topics:
        raise LogError(f"{path}: a rerun recording, but not a log of icmj; it has no summary")
    return topics


def read_static_row(path: Path, entity: str) -> dict[str, Any]:
    """Static components of an entity, as arrow arrays by name.

    Raises:
        LogError: if the file is missing, not a recording, or cut short.
    """
    found: dict[str, Any] = {}
    for _, row, _ in _rows(path, entity):
        found.update(row)
    return found


_Chunk = tuple[str, dict[str, Any], int]


def _rows(path: Path, *content: str) -> list[_Chunk]:
    """Entity, its static components, as arrow arrays by name, and number of rows over time, of every selected chunk.

    A file that another writer replaced while it was read is read again.
    """
    try:
        there = path.is_file()
    except (OSError, ValueError):  # no name of a file at all
        there = False
    if not there:
        raise LogError(f"{one_line(path, 200)}: no such log")
    for _ in range(_REPLACED):
        before = _identity(path)
        try:
            return _whole_rows(path, *content)
        except DamagedLog:
            if _identity(path) == before:
                raise
    return _whole_rows(path, *content)


def _identity(path: Path) -> tuple[int, int, int] | None:
    """Properties of a file that change when it is replaced; ``None`` if there is no file."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns, found.st_size


def _whole_rows(path: Path, *content: str) -> list[_Chunk]:
    from rerun.chunk import RrdReader

    damage = verify(path)
    try:
        if damage:
            raise ValueError(damage)
        with ignore_warnings():  # of a file without an end, which is an error here anyway
            reader = RrdReader(path)
            if (several := len(reader.recordings())) > 1:
                raise LogError(
                    f"{path}: {several} recordings in one file; a log has one, give the files they came from"
                )
            stream = reader.store().stream().filter(content=list(content))
        return [_read_chunk(chunk) for chunk in stream]
    except LogError:
        raise
    except Exception as error:  # rerun's bindings raise what their Rust side fails with, of several types
        reason = one_line(error, 200)
        raise DamagedLog(
            f"{path}: not a complete rerun recording ({reason}); if cut short, `icmj replay` salvages what it can"
        ) from error


def _read_chunk(chunk: Any) -> _Chunk:
    if not chunk.is_static:
        return chunk.entity_path, {}, chunk.num_rows
    batch = _batch(chunk)
    found = {
        name: column[-1].values
        for name, column in zip(batch.schema.names, batch.columns, strict=True)
        if not name.startswith("rerun.") and hasattr(column[-1], "values") and column[-1].is_valid
    }
    return chunk.entity_path, found, 0


def _batch(chunk: Any) -> Any:
    """The chunk as an arrow batch.

    A zero byte in a name passes the decoder and aborts the interpreter on the way from Rust to C, where names end with
    one; the text form of a chunk has no such way to go (some 8 ms a megabyte).
    """
    if "\0" in chunk.format():
        raise ValueError("a name in it has a zero byte")
    return chunk.to_record_batch()
