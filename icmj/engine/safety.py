"""MuJoCo in this process: what it has once, its fatal errors, and model files that could crash it.

What MuJoCo has once for the process, icmj's own within a ``with`` block, and always restored: callbacks and messages.

The engine has one callback of each kind for the whole process, which it calls for every model, also while it compiles
one. What others have set is taken off before the first block is entered and put back when the last is left; in
between, the only callbacks are icmj's own, which are compiled and leave alone every model but the composed ones. So
blocks nest, and go on in any number of threads, with callbacks and without. Only where the code is interpreted are the
callbacks Python functions, which break the compiler: there a block is one thread's at a time, and the inner one wins.

MuJoCo prints its warnings and appends them to MUJOCO_LOG.TXT wherever it is run. What they say comes back as the
outcome of a run, or as an error. Outside the blocks, MuJoCo does for others what it always did.

MuJoCo's fatal errors, caught where compiled code calls the engine.

``mju_error`` must not return, and by default ends the process: too little arena memory for the contacts of a step is
enough. Python's bindings jump out of the call; compiled code cannot. So a call that may end so is made in a thread of
its own, which is parked for good where it fails, and the one who waits for it hears of the error. That costs a tenth
of a millisecond, so it is done only for models that can fail so: with constraints, or with hardly any memory.

A model's rehearsal: it is parsed, copied, compiled, computed and saved once in a separate process, with limits.

A model can end the process that compiles it: one that attaches itself overflows the stack. Here that is the end of a
process that nobody needs. It calls the library itself and imports no package, which takes a few hundredths of a second.

Checks for model files that would stall the compiler or crash the process.

Every model that does not come with icmj is compiled first in a process of its own (:mod:`icmj.engine.safety`), once
for each state of it and of the files that it refers to.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import re
import signal
import stat
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import cache
from html import unescape
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

import mujoco
import numpy as np

from icmj.base.blas_threads import SharedBlock, ignore_warnings
from icmj.base.bounded_program import run_bounded
from icmj.base.files import read_bytes
from icmj.base.process import INTERPRETED
from icmj.base.text import one_line
from icmj.errors import ModelError, SimulationError
from icmj.plant.linear_plant import LinearPlant
from icmj.work.shipped import MODELS


@contextmanager
def _alone() -> Iterator[None]:
    """MuJoCo without what others have set in it: silent, and without callbacks."""
    config = mujoco.MjLogConfig.get()
    console, file = config.logto_console, config.logto_file
    config.logto_console = config.logto_file = False
    config.set()
    callbacks = _take_callbacks()
    try:
        yield
    finally:
        _take_callbacks()
        for name, (function, address) in callbacks.items():
            getattr(mujoco, f"set_{name}")(function)
            _symbol(name).value = address
        config.logto_console, config.logto_file = console, file
        config.set()


def _take_callbacks() -> dict[str, tuple[Any, int]]:
    """Take all of MuJoCo's callbacks off, and return those that were set, as Python and as C has them."""
    found = {}
    for name in _CALLBACKS:
        if address := _symbol(name).value:
            found[name] = getattr(mujoco, f"get_{name}")(), address
            getattr(mujoco, f"set_{name}")(None)
            _symbol(name).value = None  # one that C has set is nothing to Python
    return found


_CALLBACKS = [name[4:] for name in dir(mujoco) if name.startswith(("get_mjcb_", "get_mju_user_warning"))]
_shared = _alone if INTERPRETED else SharedBlock(_alone)
_turn = threading.RLock() if INTERPRETED else nullcontext()


@contextmanager
def isolate_engine(control: object = None, act_dyn: object = None) -> Iterator[None]:
    """Have MuJoCo to icmj alone: no callbacks but these two, which are always the same two, and no messages.

    Whatever compiles a model or has the engine compute does so within.
    """
    with _turn, _shared():
        if control is not None:
            mujoco.set_mjcb_control(control)
            mujoco.set_mjcb_act_dyn(act_dyn)
        yield


T = TypeVar("T")
PLENTY = 1_000_000  # bytes of arena; MuJoCo takes thirteen times as much by itself
MORE = 'give the model more with <size memory="100M"/>'


class EngineFault(SimulationError):
    """MuJoCo raised a fatal error within a step."""


class _Call:
    """A call that runs in a separate thread."""

    def __init__(self) -> None:
        self.ended = threading.Event()
        self.value: object = None
        self.error: BaseException | None = None


_calls: dict[int, _Call] = {}
_installed = threading.Lock()


def can_fault(model: mujoco.MjModel) -> bool:
    """Whether a step of this model may run out of the engine's memory."""
    return not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONSTRAINT or model.narena < PLENTY


def guard(function: Callable[[], T]) -> T:
    """Run ``function()`` in a separate thread. Ctrl-C waits until it has returned.

    Raises:
        EngineFault: if MuJoCo gave up in it. Whatever the function works on stays half-done, and is kept for ever.
    """
    call = _Call()

    def work() -> None:
        _calls[threading.get_ident()] = call
        try:
            call.value = function()
        except BaseException as error:
            call.error = error
        finally:
            del _calls[threading.get_ident()]
            call.ended.set()

    _catch_errors()
    interrupt: BaseException | None = None
    threading.Thread(target=work, daemon=True).start()
    while not call.ended.is_set():
        try:
            call.ended.wait()
        except BaseException as error:  # a signal; the function still works on what the caller will read
            interrupt = error
    if interrupt is not None:
        raise interrupt
    if call.error is not None:
        raise call.error
    return call.value  # type: ignore[return-value]


def words(error: object) -> str:
    """MuJoCo's message in one line, with advice."""
    said = one_line(error, 200)
    return f"MuJoCo gave up: {said}; {MORE}" if "memory" in said or "stack" in said else f"MuJoCo gave up: {said}"


@ctypes.CFUNCTYPE(None, ctypes.c_char_p)
def _handle_failure(message: bytes) -> None:
    """MuJoCo's error handler: notify the waiting caller, and never return; bindings with their own do not call it."""
    call = _calls.get(threading.get_ident())
    text = message.decode(errors="replace") if message else "no message"
    if call is None:  # not one of ours: what MuJoCo does by default
        print(f"ERROR: {text}", file=sys.stderr, flush=True)
        os._exit(1)
    call.error = EngineFault(words(text))
    call.ended.set()
    while True:
        threading.Event().wait()


def library() -> Path:
    """MuJoCo's own library, that its bindings call."""
    folder = Path(mujoco.__file__).parent
    return next(iter([*folder.glob("libmujoco*"), *folder.glob("mujoco.dll")]))


@cache
def _symbol(name: str) -> ctypes.c_void_p:
    """A pointer to a function that MuJoCo's library has as a variable."""
    return ctypes.c_void_p.in_dll(ctypes.CDLL(str(library())), name)


def _catch_errors() -> None:
    """Register the handler with MuJoCo; a handler that was set by others is kept."""
    with _installed:
        handler = _symbol("mju_user_error")
        if not handler.value:
            handler.value = ctypes.cast(_handle_failure, ctypes.c_void_p).value


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
    given = str(library()), os.path.abspath(path), str(REFUSED), *_plugins()
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


MOST_BYTES = 20_000_000  # of one MJCF file
FOLDERS = 20  # of meshes and textures that are looked into
MOST = 1000  # sensor entries, actuators and states of a model
MOST_STATES, MOST_PORTS = 200, 200  # of a plant; eigenvalues of pairs are what becomes expensive
RESERVED = ("icmj_controller", "icmj_controller_joint")

OURS = (
    "b88537bb72b8948703a043b9c5282638e51f4f0f62d428ad705df229cedee8aa",
    "8dcc9d7d9d6732123aefd60918886c5558246826b3d3c212fecd1a2940266c3c",
    "63e54dd25e54e10d477ff28c3d72bc2afdc987c3fe1d25fa3f5997505ff9ad2f",
    "8126e451cb77a40a46381a441c2b294d32f558a81ae4c0b84d6f988a75280b86",
    "20a91e994bf10af4d9fcbe1ae22d09d257505514c9fd12af6c4ee4edfe23ebaf",
)
"""SHA-256 of the models that come with icmj: alone they are not tried first."""

_MODELS = re.compile(r"""<(?:include|model)\b[^>]*?\bfile\s*=\s*["']([^"']*)["']""")
_FILES = re.compile(r"""\bfile\w*\s*=\s*["']([^"']*)["']""")
_FOLDERS = re.compile(r"""\b(?:mesh|texture|asset)dir\s*=\s*["']([^"']*)["']""")
_STRIPPED = re.compile(r"""\bstrippath\s*=\s*["']true["']""")
_NO_UTF8 = re.compile("[\udc80-\udcff]")  # what "surrogateescape" makes of such bytes
_known_good: set[str] = set()


@contextmanager
def sound(path: Path) -> Iterator[None]:
    """Load and use the model of ``path`` within the block: tried first if need be, errors in one line, nothing printed.

    Raises:
        ModelError: if the file asks for what cannot be, or MuJoCo or linear algebra give up on it in the block.
    """
    examine(path)
    try:
        with isolate_engine(), ignore_warnings():  # by the compiler, of models that it takes all the same
            yield
    except mujoco.FatalError as error:
        raise ModelError(f"{path}: {words(error)}") from error
    except MemoryError as error:
        raise ModelError(f"{path}: the model needs more memory than there is") from error
    except (np.linalg.LinAlgError, ArithmeticError) as error:
        raise ModelError(
            f"{path}: the model's numbers are too far apart to compute with ({one_line(error)})"
        ) from error
    except (ValueError, RuntimeError) as error:  # from MuJoCo's bindings
        raise ModelError(f"{path}: not a usable MJCF model: {one_line(error, 500)}") from error


def examine(path: Path) -> None:
    """Read the file and what it refers to, and check in a separate process that compiling it is safe.

    Raises:
        ModelError: if it cannot be read, is not UTF-8 (names would come back as bytes that are no text), refers to
            what is no file, or does not compile within the limits.
    """
    try:
        if not path.is_file():
            what = "not a file" if path.exists() else "no such model file"
            raise ModelError(f"{one_line(path, 300)}: {what}{'' if path.exists() else MODELS.near(path)}")
        if path.suffix.lower() == ".osim":
            raise ModelError(
                f"{one_line(path, 300)}: a model of OpenSim, not MJCF; convert it, for example with MyoConverter, and "
                "give the .xml that it writes"
            )
    except (OSError, ValueError) as error:
        raise ModelError(f"{one_line(path, 300)}: no such model file ({one_line(error, 100)})") from error
    read = [mark for _, mark in _read(path)]
    marks = [hashlib.sha256(part).hexdigest() for part in read]
    mark = "".join((str(path.absolute()), *marks))
    if mark not in _known_good and not (len(marks) == 1 and marks[0] in OURS):
        rehearse(path)
        _known_good.add(mark)


def check_sizes(path: Path, model: mujoco.MjModel) -> None:
    """Check that a compiled model can be linearised.

    Raises:
        ModelError: if it has more sensor entries, actuators or states than can be, or a timestep that is none.
    """
    if not 0 < model.opt.timestep < np.inf:  # MuJoCo lets NaN pass
        raise ModelError(f"{path}: option timestep is {model.opt.timestep} s; give a positive number")
    for what, size in (
        ("sensor entries", model.nsensordata),
        ("actuators", model.nu),
        ("states", 2 * model.nv + model.na),
    ):
        if size > MOST:
            raise ModelError(f"{path}: the model has {size} {what}; icmj takes at most {MOST}")


def check_names(path: Path, spec: mujoco.MjSpec) -> None:
    """Check that no element has a name that the composed model needs.

    Raises:
        ModelError: if one has.
    """
    for element in (*spec.actuators, *spec.numerics, *spec.joints):
        if element.name in RESERVED:
            raise ModelError(f"{path}: an element is named {element.name!r}, which icmj adds itself; rename it")


def check_plant(path: Path, plant: LinearPlant) -> None:
    """Check that a linearised plant can be analysed.

    Raises:
        ModelError: if it has more states, inputs or outputs than can be.
    """
    for what, size, most in (
        ("states", plant.n, MOST_STATES),
        ("inputs", plant.n_u, MOST_PORTS),
        ("outputs", plant.n_y, MOST_PORTS),
    ):
        if size > most:
            raise ModelError(f"{path}: the plant has {size} {what}; icmj takes at most {most}")


def files_of(path: Path) -> tuple[Path, ...]:
    """A model's file, those of the models that it includes or attaches, and all others that they refer to.

    Raises:
        ModelError: if one cannot be read.
    """
    return tuple(found for found, _ in _read(path))


def _read(model: Path) -> list[tuple[Path, bytes]]:
    """The files of a model with their contents; for files other than models, with size and time of change.

    Folders of meshes and textures that one file names hold for the files of all: which wins is the compiler's to say.
    """
    found: dict[Path, bytes] = {}
    seen: set[Path] = set()
    named: dict[tuple[Path, str], bool] = {}  # whether it is a model
    folders: dict[Path, None] = {Path(): None}

    def places(models: bool) -> Iterator[tuple[Path, os.stat_result]]:
        for (parent, name), is_model in sorted(named.items()):
            for path in (parent / folder / name for folder in folders if is_model is models):
                if (state := _state(model, path)) is not None and path.resolve() not in seen:
                    yield path, state

    left, stripped = [model], False
    while left:
        for path in left:
            if path.resolve() in seen:
                continue
            seen.add(path.resolve())
            text, found[path] = _text(path)
            listed = map(Path, map(unescape, _FOLDERS.findall(text)))
            folders |= dict.fromkeys(islice(listed, max(FOLDERS - len(folders), 0)))
            models, stripped = set(_MODELS.findall(text)), stripped or bool(_STRIPPED.search(text))
            for name in {*_FILES.findall(text)}:
                named |= {(parent, unescape(name)): name in models for parent in (model.parent, path.parent)}
        # of all, as a folder may be named after those files that refer to what is in it
        left = [path for path, _ in places(models=True)]
    if stripped:
        named |= {(parent, re.split(r"[/\\]", name)[-1]): False for (parent, name), of in named.items() if not of}
    for path, state in places(models=False):
        found.setdefault(path, f"{path} {state.st_size} {state.st_mtime_ns}".encode(errors="surrogateescape"))
    return list(found.items())


def _text(path: Path) -> tuple[str, bytes]:
    """The text of a model without its comments, and its content.

    Raises:
        ModelError: if it cannot be read, or is not UTF-8.
    """
    try:
        content = read_bytes(path, MOST_BYTES)
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {error.strerror}") from error
    text = content.decode(errors="surrogateescape")
    text = re.sub(r"<!--.*?-->", lambda comment: "\n" * comment.group().count("\n"), text, flags=re.DOTALL)
    if wrong := _NO_UTF8.search(text):
        line, byte = text.count("\n", 0, wrong.start()) + 1, ord(wrong.group()) - 0xDC00
        raise ModelError(f"{path}: line {line} is not UTF-8 (byte 0x{byte:02x}); save the file as UTF-8")
    return text, content


def _state(model: Path, path: Path) -> os.stat_result | None:
    """Size and time of change of a file that a model refers to; only regular files, as reading a pipe would block."""
    try:
        state = path.stat()
    except (OSError, ValueError):
        return None  # no name of a file; MuJoCo says so
    if stat.S_ISREG(state.st_mode):
        return state
    if not stat.S_ISDIR(state.st_mode):
        raise ModelError(f"{model}: refers to {path}, which is not a file")
    return None
