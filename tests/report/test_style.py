"""The style: legible for colour-blind readers and in grey, and gone when the block ends."""

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_rgb

from icmj.report import style

# Machado, Oliveira & Fernandes (2009), severity 1.0, for linear RGB
DEFICIENCIES = {
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
LINES = {
    "predicted": style.PREDICTED["color"],
    "linear": style.LINEAR["color"],
    "mujoco": style.MUJOCO["color"],
    "continuous": style.CONTINUOUS["color"],
}


def linear_rgb(colour):
    c = np.array(to_rgb(colour))
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def lab(rgb):
    """CIE L*a*b* (D65) of linear RGB."""
    M = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
    )
    xyz = M @ np.clip(rgb, 0, 1) / [0.95047, 1.0, 1.08883]
    f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("deficiency", [None, *DEFICIENCIES])
def test_lines_are_told_apart_without_full_colour_vision(deficiency):
    M = np.eye(3) if deficiency is None else np.array(DEFICIENCIES[deficiency])
    seen = {name: lab(M @ linear_rgb(colour)) for name, colour in LINES.items()}
    names = list(seen)
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            assert np.linalg.norm(seen[a] - seen[b]) > 20, (deficiency, a, b)  # 2.3 is just noticeable


def test_overlaid_lines_differ_in_width_and_in_grey():
    widths = [look["linewidth"] for look in (style.PREDICTED, style.LINEAR, style.MUJOCO)]
    assert widths[0] > 1.8 * widths[1] > 3 * widths[2]
    lightness = [lab(linear_rgb(look["color"]))[0] for look in (style.PREDICTED, style.LINEAR, style.MUJOCO)]
    assert lightness[0] - lightness[1] > 10
    assert lightness[1] - lightness[2] > 10


def test_settings_come_back():
    before = dict(matplotlib.rcParams)
    with style.apply():
        assert matplotlib.rcParams["font.family"] == ["STIXGeneral"]
    assert dict(matplotlib.rcParams) == before


def test_no_setting_of_somebody_else_reaches_a_figure_of_the_report():
    """Text by LaTeX, which a matplotlibrc may ask for, ended the report where there is none."""
    with style.apply():
        usual = dict(matplotlib.rcParams)
    with matplotlib.rc_context(
        {"text.usetex": True, "axes.grid": True, "figure.autolayout": True, "lines.marker": "o"}
    ):
        with style.apply():
            assert dict(matplotlib.rcParams) == usual
        assert matplotlib.rcParams["text.usetex"]


def test_axes_keep_their_margins():
    for rows in (1, 2, 3):
        figure, axes = style.new_figure(style.TALL, rows)
        assert len(axes) == rows
        left = [item.get_position().x0 * style.WIDTH for item in axes]
        assert left == pytest.approx([13.0] * rows)
        assert axes[-1].get_position().y0 * style.TALL == pytest.approx(9.0)
        assert figure.get_size_inches() * 25.4 == pytest.approx([style.WIDTH, style.TALL])


def test_pdf_has_editable_text():
    with style.apply():
        figure, (axes,) = style.new_figure()
        axes.set_xlabel("time")
        assert b"/TrueType" in style.save(figure, "pdf") or b"/Type0" in style.save(figure, "pdf")
