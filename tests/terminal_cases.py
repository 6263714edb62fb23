"""What commands say, as tests read it."""

import re

_SIGN = re.compile(r"^icmj: ([^;]* after \d+ s(, about .* left)?|about .* of work)$")


def told(err: str) -> list[str]:
    """The lines of an error stream, without signs of life, of which a busy machine has some and an idle one none."""
    return [line for line in err.splitlines() if not _SIGN.search(line)]
