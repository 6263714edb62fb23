"""The fit of families of controllers to recordings of standing people: an add-on, which commands alone import.

It is entered in lists: its command (:mod:`icmj.cli.commands`), its kind of file (:mod:`icmj.study.file_kinds`), its
shipped families (:mod:`icmj.work.shipped`) and the public names of icmj.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
