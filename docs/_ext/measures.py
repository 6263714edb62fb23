"""``{measures}``: the table of definitions, read out of the measures of sway."""

from __future__ import annotations

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from icmj.measurement.measures import tabulate_definitions


class MeasuresTable(SphinxDirective):
    """A row for each definition of each measure."""

    def run(self) -> list[nodes.Node]:
        holder = nodes.section()
        holder.document = self.state.document
        self.state.nested_parse(StringList(tabulate_definitions(), "measures"), self.content_offset, holder)
        return holder.children


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the directive to Sphinx."""
    app.add_directive("measures", MeasuresTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
