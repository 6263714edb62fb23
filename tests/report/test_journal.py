"""Figures for a journal: sizes in millimetres, fonts that are embedded as TrueType, legends that hide nothing."""

import re
import zlib

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from report_cases import result

import icmj
from icmj.errors import ReportError

PLOTS = icmj.plots
BOTH = [result("b0.8", plant) for plant in ("linear", "mujoco")]


def fonts_of(pdf: bytes) -> set[bytes]:
    """Subtypes of every font in a PDF, also in compressed object streams."""
    inside = [pdf]
    for found in re.finditer(rb"stream\r?\n(.*?)\r?\nendstream", pdf, re.S):
        try:
            inside.append(zlib.decompress(found[1]))
        except zlib.error:
            continue
    return set(re.findall(rb"/Subtype\s*/(Type0|Type1|Type3|TrueType|CIDFontType2)\b", b"\n".join(inside)))


def test_a_figure_saved_in_the_style_has_embedded_truetype_fonts_and_the_width_of_a_column(tmp_path):
    with PLOTS.style(columns=1):
        figure = Figure()
        PLOTS.phase(figure.subplots(), *BOTH)
        figure.savefig(tmp_path / "phase.pdf")
    pdf = (tmp_path / "phase.pdf").read_bytes()
    assert b"CIDFontType2" in fonts_of(pdf)
    assert b"Type3" not in fonts_of(pdf)
    box = re.search(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+)", pdf)
    assert float(box[1]) == pytest.approx(85 / 25.4 * 72, abs=0.01)
    figure = Figure()  # matplotlib's default, which the style is for
    PLOTS.phase(figure.subplots(), *BOTH)
    figure.savefig(tmp_path / "other.pdf")
    assert b"Type3" in fonts_of((tmp_path / "other.pdf").read_bytes())


def test_the_style_holds_within_its_block_alone_and_may_be_nested():
    before = dict(matplotlib.rcParams)
    style = PLOTS.style(2, height=100, size=7, font="DejaVu Sans")
    with style, PLOTS.style(1), style:
        assert matplotlib.rcParams["figure.figsize"] == pytest.approx([174 / 25.4, 100 / 25.4])
        assert matplotlib.rcParams["font.size"] == 7
    assert dict(matplotlib.rcParams) == before
    with matplotlib.rc_context():
        matplotlib.rcParams.update(style)
        assert matplotlib.rcParams["pdf.fonttype"] == 42


@pytest.mark.parametrize("wrong", [{"columns": 3}, {"width": 0}, {"height": -1}, {"size": np.nan}, {"width": np.inf}])
def test_a_figure_that_cannot_be_is_refused_in_one_line(wrong):
    with pytest.raises(ReportError):
        PLOTS.style(**wrong)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["b0.8", "three-link", "exact"])
def test_the_six_panels_are_one_figure_whose_legends_hide_no_axes(name, tmp_path):
    figure = PLOTS.panels(*(result(name, plant) for plant in ("linear", "mujoco")))
    figure.savefig(tmp_path / "six.pdf")  # outside of every block
    assert b"Type3" not in fonts_of((tmp_path / "six.pdf").read_bytes())
    assert len(figure.subfigs) == 6
    for letter, place in zip("abcdef", figure.subfigs, strict=True):
        drawn = [text.get_text() for text in place.texts] + [place.get_suptitle()]
        assert f"({letter})" in drawn
        assert place.axes
        assert all(axes.has_data() for axes in place.axes)
        for legend in place.legends:
            box = legend.get_window_extent()
            assert not any(box.overlaps(axes.get_window_extent()) for axes in place.axes)
            assert box.x0 >= place.bbox.x0
            assert box.y1 <= place.bbox.y1 + 1
    assert sum(len(place.legends) for place in figure.subfigs) >= 5
    assert figure.get_size_inches()[0] == pytest.approx(174 / 25.4)


@pytest.mark.parametrize(
    "function", ["modulus", "locus", "output", "phase", "intervals", "critical_mode", "other_modes"]
)
def test_a_function_returns_its_axes_and_its_legend_lies_above_them(function):
    with PLOTS.style(1):
        figure = Figure()
        axes = figure.subplots()
        assert getattr(PLOTS, function)(axes, *BOTH) is axes
        figure.draw_without_rendering()
        legend, data = axes.get_legend().get_window_extent(), axes.get_window_extent()
    assert legend.y0 >= data.y1
    assert legend.x1 <= figure.bbox.x1
    assert legend.y1 <= figure.bbox.y1
