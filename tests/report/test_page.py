"""The page in a real browser (headless Chromium): everything drawn, nothing overlapping, at two widths and on paper.

A copy of the page gets a script that inspects it and reports to a frame around it, whose width emulates the device.
"""

import html
import json
import re
from pathlib import Path

import pytest
from report_browser import CHROMIUM, chromium
from report_cases import CASES, PAPER_PANELS, whole_report

pytestmark = [pytest.mark.browser, pytest.mark.slow]

LISTEN, INSPECT = (
    f"<script>{(Path(__file__).parent / name).read_text(encoding='utf-8')}</script>"
    for name in ("report_listen.js", "report_inspect.js")
)

FRAME = """<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,"><body style="margin:0">
<pre id="found"></pre><iframe src="copy.html" style="width:WIDTHpx;height:900px;border:0"></iframe>
<script>window.addEventListener("message", e => document.getElementById("found").textContent = e.data);</script>"""


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    if CHROMIUM is None:
        pytest.skip("no Chromium here; on Debian: apt-get install chromium")
    return whole_report(tmp_path_factory.getbasetemp())


def inspect(page, folder, width, *flags):
    text = page.read_text(encoding="utf-8")
    copy = text.replace("<head>", "<head>" + LISTEN, 1).replace("</body>", INSPECT + "</body>", 1)
    (folder / "copy.html").write_text(copy, encoding="utf-8")
    (folder / "frame.html").write_text(FRAME.replace("WIDTH", str(width)), encoding="utf-8")
    flags = (*flags, f"--window-size={width + 100},1000", "--virtual-time-budget=20000", "--dump-dom")
    done = chromium(folder, *flags, (folder / "frame.html").as_uri())
    match = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.S)
    assert match, done.stderr[-2000:]
    assert match.group(1), done.stderr[-2000:]
    found = json.loads(html.unescape(match.group(1)))
    found["console"] = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return found


DARK = "--blink-settings=preferredColorScheme=0"


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (1200, "light"), (390, "dark")])
def test_the_page_at(report, tmp_path, width, scheme):
    found = inspect(report / "report.html", tmp_path, width, *([DARK] if scheme == "dark" else []))
    assert (found["contrasts"]["ground"] < 0.02) is (scheme == "dark")
    assert min(found["contrasts"]["worst"].values()) > 4.5  # WCAG 2, level AA
    # the contents stay in view: beside the text, or one line above it
    assert -1 <= found["contents"]["top"] < found["contents"]["bottom"] <= 900
    assert found["contents"]["beside"] is (width > 1200)
    assert found["contents"]["bottom"] < (900 if width > 1200 else 60)
    assert found["width"] == width
    assert found["faults"] == []
    assert found["console"] == []
    assert found["scroll"] <= width
    assert found["wide"] == []
    assert found["clipped"] == []
    assert found["over"] == []
    assert found["tables"] > 10
    assert len(found["images"]) == len(CASES) * len(PAPER_PANELS) + 2  # an overview, and one amplitude law
    overview = found["images"].pop(0)
    assert overview["ink"] > 150
    for image in found["images"]:
        assert image["ink"] > 150, image
        assert image["width"] > 300, image
        assert any(image["ratio"] == pytest.approx(85 / height, rel=0.02) for height in (58, 70, 84))


def test_of_many_cases_the_first_is_open_and_a_link_opens_another(report, tmp_path):
    cases = re.findall(r'<a href="#case-([^"]+)">', (report / "report.html").read_text(encoding="utf-8"))
    last = list(dict.fromkeys(cases))[-1]
    opened = {}
    for there in ("", f"#case-{last}"):
        page = chromium(tmp_path, "--dump-dom", (report / "report.html").as_uri() + there).stdout
        folds = re.findall(r'<details( open="")?>\s*<summary><h3>.*?id="case-([^"]+)"', page, re.S)
        opened[there] = [name for is_open, name in folds if is_open]
        assert len(folds) > 2
    assert opened == {"": opened[""][:1], f"#case-{last}": [*opened[""][:1], last]}


def test_the_inspection_finds_faults(tmp_path):
    if CHROMIUM is None:
        pytest.skip("no Chromium here; on Debian: apt-get install chromium")
    page = tmp_path / "bad.html"
    page.write_text(
        "<html><head></head><body style='margin:0'><p style='width:2000px'>too wide</p>"
        "<p style='position:absolute;top:50px'>one</p><p style='position:absolute;top:55px'>two</p>"
        "<svg class='drawn' role='img' viewBox='0 0 9 9'><use href='#nothing'/></svg>"
        "<script>console.error('said'); undefinedName()</script></body></html>"
    )
    found = inspect(page, tmp_path, 390)
    assert found["scroll"] > 390
    assert any("too wide" in name for name in found["wide"])
    assert any("one" in name and "two" in name for name in found["over"])
    assert found["images"][0]["ink"] == 0
    assert {fault.split(":")[0] for fault in found["faults"]} == {"error"}
    assert len(found["faults"]) == 2


def test_the_page_prints_on_a4(report, tmp_path):
    printed = tmp_path / "report.pdf"
    chromium(tmp_path, "--no-pdf-header-footer", f"--print-to-pdf={printed}", (report / "report.html").as_uri())
    data = printed.read_bytes()
    boxes = set(re.findall(rb"/MediaBox ?\[([^\]]*)\]", data))
    assert len(boxes) == 1
    width, height = (float(value) for value in boxes.pop().split()[2:])
    assert (width, height) == pytest.approx((595, 842), abs=1.5)
    pages = len(re.findall(rb"/Type ?/Page\b(?!s)", data))
    assert len(CASES) < pages < 3 * len(CASES)
