"""The shelf of controllers that are not intermittent: their tables, each in a file of its own, and their list.

To add one, write a file here and enter its name below. The file defines ``TABLES``, the tables that
``[controller] kind`` selects, each of which inherits from :class:`icmj.runfile.control_tables.ControllerTable` and
makes in ``law`` its controller of what it is given; and ``LAWS``, the classes of which such a controller is made, as
dataclasses that a log stores. The controller itself is a :class:`icmj.controller.law.Law`, on the floor of
controllers. Keys that are those of a dataclass come from it (:func:`icmj.runfile.table.keys_of`).
"""

from icmj.base.catalogue import Catalogue

CONTROLLERS = Catalogue(
    __name__,
    (
        "predictor",
        "switching",
        "delayed_pid",
        "own_controller",
    ),
)
"""The controllers, by the names of their files."""
