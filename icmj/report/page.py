"""A page: one self-contained file of HTML, made of sections, a head and a foot by the templates."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from typing import TYPE_CHECKING, Any

from icmj.base import VERSION
from icmj.report.notation import SYMBOLS, notation, unbroken
from icmj.report.player import join_scripts
from icmj.report.section import Section
from icmj.report.shared_vectors import SharedVectors

if TYPE_CHECKING:
    from jinja2 import Environment


def make_environment(**options: Any) -> Environment:
    """Where templates of pages are found, which escape what they are given and miss nothing quietly."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    templates = PackageLoader("icmj.report", "templates")
    return Environment(
        loader=templates, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, **options
    )


def render_page(parts: Sequence[Section], **said: Any) -> str:
    """The page's HTML from its sections, its head (``title``, ``subtitle``, ``findings``, ``abstract`` …) and its foot.

    The foot says ``source``, what the page was built from, and ``beside``, where its figures lie; it names Gawthrop's
    paper if ``paper``. A template prints a picture as ``picture|drawn``.
    """
    environment = make_environment(finalize=unbroken)
    vectors = SharedVectors()
    environment.filters["notation"] = notation
    environment.filters["drawn"] = lambda picture: vectors.take(picture.svg, picture.alt)
    environment.globals["share_vectors"] = vectors.share
    environment.globals["symbols"] = SYMBOLS
    environment.globals["scripts"] = join_scripts
    environment.globals["next_table"], environment.globals["next_figure"] = count(1).__next__, count(1).__next__
    usual = {
        "kicker": "Comparison report", "changes": "", "abstract": "", "findings": (), "first": None, "motions": "",
        "paper": False,
    }  # fmt: skip
    bodies = [(section, environment.from_string(section.template)) for section in parts]
    return environment.get_template("page.html.j2").render(sections=bodies, version=VERSION, **{**usual, **said})
