"""The replay: pictures of real logs, a page on the loopback address only, salvage, and clear refusals."""

import io
import os
import re
import signal
import subprocess
import sys
import time
import urllib.request
from ctypes.util import find_library
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest
from log_cases import made_up, with_scene
from matplotlib.image import imread
from patience import PATIENCE

from icmj import Settings, write_log
from icmj.engine.run import simulate
from icmj.errors import LogError
from icmj.log.replay import _await_port, _base, _free_port, _reason, _running, replay

SIZE = (1280, 800)


def renderer() -> str:
    """What is missing for a picture without a screen, or nothing."""
    if find_library("vulkan") is None:
        return "no Vulkan loader (Debian: libvulkan1)"
    folders = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d")
    if sys.platform == "linux" and not any(Path(f).is_dir() and any(Path(f).iterdir()) for f in folders):
        return "no Vulkan driver (Debian: mesa-vulkan-drivers)"
    return ""


needs_renderer = pytest.mark.skipif(bool(renderer()), reason=f"the viewer cannot render here: {renderer()}")


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A log of each kind of body on the linear plant, and of the person in MuJoCo."""
    folder = tmp_path_factory.mktemp("logs")
    result, plant = made_up("three_link", 0.9, 0.7594, 12.0)
    settings = Settings(duration=12.0, initial={"ankle": 0.02})
    engine = replace(result, simulation=simulate(plant, result.controller, settings))
    write_log(with_scene(engine, plant, magnification=20.0), folder / "mujoco.rrd")
    for name, case in (("pendulum", made_up(duration=20.0)), ("three_link", made_up("three_link", 0.9, 0.7594, 12.0))):
        write_log(with_scene(*case, magnification=20.0), folder / f"{name}.rrd")
    return {path.stem: path for path in folder.iterdir()}


def picture(log: Path, target: Path, at: float | None = None) -> np.ndarray:
    """RGB of a screenshot, shape (height, width, 3), 0–1."""
    said: list[str] = []
    replay(log, screenshot=target, time=at, size=SIZE, say=said.append)
    assert said == []
    rgb = np.asarray(imread(target))[..., :3]
    assert rgb.shape == (SIZE[1], SIZE[0], 3)
    return rgb


def coloured(rgb: np.ndarray) -> float:
    """Share of pixels with a clear hue."""
    return float((rgb.max(axis=-1) - rgb.min(axis=-1) > 0.25).mean())


def views(rgb: np.ndarray) -> dict[str, np.ndarray]:
    """The regions of the arrangement: figures, phase plane, the plots of the middle column, those at the right."""
    h, w = rgb.shape[:2]
    left, middle = int(0.375 * w), int(0.685 * w)
    top, bottom = int(0.07 * h), int(0.96 * h)
    third = (bottom - top) // 3
    return {
        "figures": rgb[top : int(0.58 * h), :left],
        "phase plane": rgb[int(0.65 * h) : bottom, :left],
        **{f"middle {i}": rgb[top + i * third + 30 : top + (i + 1) * third, left + 5 : middle] for i in range(3)},
        "interval": rgb[int(0.45 * h) : int(0.68 * h), middle + 5 :],
        "modes": rgb[int(0.74 * h) : bottom, middle + 5 :],
    }


@pytest.mark.viewer
@pytest.mark.slow
@needs_renderer
@pytest.mark.parametrize("name", ["pendulum", "three_link", "mujoco"])
def test_every_view_is_filled_and_moves(name: str, logs: dict[str, Path], tmp_path: Path) -> None:
    late, later = (picture(logs[name], tmp_path / f"{at}.png", at) for at in (9.0, 9.35))
    for where, region in views(late).items():
        assert coloured(region) > 0.001, f"nothing is drawn in {where}"
    for where, before in views(late).items():
        moved = np.abs(before - views(later)[where]).max(axis=-1) > 0.2
        assert moved.mean() > 0.0005, f"{where} does not follow the time"
    figures = views(late)["figures"]
    halves = np.array_split(figures, 2, axis=1)
    assert all(coloured(half) > 0.005 for half in halves), "two figures side by side"


@pytest.mark.viewer
@needs_renderer
def test_no_view_reports_an_error(logs: dict[str, Path]) -> None:
    from rerun.experimental import ViewerClient

    port = _free_port()
    command = [*_base(port), "--headless", "--window-size", "1280x800"]
    with _running(command, [logs["three_link"]]) as (process, messages):
        _await_port(port, process, messages)
        client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        deadline = time.monotonic() + PATIENCE
        while not ((state := client.get_state()).views and not state.loading) and time.monotonic() < deadline:
            time.sleep(0.3)
        client.take_screenshot()
        state = client.get_state()
        assert {view.view_class for view in state.views} == {"3D", "2D", "TimeSeries", "TextDocument"}
        assert [(view.name, report.summary) for view in state.views for report in view.reports] == []
        (recording,) = state.recordings
        assert [timeline.name for timeline in recording.timelines] == ["time"]


@pytest.mark.viewer
@needs_renderer
def test_a_log_cut_short_is_shown_as_far_as_it_goes(logs: dict[str, Path], tmp_path: Path) -> None:
    whole, cut, target = logs["pendulum"].read_bytes(), tmp_path / "cut.rrd", tmp_path / "cut.png"
    cut.write_bytes(whole[: len(whole) * 2 // 3])
    said: list[str] = []
    replay(cut, screenshot=target, size=SIZE, say=said.append)
    assert len(said) == 1
    assert re.search(r"cut\.rrd: incomplete; what is whole of its [\d.]+ MB is salvaged", said[0])
    regions = views(np.asarray(imread(target))[..., :3])
    assert coloured(regions["middle 0"]) > 0.001, "the outputs come early in the file"


def test_what_cannot_be_salvaged_is_refused(tmp_path: Path) -> None:
    for name, content in (("empty.rrd", b""), ("text.rrd", b"no recording\n" * 1000)):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(LogError, match=name):
            replay(tmp_path / name, screenshot=tmp_path / "x.png")
    with pytest.raises(LogError, match="no such log"):
        replay(tmp_path / "nowhere.rrd", web=True)
    assert not (tmp_path / "x.png").exists()


@pytest.mark.parametrize("at", [-1.0, 1e3, float("nan")])
def test_an_instant_outside_the_run_is_refused(at: float, logs: dict[str, Path], tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"runs from 0 to 20 s"):
        replay(logs["pendulum"], screenshot=tmp_path / "x.png", time=at)


def test_a_picture_needs_its_folder(logs: dict[str, Path], tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no such folder"):
        replay(logs["pendulum"], screenshot=tmp_path / "nowhere" / "x.png")


@pytest.mark.viewer
@pytest.mark.skipif(sys.platform != "linux", reason="drivers are chosen by environment on Linux only")
def test_a_missing_renderer_is_named(logs: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("VK_ICD_FILENAMES", "VK_DRIVER_FILES"):
        monkeypatch.setenv(name, str(tmp_path / "none.json"))
    monkeypatch.setenv("LIBGL_DRIVERS_PATH", str(tmp_path))
    with pytest.raises(LogError, match=r"mesa-vulkan-drivers libvulkan1"):
        replay(logs["pendulum"], screenshot=tmp_path / "x.png", size=SIZE)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("words", [
    "Error: winit EventLoopError: no suitable adapter found", "failed to create a Vulkan instance",
    "thread 'main' panicked at 'Failed to get render context'\nre_viewer/src/app/mod.rs:1425\nReport bugs: there",
])  # fmt: skip
def test_whatever_the_viewer_says_of_a_missing_renderer_it_is_named(words: str) -> None:
    messages = io.BytesIO(words.encode())
    assert "mesa-vulkan-drivers libvulkan1" in _reason(messages)


SERVE = "import sys; from icmj.log.replay import replay; replay(sys.argv[1], web=True)"


def test_the_web_page_is_on_the_loopback_address_only_and_ends_with_us(logs: dict[str, Path]) -> None:
    log = str(logs["pendulum"])
    ours = subprocess.Popen([sys.executable, "-c", SERVE, log], stderr=subprocess.PIPE, text=True)
    try:
        assert ours.stderr is not None
        line = ours.stderr.readline()
        address = re.search(r"http://127\.0\.0\.1:\d+/", line)
        assert address, line
        with urllib.request.urlopen(address.group(), timeout=PATIENCE) as page:
            assert page.status == 200
            assert b"rerun" in page.read().lower()
        (viewer,) = psutil.Process(ours.pid).children(recursive=True)
        listening = [c.laddr.ip for c in viewer.net_connections() if c.status == psutil.CONN_LISTEN]
        assert len(listening) == 2
        assert set(listening) == {"127.0.0.1"}
        os.kill(ours.pid, signal.SIGTERM)
        ours.wait(PATIENCE)
        assert not viewer.is_running() or viewer.status() == psutil.STATUS_ZOMBIE
    finally:
        ours.kill()
        ours.wait()
