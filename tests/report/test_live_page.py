"""The live page as a reader meets it, in a headless Chromium: what moves, what is said, and that it needs nothing."""

import html
import json
import re
from pathlib import Path

import numpy as np
import pytest
from report_browser import CHROMIUM, chromium

import icmj
from icmj.cli.main import main
from icmj.report import live

HERE = Path(__file__).parent
LISTEN, PLAY = ((HERE / name).read_text(encoding="utf-8") for name in ("report_listen.js", "live_play.js"))
MOST = 200_000  # bytes of a page with a third of its table
pytestmark = [
    pytest.mark.browser,
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here; on Debian: apt-get install chromium"),
]


FIRST = """
const L = window.icmjLive;
L.say();
const out = document.createElement("pre");
out.id = "found";
out.textContent = JSON.stringify({
  faults: window.faults, text: document.body.innerText, said: document.getElementById("said").textContent,
  predicted: L.theory().delta, middle: document.querySelector(".middle").textContent });
document.body.append(out);
"""


def played(text, folder, play=PLAY):
    """What ``live_play.js`` found, with frames that come with the browser's virtual time until it has."""
    frame = "document.getElementById('found') || draw(performance.now())"
    frames = f"window.requestAnimationFrame = (draw) => setTimeout(() => {frame}, 16);"
    acted = text.replace("<head>", f"<head><script>{LISTEN}{frames}</script>", 1)
    acted = acted.replace("</body>", f'<script type="module">{play}</script></body>')
    (folder / "acted.html").write_text(acted, encoding="utf-8")
    arguments = ["--window-size=1400,900", "--virtual-time-budget=20000", "--dump-dom"]
    done = chromium(folder, *arguments, (folder / "acted.html").as_uri())
    match = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.S)
    assert match, done.stderr[-2000:]
    return json.loads(html.unescape(match[1]))


def test_the_standing_person(tmp_path, monkeypatch):
    monkeypatch.setattr(live, "GAINS", (0.74, 1.3))
    monkeypatch.setattr(live, "DELAYS", (0.0, 0.1))
    page = tmp_path / "live.html"
    assert main(["live", "three-link-0.9", "-o", str(page), "-q"]) == 0
    text = page.read_text(encoding="utf-8")
    assert page.stat().st_size < MOST
    assert not re.search(r'(src|href)="(?!data:,)|\bimport\(|^import |fetch\(|XMLHttpRequest|url\(', text, re.M)
    found = played(text, tmp_path)
    case = icmj.prepare(icmj.load_run("three-link-0.9"))
    delta = case.prediction.delta_crit
    assert found["faults"] == []
    # measured and predicted, and both in the words
    first = found["first"]
    assert first["kind"] == "settled 1 predicted"
    assert first["predicted"] == pytest.approx(delta, rel=1e-7)
    assert first["interval"] == pytest.approx(delta, rel=1e-3)
    assert f"predicted {delta:.4f} s, measured {first['interval']:.4f} s" in first["theory"]
    # a slider changes the loop where it is: neither an event nor a new step
    assert found["moved"]["same"] is True
    assert found["moved"]["b"] == 1.1
    assert found["moved"]["q"] == pytest.approx(0.01 * 10**0.02, rel=1e-3)
    assert found["moved"]["fired"] == 0
    assert "mirror image" in found["mirrored"]["seen"]
    assert found["mirrored"]["kind"] == "settled 1 predicted"
    assert found["exact"]["predicted"] is None
    assert "b = 1" in found["exact"]["theory"]
    assert "no cycle is predicted" in found["exact"]["theory"]
    # each settles on an orbit of the catalogue, which need not be that at Δ_crit; the page names it
    third = 0
    for (b, delay), other in zip([(1.28, 0.0), (1.3, 0.0), (0.75, 0.1), (1.21, 0.1)], found["coexisting"], strict=True):
        changes = {"actual.gain": b, "assumed.delay": delay or None}
        orbits = icmj.prepare(icmj.load_run("three-link-0.9").with_(**changes)).prediction.orbits
        signs = ["+1" if one.crossing.eigenvalue.real > 0 else "−1" for one in orbits]
        words = [f"{o.crossing.delta:.4f} s (λ = {sign}), {o.verdict}" for o, sign in zip(orbits, signs, strict=True)]
        assert other["orbits"] == words
        one = orbits[other["bold"]]
        assert one.settles
        assert other["kind"] == "settled 1 predicted", other
        assert other["interval"] == pytest.approx(one.crossing.delta, rel=0.05)
        assert f"Of {len(orbits)} orbits this is the" in other["theory"]
        third += "this is the third" in other["theory"]
    assert third >= 1
    assert [each["kind"] for each in found["chosen"]] == ["settled 1 predicted"] * 2
    assert "±" in found["noise"]["number"]
    assert "standard deviation" in found["noise"]["seen"]
    assert "without noise" in found["noise"]["theory"]
    assert "ruled out" in found["ruled"]["theory"]
    assert found["firstly"] >= 0.3
    *positions, ankle, knee, hip, events = found["pushed"]
    assert np.abs(positions).max() == 0
    assert max(map(abs, (ankle, knee, hip))) > 0
    assert events == 0
    assert found["playing"] is True
    assert found["paused"] is True
    assert found["named"] == 0
    assert found["turned"] is True
    assert "predicted interval" in found["text"]
    # a reader did not know what φ(Δ) and Δ were, whether the period is meant, nor what the bar is
    assert "period: one interval" in found["first"]["period"]
    assert "period: two intervals" in found["mirrored"]["period"]
    for explained in (
        "φ(Δ) maps the state at one event to the state at the next",
        "bar: the time since the last event",
    ):
        assert explained in " ".join(found["text"].split())


def test_a_body_of_another_mass_is_no_exact_model(tmp_path, monkeypatch):
    """ "The model is exact (b = 1): … hence no interval" stood beneath the predicted interval."""
    monkeypatch.setattr(live, "GAINS", (0.99, 1.0))
    monkeypatch.setattr(live, "DELAYS", ())
    page = tmp_path / "live.html"
    changes = ("assumed.person.mass=68", "actual.person.mass=80", "actual.gain=1")
    options = [word for change in changes for word in ("--set", change)]
    assert main(["live", "three-link-0.9-delay", "-o", str(page), "-q", *options]) == 0
    dom = played(page.read_text(encoding="utf-8"), tmp_path, FIRST)
    assert dom["faults"] == []
    assert "exact" not in dom["text"]
    assert "no cycle is predicted" not in dom["text"]
    assert "as strong as the model assumes, but the body differs from the model otherwise" in dom["said"]
    assert f"events are Δ = {dom['predicted']:.4f} s apart" in dom["said"]
    assert dom["middle"] == "▲ as assumed"
    assert "Changed from the file: assumed.person.mass = 68, actual.person.mass = 80, actual.gain = 1." in dom["text"]
    assert "linearised at the pose in which it is balanced" in dom["text"]


def test_a_threshold_that_is_passed_until_an_action_is_no_earlier_event(tmp_path, monkeypatch):
    """At the instant of the action, before it, the rule was judged; study and cycle found the cycle that attracts."""
    monkeypatch.setattr(live, "GAINS", (0.8, 1.0))
    monkeypatch.setattr(live, "DELAYS", ())
    page = tmp_path / "live.html"
    options = ["--set", "actual.gain=0.8", "--set", "assumed.delay=0.15"]
    assert main(["live", "three-link-0.9", "-o", str(page), "-q", *options]) == 0
    dom = played(page.read_text(encoding="utf-8"), tmp_path, FIRST)
    assert "events are Δ = 0.2022 s apart" in dom["said"]
    assert "reached earlier" not in dom["said"]


def test_a_controller_without_an_internal_model(tmp_path):
    page = tmp_path / "live.html"
    assert main(["live", "runs/rivals/one-link-switching.toml", "-o", str(page), "-q"]) == 0
    found = played(page.read_text(encoding="utf-8"), tmp_path)
    assert found["faults"] == []
    assert "Feedback is o" in found["first"]["seen"]
    assert "no critical interval" in found["first"]["theory"]
    assert found["named"] == 0
    assert "Gawthrop" not in found["text"]
    assert "starts on the orbit" not in found["text"]


def test_no_title_becomes_script_and_a_plant_of_matrices_says_that_it_is_linear(tmp_path, monkeypatch, root):
    monkeypatch.setattr(live, "GAINS", (1.0, 1.0))
    monkeypatch.setattr(live, "DELAYS", ())
    run = icmj.load_run(root / "runs/joystick/joystick-1.toml")
    bad = "<img src=x onerror='window.faults.push(1)'></script><script>window.faults.push(2)</script>"
    text = run.text.replace("Joystick sets", f"{bad} Joystick sets")
    page = tmp_path / "live.html"
    icmj.build_live(icmj.prepare(icmj.parse_run(text, run.path)), page)
    plain = page.read_text(encoding="utf-8").replace("</body>", '<p id="done"></p></body>')
    listening = plain.replace("<head>", f"<head><script>{LISTEN}</script>", 1)
    counting = "document.title = faults.length"
    page.write_text(listening.replace('<p id="done">', f'<script type="module">{counting}</script><p>'))
    dom = chromium(tmp_path, "--virtual-time-budget=3000", "--dump-dom", page.as_uri()).stdout
    assert "<title>0</title>" in dom
    assert "The body on this page is the linear plant: it is given by matrices." in html.unescape(dom)
