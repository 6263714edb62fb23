"""The figures of one case: those of all sections, drawn into a folder, by a worker where there are several."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from icmj.base.text import one_line
from icmj.errors import ReportError
from icmj.report import style
from icmj.report.case_runs import CaseRuns
from icmj.report.picture import save
from icmj.report.sections import SECTIONS


def draw_case(case: CaseRuns, folder: Path) -> None:
    """Draw all figures of a case into ``folder``.

    Raises:
        ReportError: if numbers are too far apart to draw, or files cannot be written.
    """
    with name_failures([case], folder), style.apply():
        for list_drawings in SECTIONS.collect("list_drawings"):
            for drawing in list_drawings(case):
                save(drawing.draw(), folder, drawing.name)


@contextmanager
def name_failures(cases: Sequence[CaseRuns], out: Path) -> Iterator[None]:
    """Within the block, what keeps cases from being drawn, or ``out`` from being written, is said in one line.

    Raises:
        ReportError: with that line.
    """
    try:
        yield
    except (np.linalg.LinAlgError, ArithmeticError) as error:
        why = f"numbers too far apart ({one_line(error)})"
        names = ", ".join(case.name for case in cases)
        raise ReportError(f"the report of {names} cannot be drawn: {why}") from error
    except OSError as error:
        raise ReportError(f"{error.filename or out}: the report cannot be written ({error.strerror})") from error
