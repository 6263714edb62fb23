"""Building the report: its figures and its page are made in a folder of their own, and put in place when complete."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from icmj.base.files import make_scratch, write_bytes, write_text
from icmj.case.result import Result
from icmj.case.sweep_table import SweepTable
from icmj.report.abstract import abstract
from icmj.report.case_runs import CaseRuns, pair
from icmj.report.drawing import draw_case, name_failures
from icmj.report.headline import headline
from icmj.report.material import Material
from icmj.report.overview import describe_overview, overview_figure
from icmj.report.page import render_page
from icmj.report.picture import Drawing
from icmj.report.player import moving, script
from icmj.report.sections import SECTIONS
from icmj.report.statements import in_paper_order
from icmj.report.wording import describe_sway

if TYPE_CHECKING:
    from icmj.cycle.branch import Branch

Draw = Callable[[Sequence[CaseRuns], Path], None]
TITLE = "Limit cycles of event\N{NON-BREAKING HYPHEN}driven intermittent control"
SUBTITLE = "What the paper reports, what linear theory predicts, and what two simulated plants do"

BEYOND = "What linear theory predicts, and what two simulated plants do"
FOLLOWED = "Cycles of the event-driven loop as a parameter varies: where they exist, attract, change and end"
SWEPT = "What linear theory predicts and what simulated plants do, over a range of parameters"
RIVALS = "Standing under several controllers"
OTHERS = "Standing under other controllers"
MOVED = "How simulated plants move"
NOTHING = "Of these controllers no critical interval is predicted: their runs are shown without a prediction."


def build_report(
    results: Sequence[Result],
    out: Path,
    *,
    figures: Path | None = None,
    sweeps: Sequence[SweepTable] = (),
    branches: Sequence[Branch] = (),
    draw: Draw | None = None,
) -> None:
    """Build the comparison report: one self-contained HTML page, and each figure as PDF and SVG.

    Args:
        results: runs as read from logs; normally one on the linear plant and one in MuJoCo for each case. Angles
            are drawn in degrees, other outputs in the units of their plant. Runs without a prediction are shown after
            those with one, or alone.
        out: path of the page.
        figures: folder of the single figures; ``<stem>_figures`` in the folder of the page if ``None``.
        sweeps: sweeps as read from their folders, shown after the runs, or alone.
        branches: branches of cycles as read from their files, shown after runs and sweeps, or alone. Branches of one
            run file along one parameter share a figure, in which those of the linear plant are drawn below the others.
        draw: a function that draws the figures of all cases into a folder, see
            :func:`icmj.report.drawing.draw_case`; if ``None``, they are drawn one after the other.

    Raises:
        ReportError: if there are no results, sweeps or branches, two results of the same run, or the files cannot be
            written. In this case no page is left, except one that existed before.
    """
    others = [result for result in results if result.prediction is None]
    predicted = [result for result in results if result.prediction is not None]
    cases = in_paper_order(pair(predicted)) if predicted or not (sweeps or branches or others) else []
    out = Path(out)
    figures = out.with_name(f"{out.stem}_figures") if figures is None else Path(figures)
    with name_failures(cases, out):
        out.parent.mkdir(parents=True, exist_ok=True)
        with make_scratch(out) as staged:
            (draw or draw_all)(cases, staged)
            page = render(cases, staged, sweeps, branches, others)
            figures.mkdir(parents=True, exist_ok=True)
            for path in sorted(staged.iterdir()):
                write_bytes(figures / path.name, path.read_bytes())
            write_text(out, page)


def draw_all(cases: Sequence[CaseRuns], folder: Path) -> None:
    """Draw the figures of all cases into ``folder``."""
    for case in cases:
        draw_case(case, folder)


def _head(
    cases: Sequence[CaseRuns], sweeps: Sequence[SweepTable], branches: Sequence[Branch], alone: Sequence[Result]
) -> tuple[str, str]:
    """Title and subtitle, which say what the page is of."""
    if alone:
        titles = list(dict.fromkeys(run.run.title for run in alone))
        return (RIVALS, BEYOND) if cases else (titles[0] if len(titles) == 1 else OTHERS, MOVED)
    many = [case.first.run.title for case in cases]
    if cases:
        printed = any(case.first.run.case.paper.figure for case in cases)
        return many[0] if len(cases) == 1 else TITLE, SUBTITLE if printed else BEYOND
    many = list(dict.fromkeys([swept.title for swept in sweeps] + [branch.run.title for branch in branches]))
    if len(many) == 1:
        return many[0], SWEPT if sweeps else FOLLOWED
    return TITLE, f"{'; '.join(many[:3])}{' …' if len(many) > 3 else ''}"


def _motions(
    cases: Sequence[CaseRuns], others: Sequence[Result]
) -> tuple[dict[str, dict[str, Any]], dict[str, str], dict[str, str]]:
    """Motions that the page plays, by key, and these keys by case: of cases, and of runs without a prediction."""
    motions: dict[str, dict[str, Any]] = {}
    named: tuple[dict[str, str], dict[str, str]] = ({}, {})
    runs: list[tuple[dict[str, str], str, Result]] = [(named[0], case.name, case.last) for case in cases]
    runs += [(named[1], run.run.case.name, run) for run in others]
    for of, name, run in runs:
        found = moving(run)
        if found is not None and (name not in of or run.simulation.plant == "mujoco"):
            of[name] = of.get(name, f"run{len(motions)}")
            motions[of[name]] = found
    return motions, *named


def render(
    cases: Sequence[CaseRuns],
    folder: Path,
    sweeps: Sequence[SweepTable] = (),
    branches: Sequence[Branch] = (),
    alone: Sequence[Result] = (),
) -> str:
    """The page's HTML; the figures of the cases are in ``folder``, those of sweeps and branches are drawn into it."""
    motions, of_case, of_other = _motions(cases, alone)
    material = Material(folder, cases, alone, sweeps, branches, of_case, of_other)
    sections = [section for shelved in SECTIONS if (section := shelved.compose(material)) is not None]
    title, subtitle = _head(cases, sweeps, branches, alone)
    changes = {run.changes_in_words for run in [*(case.first.run for case in cases), *(run.run for run in alone)]}
    return render_page(
        sections,
        title=title,
        subtitle=subtitle,
        changes=changes.pop() if len(changes) == 1 else "",
        abstract=abstract(cases) if cases else NOTHING if alone and not (sweeps or branches) else "",
        first=_first(material, motions) if cases or alone else None,
        motions=script(motions) if motions else "",
        paper=bool(cases or sweeps or branches),
        source=" and ".join(
            word for word, given in (("logs", cases or alone), ("sweeps", sweeps), ("branches", branches)) if given
        ),
        beside="The figures are also available as PDF and SVG files in the folder beside this page.",
    )


def _first(material: Material, motions: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """The first screen: the sentence, the overview of the cases, and the body of most parts that settled on a cycle."""
    cases, named = material.cases, {**material.case_motions, **material.other_motions}
    drawn = narrow = None
    if cases:
        alt = "Predicted and measured open-loop interval of each case, and their relative errors"
        drawn = material.draw(Drawing("overview", alt, lambda: overview_figure(cases)))
        narrow = material.draw(Drawing("overview_narrow", alt, lambda: overview_figure(cases, narrow=True)))
    bodies = {name: motions[key]["body"] for name, key in named.items() if motions[key]["body"]}
    settled = {case.name for case in cases if any(c.measured.converged for c in case.comparisons.values())}
    best = max(bodies, key=lambda name: (name in settled, len(bodies[name]["shapes"])), default=None)
    return {
        "headline": headline(cases, material.others),
        "single": len(cases) == 1,
        "picture": drawn,
        "narrow": narrow,
        "caption": describe_overview(cases),
        "motion": best and named[best],
        "moving": best and motions[named[best]]["title"],
        "sway": "" if len(cases) == 1 else next((describe_sway(case.last) for case in cases if case.name == best), ""),
    }
