"""Model files that would stall the compiler, or take the process with them, found out before they do.

What a file asks for is read from its text. One that asks for much, or for many copies of something, is compiled first
in a process of its own with limits on time and memory; ordinary ones are not, and start as fast as ever.
"""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import mujoco
import numpy as np

from icmj.base.text import one_line
from icmj.engine.fault import words
from icmj.engine.hush import hushed
from icmj.errors import ModelError
from icmj.plant.linear_plant import LinearPlant

MOST_BYTES = 20_000_000  # of one MJCF file
MANY = 10_000  # a number of things from which on a model is tried first
COPIES = 300  # of bodies, by replicate, composite and flexcomp together
SECONDS, BYTES = 10, 4 << 30  # a trial's limits
MOST = 1000  # sensor entries, actuators and states of a model
MOST_STATES, MOST_PORTS = 200, 200  # of a plant; eigenvalues of pairs are what becomes expensive
RESERVED = ("icmj_controller", "icmj_controller_joint")

_ATTRIBUTE = re.compile(r"""([\w:]+)\s*=\s*["']([^"']*)["']""")
_COPIES = re.compile(r"""<(?:replicate|composite|flexcomp)\b[^>]*?\bcount\s*=\s*["']([^"']*)["']""")
_COUNTS = re.compile(r"n\w*|count|\w*dim|width|height|\w*size|resolution|iterations|\w*level\w*|maxhull\w*")
_INCLUDE = re.compile(r"""<include\b[^>]*?\bfile\s*=\s*["']([^"']*)["']""")
_FILES = re.compile(r"""\bfile\w*\s*=\s*["']([^"']*)["']""")
_FOLDERS = re.compile(r"""\b(?:mesh|texture|asset)dir\s*=\s*["']([^"']*)["']""")
_TRIAL = """
import ctypes, os, resource, signal, sys
try:
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)
except Exception:
    pass
resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[2]),) * 2)
resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[3]),) * 2)
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
import mujoco
config = mujoco.MjLogConfig.get()
config.logto_console = config.logto_file = False
config.set()
try:
    model = mujoco.MjSpec.from_file(sys.argv[1]).compile()
    mujoco.mj_forward(model, mujoco.MjData(model))
except MemoryError:
    sys.exit("out of memory")
except Exception as error:
    sys.exit(str(error) or type(error).__name__)
"""
_NO_UTF8 = re.compile("[\udc80-\udcff]")  # what "surrogateescape" makes of such bytes
_SCALES = {"K": 2.0**10, "M": 2.0**20, "G": 2.0**30, "T": 2.0**40, "P": 2.0**50, "E": 2.0**60}
_known_good: set[bytes] = set()


@contextmanager
def sound(path: Path) -> Iterator[None]:
    """Load and use the model of ``path`` within the block: tried first if need be, errors in one line, nothing printed.

    Raises:
        ModelError: if the file asks for what cannot be, or MuJoCo or linear algebra give up on it in the block.
    """
    examine(path)
    try:
        with hushed(), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the compiler's, on models that it takes all the same
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
    """Look at what the file asks for, and compile it in a process of its own where that is much.

    Raises:
        ModelError: if it cannot be read, is not UTF-8 (names would come back as bytes that are no text), refers to
            what is no file, or does not compile within the limits.
    """
    try:
        if not path.is_file():
            what = "not a file" if path.exists() else "no such model file"
            raise ModelError(f"{one_line(path, 300)}: {what}")
    except (OSError, ValueError) as error:
        raise ModelError(f"{one_line(path, 300)}: no such model file ({one_line(error, 100)})") from error
    text = "\n".join(_texts(path, path, set()))
    if not suspicious(text):
        return
    mark = hashlib.sha256(f"{path}\0{text}".encode(errors="surrogateescape")).digest()
    if mark not in _known_good:
        _try(path)
        _known_good.add(mark)


def suspicious(text: str) -> bool:
    """Whether MJCF text asks for many of something, or for many copies."""
    copies = 1.0
    for counts in _COPIES.findall(text):
        copies *= max(_product(counts), 1.0)
        if copies > COPIES:
            return True
    attributes = _ATTRIBUTE.findall(text)
    if any(name == "memory" and _largest(value) >= BYTES / 4 for name, value in attributes):
        return True
    return any(_COUNTS.fullmatch(name) and _largest(value) >= MANY for name, value in attributes)


def check_sizes(path: Path, model: mujoco.MjModel) -> None:
    """See that a compiled model is one to linearise.

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
    """See that no element has a name that the composed model needs.

    Raises:
        ModelError: if one has.
    """
    for element in (*spec.actuators, *spec.numerics, *spec.joints):
        if element.name in RESERVED:
            raise ModelError(f"{path}: an element is named {element.name!r}, which icmj adds itself; rename it")


def check_plant(path: Path, plant: LinearPlant) -> None:
    """See that a linearised plant is one to analyse.

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


def _texts(path: Path, model: Path, seen: set[Path]) -> Iterator[str]:
    """The text of a model and of what it includes; what else it refers to must be files."""
    if path in seen:
        return
    seen.add(path)
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {error.strerror}") from error
    if len(content) > MOST_BYTES:
        raise ModelError(f"{path}: more than {MOST_BYTES / 1e6:g} MB of MJCF")
    text = content.decode(errors="surrogateescape")
    text = re.sub(r"<!--.*?-->", lambda comment: "\n" * comment.group().count("\n"), text, flags=re.DOTALL)
    if wrong := _NO_UTF8.search(text):
        line, byte = text.count("\n", 0, wrong.start()) + 1, ord(wrong.group()) - 0xDC00
        raise ModelError(f"{path}: line {line} is not UTF-8 (byte 0x{byte:02x}); save the file as UTF-8")
    yield text
    folders = [Path(), *map(Path, _FOLDERS.findall(text))]
    for name in _FILES.findall(text):
        for folder in folders:
            _must_be_a_file(model, model.parent / folder / name)
    for name in _INCLUDE.findall(text):
        inner = model.parent / name
        if _is_file(inner):
            yield from _texts(inner, model, seen)


def _must_be_a_file(model: Path, path: Path) -> None:
    """A pipe would be waited on for ever."""
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            raise ModelError(f"{model}: refers to {path}, which is not a file")
    except (OSError, ValueError):
        return  # no name of a file; MuJoCo says so


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _product(counts: str) -> float:
    product = 1.0
    for number in _numbers(counts):
        product *= number
    return product


def _largest(value: str) -> float:
    return max(_numbers(value), default=0.0)


def _numbers(value: str) -> list[float]:
    found = []
    for word in value.split()[:1000]:
        scale = _SCALES.get(word[-1].upper(), 1.0)
        try:
            found.append(abs(float(word[:-1] if scale != 1.0 else word)) * scale)
        except ValueError:
            continue
    return found


def _try(path: Path) -> None:
    """Compile a model, and look at it once, in a process with limits."""
    if os.name != "posix":
        return
    command = [sys.executable, "-c", _TRIAL, str(path), str(BYTES), str(SECONDS)]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    too_much = f"{path}: compiling the model takes more than {SECONDS} s or {BYTES >> 30} GB; make it smaller"
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=SECONDS,
            env=environment,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise ModelError(too_much) from error
    if done.returncode < 0:
        raise ModelError(too_much)
    if done.returncode:
        said = one_line(done.stderr.decode(errors="replace"), 300)
        lacking = not said or any(word in said.lower() for word in ("memory", "alloc", "unknown exception"))
        raise ModelError(too_much + f" ({said})" if lacking else f"{path}: not a usable MJCF model: {said}")
