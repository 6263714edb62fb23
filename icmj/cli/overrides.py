"""``--set KEY=VALUE`` for every command that reads run files: a mix-in of their arguments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro


@dataclass(frozen=True, kw_only=True)
class Overrides:
    """Values of the run file changed for once; :func:`icmj.runfile.overrides.overridden` puts them in."""

    set: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="KEY=VALUE")] = ()
    """A value in place of the run file's, its key dotted: --set actual.gain=0.85. May be given again and again."""
    allow_code: bool = False
    """Run Python code that the run file names as module:name. Read it first."""
