"""The shelf of event rules without memory: each in a file of its own, and their list.

To add one, write a file here and enter its name below, by which a run file selects it. The file defines ``RULE``, a
frozen dataclass that inherits from :class:`icmj.controller.trigger.EventRule`, and ``from_keys``, a function that makes
it of the design, of Δ_min, and of the keys of ``[controller]`` that are the rule's own: its other parameters, each with
a bound and a default, and described under ``Args``. A key that is required has the default ``None``. Theory, both
simulations, logs and reports ask nothing else; a rule with memory is a :class:`icmj.controller.law.Law`.
"""

from icmj.base.catalogue import Catalogue
from icmj.controller.trigger import Trigger

RULES = Catalogue(
    __name__,
    (
        "quadratic",
        "box",
    ),
)
"""The rules, by the names of their files; the first is that of a run file which names none."""


def name_of(trigger: Trigger) -> str | None:
    """The name by which a run file selects a rule of this class; ``None`` if it is none of this shelf."""
    return next((name for name in RULES.names if RULES[name].RULE is type(trigger)), None)
