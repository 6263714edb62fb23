"""``{facts} NAME``: the table of the facts of a prediction, a run, an exact cycle, or a run without a prediction."""

from __future__ import annotations

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from icmj.base.numbers import Fact
from icmj.case.comparison import RUN
from icmj.study.chunk import CYCLE, WITHOUT_PREDICTION
from icmj.theory.prediction import PREDICTION

TABLES = {
    "prediction": (PREDICTION, "predicted", "predicted", "predicted"),
    "run": (RUN, "measured", "PLANT", "measured"),
    "cycle": (CYCLE, "", "PLANT_cycle", ""),
    "run-without-prediction": (WITHOUT_PREDICTION, "", "PLANT", ""),
}
"""The facts, and under what they stand in ``summary.json``, in the columns of a sweep, and in a log; "" if nowhere."""


def tabulate_facts(name: str) -> list[str]:
    """The lines of a table of Markdown: meaning, unit and names of each fact."""
    facts, record, column, logged = TABLES[name]
    head = ["meaning", "unit", *(["`summary.json`"] if record else []), "sweep", *(["log"] if logged else [])]
    return [_row(head), _row(["---"] * len(head)), *(_row(_cells(fact, record, column, logged)) for fact in facts)]


def _cells(fact: Fact, record: str, column: str, logged: str) -> list[str]:
    """What stands in the row of a fact."""
    each = "_OUTPUT" if fact.kind == "outputs" else ""
    places = ((record, ".", fact.key("record"), ""), (column, "_", fact.key("column"), each))
    names = [
        f"`{under}{joint}{key}{end}`" if key else ""
        for under, joint, key, end in (*places, (logged, ".", fact.key("logged"), each))
        if under
    ]
    return [fact.meaning, "of the output" if each else fact.unit, *names]


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


class FactsTable(SphinxDirective):
    """A row for each fact of the table that the argument names."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        holder = nodes.section()
        holder.document = self.state.document
        self.state.nested_parse(StringList(tabulate_facts(self.arguments[0]), "facts"), self.content_offset, holder)
        return holder.children


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the directive to Sphinx."""
    app.add_directive("facts", FactsTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
