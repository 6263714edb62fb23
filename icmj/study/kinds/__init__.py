"""The shelf of kinds of experiments: each in a file of its own, and their list.

To add one, write a file here and enter its name below, by which the table of an experiment file selects it. The file
defines ``KIND``, a class that inherits from :class:`icmj.study.kind.Kind`: its fields are the keys of the table, each
with its meaning under it, and its methods say what is done to a run file, what is recorded or read, what is computed
and drawn, and the words on it. What the analysis returns is a :class:`icmj.experiments.recording.Finding`. Help,
messages, JSON Schema, reference and first files follow.
"""

from icmj.base.catalogue import Catalogue

KINDS = Catalogue(
    __name__,
    (
        "quiet_standing",
        "perturbed_stance",
        "multisine",
        "double_step",
        "intersection_point",
    ),
)
"""The kinds, by the names of their files; the first is that of a first file where none is asked for."""
