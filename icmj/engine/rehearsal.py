"""A model's rehearsal: it is parsed, copied, compiled, computed and saved once in a separate process, with limits.

A model can end the process that compiles it: one that attaches itself overflows the stack. Here that is the end of a
process that nobody needs. It calls the library itself and imports no package, which takes a few hundredths of a second.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import mujoco

from icmj.base.bounded_program import run_bounded
from icmj.base.text import one_line
from icmj.engine.library import find_library
from icmj.errors import ModelError

SECONDS, BYTES = 10, 4 << 30  # of processor time, of memory
PATIENCE = 120  # s on the clock: twelve processes to a core, and a model is still not refused for what others compute
REFUSED = 3  # the status where MuJoCo refuses the model in an orderly way
STACK = 4 << 20  # bytes: half of what is usual, so that what just passes here passes where the stack is in use, too

_ENDED = [-getattr(signal, name) for name in ("SIGKILL", "SIGXCPU") if hasattr(signal, name)]
_PROGRAM = """
import ctypes, os, signal, sys
try:
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)
except (OSError, AttributeError, TypeError):
    pass
engine = ctypes.CDLL(sys.argv[1])
plugins = [ctypes.CDLL(path) for path in sys.argv[4:]]
class Config(ctypes.Structure):
    _fields_ = [("c", ctypes.c_bool), ("f", ctypes.c_bool), ("name", ctypes.c_char * 1024), ("topics", ctypes.c_int)]
engine.mju_setLogConfig.argtypes = [Config]
engine.mju_setLogConfig(Config())
def end(words):
    os.write(2, words or b"no message")
    os._exit(int(sys.argv[3]))
def call(name, *arguments):
    function = getattr(engine, name)
    function.restype = ctypes.c_void_p
    return function(*(ctypes.c_void_p(a) if isinstance(a, int) and a > 9 else a for a in arguments))
given_up = ctypes.CFUNCTYPE(None, ctypes.c_char_p)(end)
ctypes.c_void_p.in_dll(engine, "mju_user_error").value = ctypes.cast(given_up, ctypes.c_void_p).value
said = ctypes.create_string_buffer(1000)
spec = call("mj_parse", os.fsencode(sys.argv[2]), None, None, said, 1000) or end(said.value)
model = call("mj_compile", spec, None)
if not model:
    engine.mjs_getError.restype = ctypes.c_char_p
    end(engine.mjs_getError(ctypes.c_void_p(spec)))
data = call("mj_makeData", model) or end(b"out of memory")
for key in range(-1, 3):
    call("mj_resetDataKeyframe", model, data, key)
    call("mj_forward", model, data)
text = ctypes.create_string_buffer(1 << 20)
call("mj_saveXMLString", spec, text, 1 << 20, said, 1000)
call("mj_copySpec", spec)
os._exit(0)
"""


def rehearse(path: Path) -> None:
    """Check that loading a model does not crash, stall or exhaust the memory of the process.

    What MuJoCo refuses in an orderly way is not told here, but where it is loaded: there it may know more plugins.

    Raises:
        ModelError: if it does.
    """
    given = str(find_library()), os.path.abspath(path), str(REFUSED), *_plugins()
    command = [sys.executable, "-I", "-S", "-c", _PROGRAM, *given]
    too_much = f"{path}: compiling the model takes more than {SECONDS} s or {BYTES >> 30} GB; make it smaller"
    try:
        done = run_bounded(command, PATIENCE, processor=SECONDS, addresses=BYTES, stack=STACK)
    except subprocess.TimeoutExpired as error:
        raise ModelError(too_much) from error
    said = one_line(done.stderr, 300)
    if done.returncode in _ENDED or any(word in said.lower() for word in ("memory", "alloc", "unknown exception")):
        raise ModelError(too_much + (f" ({said})" if said else ""))
    if done.returncode not in (0, REFUSED):
        raise ModelError(
            f"{path}: MuJoCo's compiler breaks down on this model (status {done.returncode}); see that it neither "
            "attaches nor includes itself, and is not nested too deeply"
        )


def _plugins() -> list[str]:
    """The plugins that MuJoCo's bindings load by themselves."""
    folder = Path(mujoco.PLUGINS_DIR)
    return [str(file) for file in sorted(folder.rglob("*")) if file.suffix in (".so", ".dylib", ".dll")]
