"""The report as files: self-contained, complete or not there."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from xml.etree import ElementTree

import pytest
from report_cases import CASES, PAPER_PANELS, result, run_text, whole_report

from icmj import build_report, parse_run
from icmj.errors import ReportError

pytestmark = pytest.mark.slow  # every figure of every case is drawn


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    return whole_report(tmp_path_factory.getbasetemp())


class Reader(HTMLParser):
    VOID = frozenset({"meta", "link", "img", "source", "br", "hr"})

    def __init__(self):
        super().__init__()
        self.open, self.images, self.ids, self.links, self.text = [], [], [], [], []
        self.references = []

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        if tag not in self.VOID:
            self.open.append(tag)
        if attrs.get("role") == "img":
            self.images.append(attrs)
        if "id" in attrs:
            self.ids.append(attrs["id"])
        if tag == "a":
            self.links.append(attrs["href"])
        self.references += [attrs[name] for name in ("src", "href") if name in attrs]
        assert tag != "script" or set(attrs) <= {"type", "id"}  # none is fetched

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("style", "script"):
            self.text.append(data)


@pytest.fixture(scope="module")
def page(report):
    reader = Reader()
    reader.feed((report / "report.html").read_text(encoding="utf-8"))
    return reader


def test_page_is_well_formed_and_its_links_lead_somewhere(page):
    assert page.open == []
    assert len(page.ids) == len(set(page.ids))
    assert page.links
    assert {link.removeprefix("#") for link in page.links} <= set(page.ids)


def test_page_needs_no_network(report, page):
    assert all(reference.startswith(("data:", "#")) for reference in page.references)
    css = "".join(re.findall(r"<style>(.*?)</style>", (report / "report.html").read_text(encoding="utf-8"), re.S))
    assert "url(" not in css.replace("url(#", "")
    assert "@import" not in css
    assert "http" not in css


def test_every_panel_of_every_case_is_in_the_page_with_words(page):
    assert len(page.images) == len(CASES) * len(PAPER_PANELS) + 3  # the overview at two widths, and one amplitude law
    for image in page.images:
        assert len(image["aria-label"]) > 20


def test_the_page_is_small(report):
    """Of eleven cases 1.5 MB: letters of all figures stand in it once."""
    figures = sum(path.stat().st_size for path in (report / "report_figures").glob("*.svg"))
    assert 5 * ((report / "report.html").stat().st_size - 2**18) < figures  # and a quarter of a megabyte of text


def test_every_figure_is_saved_as_pdf_and_svg(report):
    folder = report / "report_figures"
    names = {f"{case}_{letter}" for case in CASES for letter in "abcdef"}
    names |= {"three-link_law", "overview", "overview_narrow"}
    assert {path.name for path in folder.iterdir()} == {f"{name}.{kind}" for name in names for kind in ("svg", "pdf")}
    for name in names:
        root = ElementTree.parse(folder / f"{name}.svg").getroot()
        assert root.tag.endswith("svg")
        assert len(list(root.iter())) > 50
        data = (folder / f"{name}.pdf").read_bytes()
        assert data.startswith(b"%PDF")
        assert data.rstrip().endswith(b"%%EOF")


def test_summary_comes_first_and_figures_are_numbered(page):
    text = " ".join("".join(page.text).split())
    assert text.index("Table 1.") < text.index("Figure 1.")
    for n in range(1, len(CASES) + 2):
        assert text.count(f"Figure {n}.") == 1
    assert "Δ_" not in text
    assert "None" not in text
    assert not re.search(r"\bnan\b", text, re.I)


def test_the_same_results_give_the_same_page(tmp_path):
    results = [result("b0.8"), result("b0.8", "mujoco")]
    for name in ("one", "two"):
        build_report(results, tmp_path / name / "report.html")
    assert (tmp_path / "one/report.html").read_bytes() == (tmp_path / "two/report.html").read_bytes()


def test_nothing_but_page_and_figures_is_left(report):
    assert {path.name for path in report.iterdir()} == {"report.html", "report_figures"}


def test_figures_go_where_told(tmp_path):
    build_report([result("exact")], tmp_path / "r.html", figures=tmp_path / "elsewhere")
    assert len(list((tmp_path / "elsewhere").iterdir())) == 2 * (len(PAPER_PANELS) + 2)
    assert not (tmp_path / "r_figures").exists()


def test_a_failure_leaves_the_old_page_alone(tmp_path, monkeypatch):
    out = tmp_path / "report.html"
    out.write_text("old")

    def fail(case):
        raise RuntimeError("no panel")

    from icmj.report.panels import critical_mode

    monkeypatch.setattr(critical_mode, "PANEL", replace(critical_mode.PANEL, drawing=fail))
    with pytest.raises(RuntimeError, match="no panel"):
        build_report([result("b0.8")], out)
    assert out.read_text() == "old"
    assert list(tmp_path.iterdir()) == [out]


def test_no_results_write_nothing_and_an_unusable_place_is_named(tmp_path):
    with pytest.raises(ReportError, match="at least one log"):
        build_report([], tmp_path / "new" / "report.html")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ReportError, match="file"):
        build_report([result("b0.8")], tmp_path / "file" / "report.html")


def test_titles_are_text_not_markup(tmp_path):
    text = run_text("b0.8").replace("Simple system, b = 0.8", "<img src=x onerror=alert(1)> & co")
    build_report([replace(result("b0.8"), run=parse_run(text))], tmp_path / "r.html")
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "<img src=x" not in page
    assert "&lt;img src=x onerror=alert(1)&gt; &amp; co" in page
