"""The material of a report: the runs, sweeps and branches that it is of, and the folder in which its figures lie."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from icmj.case.result import Result
from icmj.case.sweep_table import SweepTable
from icmj.report import style
from icmj.report.case_runs import CaseRuns
from icmj.report.picture import Drawing, Picture, name_file, save

if TYPE_CHECKING:
    from icmj.cycle.branch import Branch

_LINKED = re.compile(rb"<dc:description>([^<]*)<")


@dataclass(frozen=True)
class Material:
    """What a report is made of.

    Attributes:
        folder: where its figures lie; those of cases are drawn before the page is made.
        cases: those with a prediction, in the order of the page.
        others: runs without a prediction.
        sweeps: as read from their folders.
        branches: of cycles, as read from their files.
        case_motions, other_motions: the script's names of motions that the page plays, by case, of cases and of others.
    """

    folder: Path
    cases: Sequence[CaseRuns] = ()
    others: Sequence[Result] = ()
    sweeps: Sequence[SweepTable] = ()
    branches: Sequence[Branch] = ()
    case_motions: Mapping[str, str] = field(default_factory=dict)
    other_motions: Mapping[str, str] = field(default_factory=dict)

    def show(self, drawing: Drawing) -> Picture:
        """A figure of a case, which was drawn before."""
        svg = (self.folder / f"{drawing.name}.svg").read_bytes()
        linked = _LINKED.search(svg)
        return Picture(drawing.name, svg, drawing.alt, linked[1].decode() if linked else "")

    def draw(self, drawing: Drawing) -> Picture:
        """A figure that is drawn now."""
        drawing = replace(drawing, name=name_file(drawing.name))
        with style.apply():
            save(drawing.draw(), self.folder, drawing.name)
        return self.show(drawing)
