"""``live/``: the live pages of the three-link person and the pendulum, made when the site is built."""

from __future__ import annotations

from pathlib import Path

from sphinx.application import Sphinx

PAGES = {"three-link": "three-link-0.9", "pendulum": "simple-0.8"}


def make_pages(app: Sphinx, exception: Exception | None) -> None:
    """Write a page for each, beside the pages that link to them."""
    if exception is not None or app.builder.format != "html":
        return
    import icmj

    folder = Path(app.outdir) / "live"
    folder.mkdir(exist_ok=True)
    for page, run in PAGES.items():
        icmj.build_live(icmj.prepare(icmj.load_run(run)), folder / f"{page}.html")


def setup(app: Sphinx) -> dict[str, bool]:
    """Make them when everything else is there."""
    app.connect("build-finished", make_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
