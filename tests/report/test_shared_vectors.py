"""Figures in a page: curves where the files have them, words once, and the same picture in a headless Chromium."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread
from report_browser import CHROMIUM, chromium
from report_cases import whole_report

from icmj.report import style
from icmj.report.shared_vectors import SharedVectors, shorten_path

BOX = (320, 300)  # px, of a figure


def figure_of_all_kinds():
    """What matplotlib writes each in a way of its own."""
    with style.apply():
        figure = Figure(figsize=(3.3, 2.6))
        axes = figure.subplots(2, 2)
        x = np.linspace(0, 6, 40)
        axes[0, 0].plot(x, np.sin(x), "o-", markersize=3, clip_on=True)
        axes[0, 0].plot(x[:3], np.cos(x[:3]), "x", linestyle=(0, (5, 1.5)))
        axes[0, 0].set(xlim=(1, 5), ylabel=r"$\lambda_{k_1}$ & <words>")
        axes[0, 1].scatter(x, np.sin(x), c=x, alpha=0.5, s=9 + x)
        axes[1, 0].imshow(np.outer(x, x), aspect="auto")
        axes[1, 0].text(3, 9, "turned", rotation=30, color="white")
        axes[1, 1].fill_between(x, 0, np.sin(x), alpha=0.4, hatch="//")
        axes[1, 1].vlines(x, -1, 0, color="#d55e00", linewidths=0.7, linestyles=":")
        return style.save(figure, "svg")


def points_of(path):
    """Points of a path of absolute or relative commands, shape (N, 2)."""
    found, here, start = [], np.zeros(2), np.zeros(2)
    for command, text in re.findall(r"([A-Za-z])([^A-Za-z]*)", path):
        if command in "zZ":
            here = start
            continue
        numbers = [float(number) for number in re.findall(r"-?[\d.]+", text)]
        if command in "hv":
            numbers = [each for n in numbers for each in ((n, 0.0) if command == "h" else (0.0, n))]
        corners = np.array(numbers).reshape(-1, {"q": 2, "c": 3}.get(command.lower(), 1), 2)
        for i, corner in enumerate(corners):
            places = corner + (here if command.islower() else 0)
            found.extend(places)
            here = places[-1]
            if command in "mM" and i == 0:
                start = here
    return np.array(found)


def test_points_of_a_path_are_those_of_the_figure_to_a_twentieth_of_a_point():
    rng = np.random.default_rng(5)
    for _ in range(20):
        steps = rng.normal(scale=3, size=(300, 2)) * (rng.random((300, 2)) > 0.1)
        points = 100 + np.cumsum(steps, axis=0)
        commands = ["M", *rng.choice(["L", "L", "L", "M"], size=299)]
        commands[-1] = "L"
        path = " ".join(f"{command} {x:.6f} {y:.6f}" for command, (x, y) in zip(commands, points, strict=True))
        path += " z M 7 7 L 8 7 Q 8 9 9.5 9.5 C 1 2 3 4 5 6 z"
        found = points_of(shorten_path(path))
        np.testing.assert_allclose(found / 10, points_of(path), rtol=0, atol=0.0501)


def test_words_of_figures_stand_in_the_page_once_and_words_about_them_are_escaped():
    vectors = SharedVectors()
    first = vectors.take(figure_of_all_kinds(), '"><script>')
    size = len(vectors.share())
    assert vectors.take(figure_of_all_kinds(), '"><script>') == first
    assert len(vectors.share()) == size
    assert "<script" not in first
    root = ElementTree.fromstring(f"<page>{first}{vectors.share()}</page>".replace(" href=", " reference="))
    assert root[0].get("aria-label") == '"><script>'
    there = {one.get("id") for one in root.iter()}
    text = ElementTree.tostring(root).decode()
    assert {*re.findall(r'reference="#([^"]*)"', text), *re.findall(r"url\(#([^)]*)\)", text)} <= there
    assert SharedVectors().share() == ""


@pytest.mark.browser
@pytest.mark.slow
def test_a_figure_looks_in_the_page_as_its_file(tmp_path, tmp_path_factory):
    """Beside edges, where laps of a cycle on each other add up what a twentieth of a point changes of a pixel."""
    if CHROMIUM is None:
        pytest.skip("no Chromium here; on Debian: apt-get install chromium")
    saved = sorted((whole_report(tmp_path_factory.getbasetemp()) / "report_figures").glob("*.svg"))
    (tmp_path / "kinds.svg").write_bytes(figure_of_all_kinds())
    saved = [tmp_path / "kinds.svg", *(path for path in saved if not path.name.startswith("overview"))]
    vectors = SharedVectors()
    shown = {
        "page": [vectors.take(path.read_bytes(), path.stem) for path in saved],
        "files": [f'<img src="{path.as_uri()}">' for path in saved],
    }
    look = f"body{{margin:0}} div{{float:left;width:{BOX[0]}px;height:{BOX[1]}px}} img,.drawn{{width:{BOX[0]}px}}"
    look += "#_{position:absolute;width:0;height:0}"
    pictures = {}
    for name, figures in shown.items():
        body = "".join(f"<div>{figure}</div>" for figure in figures)
        text = f"<!doctype html><meta charset=utf-8><style>{look}</style>{body}{vectors.share()}"
        (tmp_path / f"{name}.html").write_text(text, encoding="utf-8")
        high = BOX[1] * -(-len(saved) // 4)
        chromium(
            tmp_path, f"--screenshot={tmp_path / name}.png", f"--window-size={4 * BOX[0]},{high}",
            (tmp_path / f"{name}.html").as_uri(),
        )  # fmt: skip
        pictures[name] = imread(tmp_path / f"{name}.png")[..., :3]
    off = np.abs(pictures["page"] - pictures["files"]).max(axis=2) > 0.5
    for i, path in enumerate(saved):
        row, column = divmod(i, 4)
        box = np.s_[row * BOX[1] : (row + 1) * BOX[1], column * BOX[0] : (column + 1) * BOX[0]]
        assert (pictures["files"][box] < 0.8).any(axis=2).mean() > 0.01, path.stem
        assert off[box].mean() < 4e-3, path.stem  # a curve without its marks is off by twice that
