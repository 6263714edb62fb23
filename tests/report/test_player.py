"""The moving page: what the script is given, and that bodies move in a headless Chromium, from a file, alone."""

import html
import json
import re
import string
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from log_cases import made_up, with_scene
from report_browser import CHROMIUM, chromium

from icmj import build_report, parse_run, read_log, write_log
from icmj.log.figure import read_scene
from icmj.report.player import moving, script
from icmj.simulation.scene import Scene

SEEN = '"\'><img src=x onerror="window.hit=1"><script>window.hit=1</script><!--</script>&amp;\x1b[31m$x_{$'
PLAIN = SEEN.replace("\x1b[31m", "")
NOTE = f"a note {PLAIN}"
HERE = Path(__file__).parent
LISTEN, ACT = ((HERE / name).read_text(encoding="utf-8") for name in ("report_listen.js", "report_play.js"))


@pytest.fixture(scope="module")
def person():
    """Three links of a person over three seconds, all its words as an attacker would choose them."""
    result, plant = made_up("three_link", 0.9, 0.7594, duration=3.0)
    said = f"title = {json.dumps(PLAIN)}\n[case.paper]\nnote = {json.dumps(NOTE)}"
    text = result.run.text.replace('title = "Made-up case"', said)
    names = ("shank " + SEEN, "thigh", "trunk")
    seen = with_scene(replace(result, run=parse_run(text, "runs/made-up.toml")), plant)
    return replace(seen, actual=replace(seen.actual, outputs=names, inputs=tuple(f"{n} torque" for n in names)))


@pytest.fixture(scope="module")
def page(person, tmp_path_factory):
    if CHROMIUM is None:
        pytest.skip("no Chromium here; on Debian: apt-get install chromium")
    out = tmp_path_factory.mktemp("player") / "report.html"
    build_report([person], out)
    return out


def decoded(column, count):
    if len(column) == 1:
        return np.full(count, column[0])
    return column[0] + column[1] * np.cumsum(np.cumsum(list(numbers(column[2]))))


def numbers(letters):
    """Whole numbers: digits of base 32, lowest first, and 32 more where another follows; the last bit is the sign."""
    digits = (string.digits + string.ascii_uppercase + string.ascii_lowercase + "-_").index
    for word in re.findall(r"[W-Za-z_-]*[0-9A-V]", letters):
        twice = sum(digits(letter) % 32 * 32**place for place, letter in enumerate(word))
        yield -(twice + 1) // 2 if twice % 2 else twice // 2


def test_a_scene_comes_back_from_a_log_as_it_is_drawn(tmp_path):
    result, plant = made_up("three_link", 0.9, 0.7594, duration=1.0)
    result = with_scene(result, plant, 20.0)
    write_log(result, tmp_path / "x.rrd")
    there, back = result.scene, read_scene(tmp_path / "x.rrd")
    bodies = [there.bodies.index(name) for name in back.bodies]
    rows = np.searchsorted(there.t, back.t - 1e-8)
    assert back.magnification == 20.0
    for name in ("xpos", "xquat", "magnified_xpos", "magnified_xquat"):
        np.testing.assert_allclose(getattr(back, name), getattr(there, name)[rows][:, bodies], atol=1e-6)
    for name in ("com", "magnified_com"):
        np.testing.assert_allclose(getattr(back, name), getattr(there, name)[rows], atol=1e-6)
    shapes = {geom.name: geom for geom in there.geoms if geom.type != "plane"}
    assert {geom.name for geom in back.geoms if geom.type != "plane"} == set(shapes)
    for geom in back.geoms:
        if geom.type != "plane":
            same = shapes[geom.name]
            assert there.bodies[same.body] == back.bodies[geom.body]
            np.testing.assert_allclose(geom.pos, same.pos, atol=1e-6)
            np.testing.assert_allclose(geom.rgba, same.rgba, atol=1 / 255)
            used = {"sphere": [0, 0, 0], "capsule": [0, 1], "cylinder": [0, 1]}.get(geom.type, [0, 1, 2])
            np.testing.assert_allclose(geom.size[: len(used)], same.size[used], atol=1e-6)
            assert abs(abs(geom.quat @ same.quat) - 1) < 1e-6
    write_log(replace(result, scene=None), tmp_path / "none.rrd")
    assert read_scene(tmp_path / "none.rrd") is None
    assert read_log(tmp_path / "x.rrd").scene is None


def test_what_the_script_is_given_is_the_run(person):
    found, scene = moving(person), person.scene
    count = len(scene.t)
    columns = np.column_stack([decoded(column, count) for column in found["columns"]])
    assert columns.shape[1] == 1 + 3 + 3 + 2 * (6 * len(scene.bodies) + 2)
    np.testing.assert_allclose(columns[:, 0], scene.t, atol=1e-4)
    rows = np.searchsorted(person.simulation.t, scene.t - 1e-8)
    np.testing.assert_allclose(columns[:, 1:4], np.degrees(person.simulation.y[rows]), atol=1e-3)
    trunk = scene.bodies.index("trunk")
    np.testing.assert_allclose(columns[:, 7 + 6 * trunk : 9 + 6 * trunk], scene.xpos[:, trunk, ::2], atol=1e-5)
    np.testing.assert_allclose(columns[:, 9 + 6 * trunk : 13 + 6 * trunk], scene.xquat[:, trunk], atol=1e-5)
    # the rates are the derivatives of the outputs between the events
    between = np.diff(columns[:, 1]) / np.diff(columns[:, 0])
    assert np.median(np.abs(between - (columns[1:, 4] + columns[:-1, 4]) / 2)) < 0.02 * np.abs(columns[:, 4]).max()


def test_the_scripts_data_end_no_element_and_are_the_same_read_back(person):
    text = str(script({"run0": moving(person)}))
    assert not re.search(r"[<>&\u2028\u2029]", text)
    assert json.loads(text)["run0"]["outputs"][0][0] == "shank " + PLAIN


def test_a_run_that_diverged_is_played_up_to_there(person):
    simulation = person.simulation
    y = simulation.y.copy()
    y[len(y) // 2 :] = np.inf
    short = moving(replace(person, simulation=replace(simulation, y=y)))
    assert 0 < len(list(numbers(short["columns"][0][2]))) < len(list(numbers(moving(person)["columns"][0][2])))
    assert moving(replace(person, simulation=replace(simulation, y=np.full_like(y, np.nan)))) is None


def test_every_shape_is_as_large_as_its_geom(person):
    """Widths along the axes of a geom's own frame, of the points with their ball."""
    from icmj.report.player import _outline

    for geom in person.scene.geoms:
        if geom.type == "plane":
            continue
        plain = _outline(replace(geom, quat=np.array([1.0, 0, 0, 0]), pos=np.zeros(3)))
        found = np.array(plain["axes"] if geom.type == "ellipsoid" else plain["points"])
        reach = np.abs(found).max(axis=0) + plain.get("radius", 0.0)
        a, b, c = geom.size
        expected = {"sphere": (a, a, a), "capsule": (a, a, a + b), "cylinder": (a, a, b)}.get(geom.type, (a, b, c))
        np.testing.assert_allclose(reach, expected, atol=1e-4)  # the page has tenths of a millimetre
        turned = _outline(geom)
        there = np.array(turned["axes"] if geom.type == "ellipsoid" else np.array(turned["points"]) - geom.pos)
        np.testing.assert_allclose(np.linalg.norm(there, axis=1), np.linalg.norm(found, axis=1), atol=2e-4)


@pytest.mark.browser
@pytest.mark.slow
def test_a_person_moves_and_no_name_becomes_script(page, tmp_path):
    text = page.read_text(encoding="utf-8")
    assert not re.search(r'src="(?!data:)|href="(?!#|data:)|https?://(?!www\.w3\.org)', text)
    # frames come with the browser's virtual time, not when a busy machine has time to paint
    frames = "window.requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 16);"
    acted = text.replace("<head>", f"<head><script>{LISTEN}{frames}</script>", 1)
    acted = acted.replace("</body>", f'<pre id="found"></pre><script>{ACT}</script></body>')
    (tmp_path / "acted.html").write_text(acted, encoding="utf-8")
    arguments = ["--window-size=1280,1000", "--virtual-time-budget=8000", "--dump-dom"]
    done = chromium(tmp_path, *arguments, (tmp_path / "acted.html").as_uri())
    found = json.loads(html.unescape(re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.S)[1] or "null"))
    assert found["faults"] == []
    assert found["hit"] is False
    assert found["played"] > 2  # frames of the opening player that are not the same
    assert found["scrubbed"] > 1000  # pixels that another place of the scrubber changes
    for linked in ("curve", "outputs", "plane", "intervals", "modes"):
        assert found[linked]["moved"] > 300, linked
        assert abs(found[linked]["time"] - found[linked]["expected"]) < found[linked]["within"], linked
    assert found["zoomed"] == pytest.approx([0.75, 1.5], abs=0.1)
    assert PLAIN in found["text"]
    assert PLAIN in found["told"]
    assert NOTE in found["text"]
    assert found["pictures"] > 6
    assert found["broken"] == 0


@pytest.mark.browser
@pytest.mark.slow
def test_without_scripts_the_page_reads_as_a_page(page, tmp_path):
    text = page.read_text(encoding="utf-8")
    forbidden = '<head><meta http-equiv="Content-Security-Policy" content="script-src \'none\'">'
    (tmp_path / "plain.html").write_text(text.replace("<head>", forbidden, 1), encoding="utf-8")
    dom = chromium(tmp_path, "--dump-dom", (tmp_path / "plain.html").as_uri()).stdout.partition("<script")[0]
    assert "Linear theory predicts" in dom
    assert "<canvas" not in dom
    assert len(re.findall(r'<div class="player"[^>]* hidden=""></div>', dom)) == dom.count('class="player"') == 2
    assert dom.count('role="img"') == text.partition("<script")[0].count('role="img"') > 6


def test_what_stands_in_no_scene_has_no_body():
    empty = Scene(np.zeros(2), (), (), *(np.zeros((2, 0, 3)), np.zeros((2, 0, 4)), np.zeros((2, 3))) * 2, 10.0)
    result, _ = made_up(duration=2.0)
    assert moving(replace(result, scene=None))["body"] is None
    assert moving(replace(result, scene=empty)) is not None
