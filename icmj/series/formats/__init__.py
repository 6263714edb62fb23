"""The shelf of formats of recordings: each in a file of its own, and their list.

To add one, write a file here and enter its name below. The file defines ``SUFFIXES``, the ends of its files' names in
small letters, and ``read``, a function of the path, the file that is open for reading, the names of the signals that
are asked for (all, if none), and the rate that was said [Hz] or ``None``; it returns a tuple of
:class:`icmj.series.series.Series`, one for each trial, or raises DataError, ValueError or OSError with what is wrong.
A format that is written, too, defines ``write``, a function of a series and a path.
"""

from icmj.base.catalogue import Catalogue

FORMATS = Catalogue(
    __name__,
    (
        "csv",
        "parquet",
        "npz",
        "opensim",
        "c3d",
    ),
)
"""The formats, by the names of their files; the first is that of files with any other suffix."""
