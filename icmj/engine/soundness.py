"""Checks for model files that would stall the compiler or crash the process.

Every model that does not come with icmj is compiled first in a process of its own (:mod:`icmj.engine.rehearsal`), once
for each state of it and of the files that it refers to.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from html import unescape
from itertools import islice
from pathlib import Path

import mujoco
import numpy as np

from icmj.base.files import read_bytes
from icmj.base.text import one_line
from icmj.engine.callbacks import hushed
from icmj.engine.fault import words
from icmj.engine.rehearsal import rehearse
from icmj.errors import ModelError
from icmj.plant.linear_plant import LinearPlant
from icmj.work.shipped import MODELS

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
