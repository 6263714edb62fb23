"""What commands say, as tests read it."""

import json
import re
from typing import Any

_SIGN = re.compile(r"^icmj: ([^;]* after \d+ s(, about .* left)?|about .* of work)$")


def told(err: str) -> list[str]:
    """The lines of an error stream, without signs of life, of which a busy machine has some and an idle one none."""
    return [line for line in err.splitlines() if not _SIGN.search(line)]


class Shell:
    """icmj's command line, as pytest's ``capsys`` hears it; what was said before and not read comes first."""

    def __init__(self, capsys: Any) -> None:
        self._capsys = capsys

    def says(self, words: list[str]) -> str:
        """The output of a command that does what is asked for."""
        return self._run(words, 0).out

    def answers(self, words: list[str]) -> Any:
        """Its output as JSON."""
        return json.loads(self.says(words))

    def refuses(self, words: list[str]) -> str:
        """The error stream of a command that ends with status 2."""
        return self._run(words, 2).err

    def _run(self, words: list[str], status: int) -> Any:
        from icmj.cli.main import main

        assert main(words) == status
        return self._capsys.readouterr()
