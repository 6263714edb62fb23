"""What a second ``icmj run`` does, counted in a process of its own: no clock, so the same on any machine.

    python -m benchmarks.second_run            the shipped three-link case
    python -m benchmarks.second_run FILE ...   the command's other words after ``run``

- *models compiled*: calls of ``MjSpec.compile``, and models that MuJoCo loads from XML;
- *hand-overs*: calls from one function of icmj to the next, from the program's entry to the numbers of the composed
  model (:func:`icmj.engine.block.pack`), on the longest way there;
- *modules entered*, *functions entered*: of icmj, apart from what runs as a module is imported.
"""

import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
CASE = ROOT / "runs" / "three-link-0.9.toml"
MOST = {"models compiled": 3.0, "hand-overs": 10.0, "functions entered": 1200.0}
_FUNCTION = 1  # CO_OPTIMIZED: the code of a function, not of a module or a class


def count(words: Sequence[str] = (str(CASE),)) -> dict[str, int]:
    """The counts of ``icmj run`` with these words, by what is counted."""
    with tempfile.TemporaryDirectory() as folder:
        told, rest = Path(folder) / "counts.json", [*words, "--out", folder, "--quiet"]
        for command in (["icmj.cli", "run"], ["benchmarks.second_run", "--inside", str(told)]):
            subprocess.run([sys.executable, "-m", *command, *rest], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
        return dict(json.loads(told.read_text(encoding="utf-8")))


def _inside(target: Path, words: Sequence[str]) -> int:
    """Run the command here and write what was counted to ``target``."""
    import mujoco

    import icmj
    from icmj.cli.main import main

    home = os.path.join(os.path.dirname(icmj.__file__), "")
    compiled: list[str] = []
    entered: set[CodeType] = set()
    longest = 0

    def ours(frame: FrameType | None) -> list[CodeType]:
        """The functions of icmj that are at work, the innermost first; nothing while a module is imported."""
        found = []
        while frame is not None:
            code = frame.f_code
            if code.co_filename.startswith(home):
                if not code.co_flags & _FUNCTION:
                    return []
                found.append(code)
            frame = frame.f_back
        return found

    def note(frame: FrameType, event: str, _: Any) -> None:
        nonlocal longest
        if event != "call" or not frame.f_code.co_filename.startswith(home):
            return
        code = frame.f_code
        if code in entered and code.co_name != "pack":
            return
        way = ours(frame)
        if not way:
            return
        entered.add(code)
        if code.co_name == "pack" and code.co_filename.endswith("block.py"):
            longest = max(longest, len(way) - 1)

    _count_calls(mujoco.MjSpec, "compile", compiled)
    for name in ("from_xml_path", "from_xml_string"):
        _count_calls(mujoco.MjModel, name, compiled)
    threading.setprofile(note)
    sys.setprofile(note)
    status = main(["run", *words])
    sys.setprofile(None)
    threading.setprofile(None)
    counts = {
        "models compiled": len(compiled),
        "hand-overs": longest,
        "modules entered": len({code.co_filename for code in entered}),
        "functions entered": len(entered),
    }
    target.write_text(json.dumps(counts), encoding="utf-8")
    return status


def _count_calls(of: Any, name: str, calls: list[str]) -> None:
    """Have every call of a method add its name to ``calls``."""
    original = getattr(of, name)

    def call(*arguments: Any, **named: Any) -> Any:
        calls.append(name)
        return original(*arguments, **named)

    setattr(of, name, call if name == "compile" else staticmethod(call))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--inside"]:
        sys.exit(_inside(Path(sys.argv[2]), sys.argv[3:]))
    for what, value in count(sys.argv[1:] or (str(CASE),)).items():
        print(f"{what:20}{value:6}" + (f"   at most {MOST[what]:g}" if what in MOST else ""))
