"""The style of the figures of examples, in the gallery and in pictures: that of all others."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl

import icmj

OWN = ("figure.figsize", "savefig.dpi")  # an example says how large its figure is


def figure_style() -> dict[str, Any]:
    """Settings of matplotlib for figures of about nine inches, shown as wide as the text of a page."""
    return {key: value for key, value in icmj.plots.style(size=11).items() if key not in OWN}


def apply_style(gallery_conf: dict[str, Any], name: str) -> None:
    """Before an example runs, after matplotlib's own settings have come back."""
    mpl.rcParams.update(figure_style())
