"""The replay: a log in rerun's viewer, on the screen, in a browser on this machine, or as a picture.

The viewer is the program inside the rerun wheel, never one found on PATH, and listens on the loopback address only.
"""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import tempfile
import time as clock
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO
from urllib.parse import quote

from icmj.base.array import is_between
from icmj.base.files import expect_replaceable, write_bytes
from icmj.base.interruption import catch_termination, interrupt_once
from icmj.base.text import one_line
from icmj.errors import LogError, explain_refusal
from icmj.log.program import find_program, salvage
from icmj.log.reader import DamagedLog, read_summary

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
        if not _ends_well(process):
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
        if not _ends_well(process):
            raise LogError(f"the web viewer stopped ({_reason(messages)})")


def _screenshot(log: Path, target: Path, time: float | None, size: tuple[int, int]) -> None:
    """Render ``log`` at ``time`` without a screen."""
    if not target.parent.is_dir():
        raise LogError(f"{target}: no such folder {target.parent}")
    with explain_refusal(LogError, f"{target}: cannot be written"):
        expect_replaceable(target)
    outcome = read_summary(log).get("outcome", {})
    end = float(outcome.get("time", 0.0))
    at = 0.9 * end if time is None else time
    if not is_between(at, 0.0, end):
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
    with explain_refusal(LogError, f"{target}: cannot be written"):
        write_bytes(target, picture)


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
    return [str(find_program()), "--bind", LOOPBACK, "--port", str(port), "--hide-welcome-screen"]


@contextlib.contextmanager
def _running(command: list[str], logs: Sequence[Path]) -> Iterator[tuple[subprocess.Popen[bytes], IO[bytes]]]:
    """The viewer as a child that does not outlive the block; its messages go to a temporary file.

    It works in the topmost folder: it reads settings, ``kittest.toml``, in its working folder and all above.
    """
    # errors only: every warning would be drawn over the picture as a notification
    environment = os.environ | {"RUST_LOG": "error", "RERUN_APP_ONLY": "true"}
    with catch_termination(), interrupt_once(), tempfile.TemporaryFile() as messages:
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


def _ends_well(process: subprocess.Popen[bytes]) -> bool:
    """Whether the viewer ends by itself, or because it is asked to."""
    with contextlib.suppress(KeyboardInterrupt):
        process.wait()
    return process.returncode in (0, -2, -15)


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
