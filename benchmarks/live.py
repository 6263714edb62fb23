"""The live page in a headless Chromium: how fast its loop is, and how many frames a second it shows."""

import json
import shutil
import subprocess
import tempfile
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from queue import Queue
from threading import Thread

import icmj
from benchmarks.row import Row
from icmj.report import live

GROUP = "live page"
SECONDS = 5  # of frames that are counted
FASTEST, FRAMES, LARGEST = 5.0, 30.0, 400.0  # bounds: times real time, frames a second, kB
ASK = """<script type="module">
const L = window.icmjLive, other = new L.Loop(L.model, { noise: NOISE });
other.advance(5);
let begun = performance.now();
other.advance(35);
const speed = 30000 / (performance.now() - begun), first = L.frames();
begun = performance.now();
setTimeout(() => {
  const frames = (1000 * (L.frames() - first)) / (performance.now() - begun);
  fetch("/", { method: "POST", body: JSON.stringify({ speed, frames }) });
}, WAIT);
</script></body>"""
NAMES = ("chromium", "chromium-browser", "google-chrome")
BROWSER = next((path for name in NAMES if (path := shutil.which(name))), None)


def rows() -> list[Row]:
    """Speed, frames and size of the pages for the three-link person and the pendulum."""
    if BROWSER is None:
        return [Row(GROUP, "the page of a person", None, "×", "skipped: no Chromium")]
    found = []
    for name, noise, words in (
        ("three-link-0.9", 0.0, "three-link person"),
        ("three-link-0.9", 1.0, "three-link person under noise"),
        ("simple-0.8", 0.0, "pendulum"),
    ):
        page = live.page(live.describe(icmj.prepare(icmj.load_run(name))))
        seen = _asked(page, noise)
        found.append(Row(GROUP, f"{words}: the loop alone", seen["speed"], "× time", "", FASTEST, at_most=False))
        found.append(Row(GROUP, f"{words}: the page", seen["frames"], "frames/s", "real time", FRAMES, False))
        found.append(Row(GROUP, f"{words}: one file", len(page.encode()) / 1e3, "kB", "", LARGEST))
    return found


def _asked(page: str, noise: float) -> dict[str, float]:
    """What a browser measures of the page, which it gets from here and answers to here."""
    ask = ASK.replace("NOISE", str(noise)).replace("WAIT", str(1000 * SECONDS))
    text, found = page.replace("</body>", ask).encode(), Queue[dict[str, float]]()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.end_headers()
            self.wfile.write(text)

        def do_POST(self) -> None:
            found.put(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *words: object) -> None:
            """Say nothing."""

    with tempfile.TemporaryDirectory() as folder, ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        command = [
            str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder}/profile",
            "--window-size=1400,900", "--remote-debugging-port=0", f"http://127.0.0.1:{server.server_port}/",
        ]  # fmt: skip
        browser = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            return found.get(timeout=120)
        finally:
            browser.terminate()
            browser.wait()
            server.shutdown()
