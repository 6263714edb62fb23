"""Building the page: draw the panels, fill the templates, put the files in place when they are complete."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base import VERSION
from icmj.base.files import make_scratch, write_bytes
from icmj.base.text import one_line
from icmj.case.result import Result, has_prediction
from icmj.case.sweep_table import SweepTable
from icmj.errors import ReportError
from icmj.report import many_runs, sections, style
from icmj.report.case_runs import CaseRuns, pair
from icmj.report.drawing import Drawing, draw_case, law_of, noise_of, panels_of, picture, save
from icmj.report.notation import SYMBOLS, notation, unbroken
from icmj.report.overview import overview_figure
from icmj.report.player import join_scripts, moving, script
from icmj.report.rivals import Rival, paths_figure, rivals, spectra_figure
from icmj.report.sections import DrawnPanel, Picture, Section, count_figures
from icmj.report.statements import in_paper_order
from icmj.report.wording import describe_sway

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
    others = [result for result in results if not has_prediction(result)]
    predicted = [result for result in results if has_prediction(result)]
    cases = in_paper_order(pair(predicted)) if predicted or not (sweeps or branches or others) else []
    out = Path(out)
    figures = out.with_name(f"{out.stem}_figures") if figures is None else Path(figures)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with make_scratch(out) as staged:
            (draw or draw_all)(cases, staged)
            page = render(cases, staged, sweeps, branches, others)
            (staged / out.name).write_text(page, encoding="utf-8")
            figures.mkdir(parents=True, exist_ok=True)
            for path in sorted(staged.iterdir()):
                if path.name != out.name:
                    write_bytes(figures / path.name, path.read_bytes())
            write_bytes(out, (staged / out.name).read_bytes())
    except OSError as error:
        raise ReportError(f"{error.filename or out}: the report cannot be written ({error.strerror})") from error
    except (np.linalg.LinAlgError, ArithmeticError) as error:
        names = ", ".join(case.name for case in cases)
        raise ReportError(
            f"the report of {names} cannot be drawn: numbers too far apart ({one_line(error)})"
        ) from error


def draw_all(cases: Sequence[CaseRuns], folder: Path) -> None:
    """Draw the figures of all cases into ``folder``."""
    for case in cases:
        draw_case(case, folder)


def render(
    cases: Sequence[CaseRuns],
    folder: Path,
    sweeps: Sequence[SweepTable] = (),
    branches: Sequence[Branch] = (),
    alone: Sequence[Result] = (),
) -> str:
    """The page's HTML; the figures of the cases are in ``folder``, those of sweeps and branches are drawn into it."""
    panels, laws, noisy = _pictures(cases, folder)
    motions, of_case, of_other = _motions(cases, alone)
    before = len(cases) + len(noisy) + len(laws)
    swept = many_runs.sweeps(sweeps, _maps(sweeps, folder), first_number=before + 1)
    grown = many_runs.branches(_group_branches(branches, folder), first_number=before + 1 + count_figures(swept))
    after = before + 1 + count_figures(swept) + count_figures(grown)
    controllers = _rivals(cases, alone, folder)
    beside = sections.rivals(controllers, after)
    others = sections.others(alone, _others(alone, folder), after + len(controllers), of_other)
    parts: list[Section | None] = [swept, grown, beside, others]
    if cases:
        parts = [
            sections.summary(cases),
            sections.statements(cases) if any(map(_is_about_the_paper, cases)) else None,
            sections.figures(cases, panels, of_case),
            sections.noise(cases, noisy, first_number=len(cases) + 1),
            sections.law(cases, laws, first_number=len(cases) + len(noisy) + 1),
            many_runs.attractors(cases),
            swept,
            grown,
            beside,
            others,
            sections.designs(cases),
            sections.settings(cases),
        ]
    title, subtitle = _head(cases, sweeps, branches, alone)
    changes = {run.changes_in_words for run in [*(case.first.run for case in cases), *(run.run for run in alone)]}
    return render_page(
        [part for part in parts if part is not None],
        title=title,
        subtitle=subtitle,
        changes=changes.pop() if len(changes) == 1 else "",
        abstract=sections.abstract(cases) if cases else NOTHING if alone and not (sweeps or branches) else "",
        first=_first(cases, alone, folder, of_case | of_other, motions) if cases or alone else None,
        motions=script(motions) if motions else "",
        paper=bool(cases or sweeps or branches),
        source=" and ".join(
            word for word, given in (("logs", cases or alone), ("sweeps", sweeps), ("branches", branches)) if given
        ),
        beside="The figures are also available as PDF and SVG files in the folder beside this page.",
    )


def _is_about_the_paper(case: CaseRuns) -> bool:
    paper = case.first.run.case.paper
    return bool(paper.figure or paper.note)


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


def render_page(parts: Sequence[Section], **said: Any) -> str:
    """The page's HTML from its sections, its head (``title``, ``subtitle``, ``findings``, ``abstract`` …) and its foot.

    The foot says ``source``, what the page was built from, and ``beside``, where its figures lie; it names Gawthrop's
    paper if ``paper``.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("icmj.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=unbroken,
    )
    environment.filters["notation"] = notation
    environment.globals["symbols"] = SYMBOLS
    environment.globals["scripts"] = join_scripts
    environment.globals["next_table"] = count(1).__next__
    usual = {
        "kicker": "Comparison report", "changes": "", "abstract": "", "findings": (), "first": None, "motions": "",
        "paper": False,
    }  # fmt: skip
    return environment.get_template("page.html.j2").render(sections=parts, version=VERSION, **{**usual, **said})


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


def _first(
    cases: Sequence[CaseRuns],
    others: Sequence[Result],
    folder: Path,
    named: Mapping[str, str],
    motions: Mapping[str, dict[str, Any]],
) -> dict[str, Any]:
    """The first screen: the sentence, the overview of the cases, and the body of most parts that settled on a cycle."""
    drawn = narrow = None
    if cases:
        with style.apply():
            alt = "Predicted and measured open-loop interval of each case, and their relative errors"
            drawn = _draw(overview_figure(cases), folder, "overview", alt)
            narrow = _draw(overview_figure(cases, narrow=True), folder, "overview_narrow", alt)
    bodies = {name: motions[key]["body"] for name, key in named.items() if motions[key]["body"]}
    settled = {case.name for case in cases if any(c.measured.converged for c in case.comparisons.values())}
    best = max(bodies, key=lambda name: (name in settled, len(bodies[name]["shapes"])), default=None)
    return {
        "headline": sections.headline(cases, others),
        "single": len(cases) == 1,
        "picture": drawn,
        "narrow": narrow,
        "caption": sections.caption(cases),
        "motion": best and named[best],
        "moving": best and motions[named[best]]["title"],
        "sway": "" if len(cases) == 1 else next((describe_sway(case.last) for case in cases if case.name == best), ""),
    }


def _pictures(
    cases: Sequence[CaseRuns], folder: Path
) -> tuple[dict[str, list[DrawnPanel]], dict[str, Picture], dict[str, tuple[Picture, Picture]]]:
    """Panels, amplitude laws, and figures under noise, by case, from the files in ``folder``."""
    panels: dict[str, list[DrawnPanel]] = {}
    laws: dict[str, Picture] = {}
    noisy: dict[str, tuple[Picture, Picture]] = {}
    for case in cases:
        panels[case.name] = [
            DrawnPanel(panel.letter, picture(folder, drawing), panel.caption(case))
            for panel, drawing in panels_of(case)
        ]
        if (law := law_of(case)) is not None:
            laws[case.name] = picture(folder, law)
        if (noise := noise_of(case)) is not None:
            noisy[case.name] = picture(folder, noise[0]), picture(folder, noise[1])
    return panels, laws, noisy


def _maps(sweeps: Sequence[SweepTable], folder: Path) -> dict[str, list[tuple[Picture, str]]]:
    """Pictures and captions of every sweep."""
    from icmj.report.sweep_pictures import pictures

    found = {}
    with style.apply():
        for swept in sweeps:
            try:
                found[swept.name] = [
                    (_draw(each.figure, folder, f"{swept.name}_{each.name}", each.caption), each.caption)
                    for each in pictures(swept)
                ]
            except (ValueError, ArithmeticError) as error:  # matplotlib's, of numbers near the ends of their range
                raise ReportError(f"sweep {swept.name!r} cannot be drawn ({one_line(error, 160)})") from error
    return found


def _group_branches(branches: Sequence[Branch], folder: Path) -> list[tuple[list[Branch], Picture]]:
    """Branches of one run file along one parameter, together, with their picture."""
    from icmj.report.branch import branch_figure

    groups: dict[tuple[str, str], list[Branch]] = {}
    for branch in branches:
        groups.setdefault((branch.run.case.name, branch.parameter), []).append(branch)
    found = []
    with style.apply():
        for (name, parameter), branches_of in groups.items():
            born = [branch for branch in branches_of if _is_born(branch, branches_of)]
            group = [*(branch for branch in branches_of if branch not in born), *born]
            beneath = [branch for branch in group if branch.plant == "linear"]
            above = [branch for branch in group if branch.plant != "linear"]
            figure = branch_figure(above or beneath, beneath if above else ())
            alt = f"{group[0].run.title}, cycles along {parameter}"
            found.append((group, _draw(figure, folder, f"{name}_along_{parameter.replace(':', '-')}", alt)))
    return found


def _is_born(branch: Branch, group: Sequence[Branch]) -> bool:
    """Whether a branch begins at a special point of another one."""
    points = [special.value for other in group if other is not branch for special in other.specials]
    return any(np.isclose(branch.value[0], value, rtol=1e-3) for value in points)


def _others(runs: Sequence[Result], folder: Path) -> dict[str, Picture]:
    """Outputs over time of every case under another controller."""
    from icmj.report.run_figure import run_figure

    cases: dict[str, list[Result]] = {}
    for run in runs:
        cases.setdefault(run.run.case.name, []).append(run)
    with style.apply():
        return {
            name: _draw(run_figure(same), folder, f"{name}_run", f"{same[0].run.title}, over time")
            for name, same in cases.items()
        }


def _rivals(
    cases: Sequence[CaseRuns], others: Sequence[Result], folder: Path
) -> list[tuple[list[Rival], tuple[Picture, Picture]]]:
    """Controllers of one body, with their spectra and paths."""
    found = []
    if others:
        runs = [result for case in cases for result in case.runs.values()]
        with style.apply():
            for n, group in enumerate(rivals([*runs, *others]), 1):
                spectra = _draw(spectra_figure(group), folder, f"controllers_{n}_spectra", "Spectra of the outputs")
                paths = _draw(paths_figure(group), folder, f"controllers_{n}_paths", "Rates against outputs")
                found.append((group, (spectra, paths)))
    return found


def _draw(figure: Figure, folder: Path, name: str, alt: str) -> Picture:
    name = re.sub(r"[^\w.+-]", "-", name).lstrip(".")  # a file may say anything
    save(figure, folder, name)
    return picture(folder, Drawing(name, alt, lambda: figure))
