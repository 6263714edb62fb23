"""The sections of the page, each a function from the cases to a heading, a template and what it prints."""

from icmj.report.sections.controllers import others as others
from icmj.report.sections.controllers import rivals as rivals
from icmj.report.sections.figures import figures as figures
from icmj.report.sections.figures import law as law
from icmj.report.sections.first import caption as caption
from icmj.report.sections.first import headline as headline
from icmj.report.sections.noise import noise as noise
from icmj.report.sections.section import DrawnPanel as DrawnPanel
from icmj.report.sections.section import Picture as Picture
from icmj.report.sections.section import Section as Section
from icmj.report.sections.settings import designs as designs
from icmj.report.sections.settings import matrix as matrix
from icmj.report.sections.settings import rule_fact as rule_fact
from icmj.report.sections.settings import settings as settings
from icmj.report.sections.statements import statements as statements
from icmj.report.sections.summary import abstract as abstract
from icmj.report.sections.summary import agrees_with_paper as agrees_with_paper
from icmj.report.sections.summary import summary as summary
from icmj.report.sections.sweeps import attractors as attractors
from icmj.report.sections.sweeps import branches as branches
from icmj.report.sections.sweeps import numbered as numbered
from icmj.report.sections.sweeps import sweeps as sweeps
