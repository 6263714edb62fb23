"""The fit of families of controllers to recordings of standing people: an add-on, which nothing else imports.

It is found by three lists alone: its command (:mod:`icmj.cli.commands`), its kind of file
(:mod:`icmj.study.file_kinds`) and its shipped families (:mod:`icmj.work.shipped`).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
