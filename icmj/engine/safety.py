"""What is asked of a model file before it is used: that it can be read, compiles within limits, and is not too large.

Every model that does not come with icmj is first tried in a process of its own (:mod:`icmj.engine.rehearsal`), once for
each state of it and of the files that it refers to.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import mujoco
import numpy as np

from icmj.base.blas_threads import ignore_warnings
from icmj.base.text import one_line
from icmj.engine.faults import format_fault
from icmj.engine.isolation import isolate_engine
from icmj.engine.model_files import read_contents
from icmj.engine.rehearsal import rehearse
from icmj.errors import ModelError
from icmj.plant.linear_plant import LinearPlant
from icmj.work.shipped import MODELS

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
_known_good: set[str] = set()


@contextmanager
def use_model(path: Path) -> Iterator[None]:
    """Load and use the model of ``path`` within the block: tried first if need be, errors in one line, nothing printed.

    Raises:
        ModelError: if the file asks for what cannot be, or MuJoCo or linear algebra give up on it in the block.
    """
    examine(path)
    try:
        with isolate_engine(), ignore_warnings():  # by the compiler, of models that it takes all the same
            yield
    except mujoco.FatalError as error:
        raise ModelError(f"{path}: {format_fault(error)}") from error
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
    read = [mark for _, mark in read_contents(path)]
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
