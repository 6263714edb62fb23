"""What examples of the gallery are to find: a page that was run and lacks it is a warning, and the build fails."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # what it lists is tested where Sphinx is not installed
    from sphinx.application import Sphinx

PROMISED = {
    "attraction": "the one before times 0.731",
    "backpack": "Settled on a period-1 cycle of 0.362",
    "ball_joint": "mujoco  first interval 0.3204",
    "deciding": "events – predictor                        1            1",
    "delay": "simple-0.8      1.8065",
    "disturbed_stance": "0.7592 s",
    "dm_control_model": "Settled on a period-1 cycle of 0.65768",
    "gymnasium_model": "Settled on a period-1 cycle of 0.61371",
    "lean": "-26.95 N m hold the lean",
    "muscle": "Settled on a period-1 cycle of 1.16",
    "own_plant": "Settled on a mirrored period-2 cycle of 2.24252 s",
    "rigid_person": "continuous, MuJoCo, 5.12 s: off by 0.37 % from 1 Hz on",
    "sway": "intersection point, mujoco: 0.0",
}


def list_broken(gallery: Path) -> Iterator[str]:
    """Pages of a gallery that show what an example printed, but not what it is to find."""
    for name, words in PROMISED.items():
        page = (gallery / f"{name}.rst").read_text(encoding="utf-8")
        # an example that misses a library says so: not every Python has all of them
        if "sphx-glr-script-out" in page and words not in page and "is not installed" not in page:
            yield f"examples/{name}.py does not print {words!r}"


def warn(app: Sphinx) -> None:
    """A warning for each."""
    from sphinx.util import logging

    for words in list_broken(Path(app.srcdir) / "gallery"):
        logging.getLogger(__name__).warning(words)


def setup(app: Sphinx) -> dict[str, bool]:
    """Look at the pages when the gallery has been made."""
    app.connect("builder-inited", warn, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
