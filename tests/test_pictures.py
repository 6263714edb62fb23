"""docs/pictures/: every picture is made by ``python docs/draw.py``, from what is there now, and is the one shown."""

import hashlib
import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import numpy as np
import pytest


@pytest.fixture(scope="module")
def drawing(root: Path) -> ModuleType:
    """The script, as a module."""
    specification = importlib.util.spec_from_file_location("draw", root / "docs" / "draw.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules["draw"] = module  # where dataclasses look for annotations
    specification.loader.exec_module(module)
    return module


def test_what_is_shown_is_drawn_by_the_script_and_nothing_else(drawing, root):
    pages = [root / "README.md", root / "paper" / "paper.md", *(root / "docs").glob("*.md")]
    shown = {
        name for page in pages for name in re.findall(r"pictures/([\w.-]+\.(?:png|svg|gif))", page.read_text("utf-8"))
    }
    there = {path.name for path in (root / "docs" / "pictures").iterdir()} - {"manifest.json"}
    assert shown == there == set(drawing.PICTURES) == set(drawing.manifest())


def test_no_picture_is_older_than_what_it_is_drawn_from(drawing, root):
    """Digests of run files, models, examples and drawing code, and of the picture itself."""
    assert not drawing.outdated(), "run python docs/draw.py --outdated, and look at the pictures"
    for name, known in drawing.manifest().items():
        content = (root / "docs" / "pictures" / name).read_bytes()
        assert hashlib.sha256(content).hexdigest() == known["picture"], f"{name} was not drawn by docs/draw.py"


def test_a_change_of_an_input_makes_a_picture_outdated(drawing, tmp_path, monkeypatch):
    monkeypatch.setattr(drawing, "ROOT", tmp_path)
    (tmp_path / "a.toml").write_text("b = 1\n", encoding="utf-8")
    before = drawing.digest(["a.toml"])
    (tmp_path / "a.toml").write_bytes(b"b = 1\r\n")  # as a checkout on Windows has it
    assert drawing.digest(["a.toml"]) == before
    (tmp_path / "a.toml").write_text("b = 2\n", encoding="utf-8")
    assert drawing.digest(["a.toml"]) != before


@pytest.mark.parametrize("name", ["concept-light.svg", "concept-narrow-dark.svg"])
def test_the_drawing_of_the_idea_is_what_the_present_code_draws(name, drawing, root, tmp_path):
    """Its curves are a simulation's, to the tenth of a pixel that is printed, and its words are the same."""
    drawing.PICTURES[name].draw(tmp_path / name)
    new, old = (ElementTree.parse(folder / name).getroot() for folder in (tmp_path, root / "docs" / "pictures"))
    assert ["".join(new.itertext())] == ["".join(old.itertext())]
    for one, other in zip(new.iter(), old.iter(), strict=True):
        assert one.tag == other.tag
        points = [np.array(re.findall(r"-?[\d.]+", element.get("points", "")), float) for element in (one, other)]
        # an event a rounding earlier may fall on the other side of a row
        np.testing.assert_allclose(points[0], points[1], atol=0.11)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["panels.png", "cycle.png", "sway.png"])
def test_a_figure_is_what_the_present_code_draws(name, drawing, root, tmp_path):
    """Drawn anew, it differs in no more than one pixel in a hundred: those at edges of lines."""
    image = pytest.importorskip("PIL.Image")
    drawing.PICTURES[name].draw(tmp_path / name)
    new, old = (np.asarray(image.open(place / name).convert("L"), int) for place in (tmp_path, root / "docs/pictures"))
    assert new.shape == old.shape
    assert np.mean(np.abs(new - old) > 32) < 0.01
