"""Reading a log back, and replaying it in rerun's viewer.

rerun's own program, from inside the wheel and never from PATH: the viewer, and checks in a process of their own.

Reading a log back: bit-exact numpy arrays and the summary.

The replay: a log in rerun's viewer, on the screen, in a browser on this machine, or as a picture.

The viewer is the program inside the rerun wheel, never one found on PATH, and listens on the loopback address only.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import socket
import subprocess
import sys
import tempfile
import time as clock
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO, Any, get_args
from urllib.parse import quote

from icmj.base.array import between
from icmj.base.blas_threads import ignore_warnings
from icmj.base.bounded_program import run_bounded
from icmj.base.files import is_file_name, replaceable, write_bytes
from icmj.base.interruption import interrupt_once, terminable
from icmj.base.text import did_you_mean, one_line
from icmj.case.case import PlantKind
from icmj.case.result import Result
from icmj.controller.controller import has_trigger
from icmj.controller.trigger import RecordedRule
from icmj.errors import IcmjError, LogError, RunFileError
from icmj.log import archive
from icmj.log.writer import ARCHIVE, FORMAT
from icmj.work.own_code import Code
from icmj.work.shipped import RUNS

LONGEST = 120.0  # s on the clock; a log of a gigabyte takes a few
SECONDS, BYTES_A_SECOND = 5, 20_000_000  # of processor time; 240 MB take one second
MEMORY, PER_BYTE = 2 << 30, 8  # of which 240 MB take a quarter
_NONE = "0 files verified"
_OF_ROWS = "/outputs/run"  # has a row for each of the run


def program() -> Path:
    """The program in the rerun wheel.

    Raises:
        LogError: if rerun-sdk is not installed, or without its program.
    """
    spec = importlib.util.find_spec("rerun_cli")
    if spec is not None and spec.origin is not None:
        for name in ("rerun", "rerun.exe", "Rerun.app/Contents/MacOS/Rerun"):
            if (path := Path(spec.origin).parent / name).is_file():
                return path
    raise LogError("rerun's viewer is not installed; reinstall it with: pip install --force-reinstall rerun-sdk")


def verify(path: Path) -> str:
    """Decode the whole recording in a separate process; returns a description of its fault, or nothing.

    A damaged file can abort the process that decodes it (one in four thousand with a single bit flipped), or have it
    ask for all the memory there is (one wrong byte among the sizes at the file's end); that must not be ours. Takes
    0.05 s.
    """
    try:
        done = _run_bounded(["verify", str(path)], path)
    except subprocess.TimeoutExpired:
        return f"reading it took more than {LONGEST:g} s"
    none = _NONE in done.stderr  # so it ends, with status 0, where memory is short
    if done.returncode == 0 and not none:
        return ""
    lines = [line for line in map(one_line, done.stderr.splitlines()) if line and not (none or " WARN " in line)]
    reason = lines[0] if lines else "reading it takes more time or memory than a whole one"
    return reason.removeprefix(f'"{path}":').strip()[:200]


def salvage(path: Path, copy: Path) -> str:
    """Copy every whole chunk of a recording cut short to ``copy``; returns one sentence on what was saved.

    Raises:
        LogError: if nothing can be saved.
    """
    lost = f"{path}: not a rerun recording, or cut so short that nothing can be saved; run the case again"
    try:
        done = _run_bounded(["merge", "--continue-on-error", "-o", str(copy), str(path)], path)
    except subprocess.TimeoutExpired as error:
        raise LogError(lost) from error
    if done.returncode != 0 or not copy.is_file() or verify(copy):
        raise LogError(lost)
    kept, had = copy.stat().st_size / 1e6, path.stat().st_size / 1e6
    return f"{path}: incomplete; salvaged {kept:.2f} MB of {had:.2f} MB, what came after is lost"


def _run_bounded(arguments: list[str], path: Path) -> subprocess.CompletedProcess[str]:
    """``rerun rrd`` with these arguments, held to what the recording at ``path`` could need if it were whole."""
    command, size = [str(program()), "rrd", *arguments], path.stat().st_size
    processor, data = SECONDS + size // BYTES_A_SECOND, MEMORY + PER_BYTE * size
    return run_bounded(command, LONGEST, processor=processor, data=data, environment={"NO_COLOR": "1"})


_REPLACED = 5  # how often a log may be replaced while it is read


class DamagedLog(LogError):
    """The file is not a complete recording; a part of it may still be readable."""


def read_log(path: Path | str, *, allow_code: bool = False) -> Result:
    """Read the result from which a log was written, bit for bit; ``scene`` is ``None``.

    An event rule from user code is read as its numbers (:class:`icmj.controller.trigger.RecordedRule`), and so is a
    controller (:class:`icmj.controller.controller.RecordedLaw`). Logs of controllers without an event rule that earlier
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
    controller = result.controller
    rule = controller.trigger if has_trigger(controller) else None
    if not has_trigger(controller) or not isinstance(rule, RecordedRule):
        return result
    code = Code(result.run.path.parent, allowed=True)
    if code.digest(rule.reference) != rule.sha256:
        return result
    try:
        made = code.make(rule.reference, **rule.parameters)
    except RunFileError:  # the name is not there, or what it makes fails here
        return result
    return replace(result, controller=controller.triggered_by(made))


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


def static_row(path: Path, entity: str) -> dict[str, Any]:
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


LOOPBACK = "127.0.0.1"
PATIENCE = 120.0  # s; a software renderer on a busy machine is slow to start
PAUSE = 0.4  # s between two looks at the viewer
NO_RENDERER = (
    "no graphics adapter; install a software renderer (Debian: apt-get install mesa-vulkan-drivers libvulkan1)"
)
Say = Callable[[str], None]


def say_to_stderr(message: str) -> None:
    """Default of ``say``: one line on standard error."""
    with contextlib.suppress(OSError, ValueError):  # nobody may listen
        print(one_line(message), file=sys.stderr, flush=True)


def replay(
    *paths: Path | str,
    web: bool = False,
    screenshot: Path | str | None = None,
    time: float | None = None,
    size: tuple[int, int] = (1920, 1200),
    say: Say = say_to_stderr,
) -> None:
    """Show logs in their stored layout; returns when the viewer is closed, or the picture is written.

    Args:
        paths: the logs, which the viewer lists. One that was cut short is salvaged first, into a temporary copy, and
            ``say`` is told.
        web: serve them to a browser on this machine (until interrupted) and say the address.
        screenshot: render without a screen to this PNG file, which appears only when complete; of one log.
        time: instant to show in the screenshot [s]; nine tenths into the run if ``None``.
        size: width and height of the screenshot, in pixels.
        say: takes messages for people.

    Raises:
        LogError: if there is no such log, nothing can be salvaged, or the viewer cannot run here.
    """
    if not paths or (screenshot is not None and len(paths) > 1):
        raise LogError(f"{len(paths)} logs to replay; expected {'one for a picture' if paths else 'at least one'}")
    with contextlib.ExitStack() as stack:
        logs = [stack.enter_context(_sound(Path(path), say)) for path in paths]
        if screenshot is not None:
            _screenshot(logs[0], Path(screenshot), time, size)
        elif web:
            _serve(logs, say)
        else:
            _view(logs)


def is_log(path: Path) -> bool:
    """Whether a file is a log of icmj, or may have been one before it was damaged."""
    try:
        return "run_file" in read_summary(path)
    except LogError as error:
        return isinstance(error, DamagedLog)


def find_logs(paths: Sequence[Path], results: Path) -> list[Path]:
    """The files that are meant where logs are named, each once: what every command asks.

    A folder means the logs in it, but no recording of a branch. A name of which there is no file means the logs of the
    case of this name in the folder ``results``, on one plant or both. Any other path means itself, there or not.

    Raises:
        LogError: if a folder has no log, or there is neither a file nor a case of a name.
    """
    found: dict[Path, None] = {}
    for path in paths:
        found |= dict.fromkeys(_logs_of(path, results))
    return list(found)


def find_log(path: Path, results: Path) -> Path:
    """The one file that is meant by :func:`find_logs`; of a case on both plants, its log in MuJoCo.

    Raises:
        LogError: as :func:`find_logs`, or if several are meant.
    """
    found = find_logs([path], results)
    if len(found) > 1 and path.is_dir():
        names = ", ".join(log.stem for log in found[:3]) + (", …" if len(found) > 3 else "")
        raise LogError(f"{path}: {len(found)} logs ({names}), where one is needed; give the file of one")
    return found[-1]


def _logs_of(path: Path, results: Path) -> list[Path]:
    if path.is_dir():
        if not (found := [log for log in sorted(path.glob("*.rrd")) if is_log(log)]):
            raise LogError(f"{path}: no such log; the folder has none; icmj run and icmj study write some")
        return found
    if len(path.parts) != 1 or is_file_name(path) or path.exists():
        return [path]
    plants = get_args(PlantKind)
    named = [results / f"{path}{end}.rrd" for end in ("", *(f".{plant}" for plant in plants))]
    if found := [log for log in named if log.is_file()]:
        return found
    cases = {log.stem.removesuffix(f".{plant}") for log in results.glob("*.rrd") for plant in plants}
    writes = f"icmj run {path} writes one" if path.name in RUNS.files else "icmj run and icmj study write some there"
    near = did_you_mean(str(path), sorted(cases)) or f"; {writes}"
    raise LogError(f"{one_line(path, 80)}: no such log, nor one of a case of this name in {results}{near}")


@contextlib.contextmanager
def _sound(path: Path, say: Say) -> Iterator[Path]:
    """``path`` itself if it can be read, else a salvaged temporary copy."""
    try:
        read_summary(path)
    except DamagedLog:
        with tempfile.TemporaryDirectory(prefix="icmj-") as folder:
            copy = Path(folder) / path.name
            say(salvage(path, copy))
            read_summary(copy)  # a recording, but is it a log?
            yield copy
    else:
        yield path


def _view(logs: Sequence[Path]) -> None:
    """The viewer in a window, until it is closed."""
    with _running(_base(_free_port()), logs) as (process, messages):
        _await_end(process)
        if process.returncode not in (0, -2, -15):
            raise LogError(f"the viewer cannot open a window ({_reason(messages)}); try --web or --screenshot PNG")


def _serve(logs: Sequence[Path], say: Say) -> None:
    """The viewer's web page and the logs behind it, on the loopback address, until interrupted."""
    port, web_port = _free_port(), _free_port()
    command = [*_base(port), "--serve-web", "--web-viewer-port", str(web_port)]
    with _running(command, logs) as (process, messages):
        for each in (port, web_port):
            _await_port(each, process, messages)
        data = quote(f"rerun+http://{LOOPBACK}:{port}/proxy", safe="")
        names = ", ".join(log.name for log in logs)
        say(f"serving {names} at http://{LOOPBACK}:{web_port}/?url={data} (stop with Ctrl-C)")
        _await_end(process)
        if process.returncode not in (0, -2, -15):
            raise LogError(f"the web viewer stopped ({_reason(messages)})")


def _screenshot(log: Path, target: Path, time: float | None, size: tuple[int, int]) -> None:
    """Render ``log`` at ``time`` without a screen."""
    if not target.parent.is_dir():
        raise LogError(f"{target}: no such folder {target.parent}")
    try:
        replaceable(target)
    except OSError as error:
        raise LogError(f"{target}: cannot be written ({error.strerror})") from error
    outcome = read_summary(log).get("outcome", {})
    end = float(outcome.get("time", 0.0))
    at = 0.9 * end if time is None else time
    if not between(at, 0.0, end):
        raise LogError(f"{log}: no instant {at:g} s in this log; it runs from 0 to {end:g} s")
    port = _free_port()
    command = [*_base(port), "--headless", "--window-size", f"{size[0]}x{size[1]}"]
    with _running(command, [log]) as (process, messages):
        _await_port(port, process, messages)
        try:
            picture = _picture(port, at)
        except (RuntimeError, OSError, TimeoutError) as error:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(2)  # of a viewer that died, its own last words say more
            why = one_line(error, 200) if process.poll() is None else _reason(messages)
            raise LogError(f"{log}: no picture ({why})") from error
    if not picture.startswith(b"\x89PNG") or b"IEND" not in picture[-16:]:
        raise LogError(f"{log}: the viewer gave no complete picture")
    try:
        write_bytes(target, picture)
    except OSError as error:
        raise LogError(f"{target}: cannot be written ({error.strerror})") from error


def _picture(port: int, at: float) -> bytes:
    """Drive the viewer to an instant and take its picture, once two in a row are the same."""
    from rerun.experimental import ViewerClient

    client = ViewerClient.connect(f"rerun+http://{LOOPBACK}:{port}/proxy")
    deadline = clock.monotonic() + PATIENCE
    while True:
        state = client.get_state()
        if state.recordings and state.recordings[0].timelines and state.views and not state.loading:
            break
        if clock.monotonic() > deadline:
            raise TimeoutError("the viewer did not finish loading")
        clock.sleep(PAUSE)
    client.set_time("time", duration=at, play_state="paused")
    before = b""
    while clock.monotonic() < deadline:
        clock.sleep(PAUSE)
        picture = client.take_screenshot()
        if picture == before:
            return picture
        before = picture
    return before


def _base(port: int) -> list[str]:
    return [str(program()), "--bind", LOOPBACK, "--port", str(port), "--hide-welcome-screen"]


@contextlib.contextmanager
def _running(command: list[str], logs: Sequence[Path]) -> Iterator[tuple[subprocess.Popen[bytes], IO[bytes]]]:
    """The viewer as a child that does not outlive the block; its messages go to a temporary file.

    It works in the topmost folder: it reads settings, ``kittest.toml``, in its working folder and all above.
    """
    # errors only: every warning would be drawn over the picture as a notification
    environment = os.environ | {"RUST_LOG": "error", "RERUN_APP_ONLY": "true"}
    with terminable(), interrupt_once(), tempfile.TemporaryFile() as messages:
        paths = [log.absolute() for log in logs]
        words, top = [*command, *map(str, paths)], paths[0].anchor
        process = subprocess.Popen(words, stdout=messages, stderr=messages, env=environment, cwd=top)
        try:
            yield process, messages
        finally:
            if process.poll() is None:
                process.terminate()
                try:
                    process.wait(5)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()


def _await_port(port: int, process: subprocess.Popen[bytes], messages: IO[bytes]) -> None:
    deadline = clock.monotonic() + PATIENCE
    while clock.monotonic() < deadline:
        if process.poll() is not None:
            raise LogError(f"rerun's viewer stopped at once: {_reason(messages)}")
        with contextlib.suppress(OSError), socket.create_connection((LOOPBACK, port), timeout=1):
            return
        clock.sleep(0.1)
    raise LogError(f"rerun's viewer did not answer within {PATIENCE:g} s")


def _await_end(process: subprocess.Popen[bytes]) -> None:
    with contextlib.suppress(KeyboardInterrupt):
        process.wait()


def _reason(messages: IO[bytes]) -> str:
    """Why the viewer stopped, in one line."""
    messages.seek(0)
    text = messages.read().decode(errors="replace")
    if any(words in text.lower() for words in ("adapter", "vulkan", "render context")):
        return NO_RENDERER
    if "DISPLAY" in text:
        return "no display"
    lines = [line for line in map(one_line, text.splitlines()) if line]
    return lines[-1][:200] if lines else "no message"


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])
