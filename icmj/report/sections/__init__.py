"""The sections of the page, each a function from the cases to a heading, a template and what it prints."""

from icmj.report.sections.figures import figures, law
from icmj.report.sections.first import caption, headline
from icmj.report.sections.noise import noise
from icmj.report.sections.section import DrawnPanel, Picture, Section
from icmj.report.sections.settings import designs, matrix, rule_fact, settings
from icmj.report.sections.statements import statements
from icmj.report.sections.summary import abstract, agrees_with_paper, summary
from icmj.report.sections.sweeps import attractors, branches, numbered, sweeps
from icmj.report.sections.tried import rivals, tried

__all__ = [
    "DrawnPanel",
    "Picture",
    "Section",
    "abstract",
    "agrees_with_paper",
    "attractors",
    "branches",
    "caption",
    "designs",
    "figures",
    "headline",
    "law",
    "matrix",
    "noise",
    "numbered",
    "rivals",
    "rule_fact",
    "settings",
    "statements",
    "summary",
    "sweeps",
    "tried",
]
