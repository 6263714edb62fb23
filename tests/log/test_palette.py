"""Colours of series are legible on either theme's ground, and told apart."""

import numpy as np
import pytest
from log_cases import made_up

from icmj.log import palette
from icmj.log.groups import list_groups

GROUNDS = {"dark": (13, 16, 17), "light": (255, 255, 255)}  # of the viewer's plots


def luminance(colour: tuple[int, ...]) -> float:
    """Relative luminance as WCAG 2 defines it."""
    c = np.array(colour[:3]) / 255
    return float([0.2126, 0.7152, 0.0722] @ np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4))


def contrast(a: tuple[int, ...], b: tuple[int, ...]) -> float:
    low, high = sorted((luminance(a), luminance(b)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("theme", GROUNDS)
def test_every_series_stands_out_on_the_ground_of_both_themes(theme: str) -> None:
    result, _ = made_up("three_link", 0.9, 0.7594, 6.0)
    seen = {g.path: g.colours for g in list_groups(result) if not g.path.endswith("/predicted")}
    assert {"trigger/threshold", "interval/delta_crit", "modes/gamma"} <= set(seen)
    for path, colours in {**seen, "series": palette.choose_colours(8)}.items():
        for colour in colours:
            assert contrast(colour, GROUNDS[theme]) >= 3.0, path  # WCAG 2, for graphics


def test_series_are_told_apart() -> None:
    colours = np.array([colour[:3] for colour in palette.choose_colours(8)])
    apart = np.linalg.norm(colours[:, None] - colours[None], axis=2)[np.triu_indices(8, 1)]
    assert apart.min() > 50
