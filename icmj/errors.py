"""Every error that icmj raises on purpose.

Each message says what was wrong, where, and what to do; the command line prints it as one line and
exits with status 2.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class IcmjError(Exception):
    """Base of all errors raised on purpose by icmj."""


class RunFileError(IcmjError):
    """A run file cannot be read or does not validate."""


class ModelError(IcmjError):
    """An MJCF model cannot be loaded, edited, linearised or composed with a controller."""


class DesignError(IcmjError):
    """A gain cannot be designed: the plant is not stabilisable or detectable, or a weight is unusable."""


class AnalysisError(IcmjError):
    """A matrix or an interval given to the analysis has the wrong shape or is not finite."""


def expect(value: object, kind: type, what: str, instead: str = "") -> None:
    """Check the class of an argument; ``what`` it is for begins the message, and what to do ``instead`` ends it.

    Raises:
        AnalysisError: if it is of another class.
    """
    if not isinstance(value, kind):
        article = "an" if kind.__name__[0] in "AEIOU" else "a"
        words = f"{what} takes {article} {kind.__name__}, got {type(value).__name__}"
        raise AnalysisError(words + (f"; {instead}" if instead else ""))


def beyond_arithmetic(error: BaseException) -> bool:
    """Whether an unforeseen error of linear algebra means that numbers differ too much in magnitude."""
    return type(error).__name__ in ("LinAlgError", "OverflowError")


_NO_MEMORY = (
    "failed to map segment", "cannot allocate memory", "could not allocate memory", "can't start new thread",
    "failed to launch thread", "realloc of size", "malloc of size",
)  # fmt: skip


def beyond_memory(error: BaseException) -> bool:
    """Whether an error of a library means that memory or address space is exhausted."""
    return isinstance(error, MemoryError) or any(words in str(error).lower() for words in _NO_MEMORY)


class SimulationError(IcmjError):
    """A simulation cannot be started with these arguments."""


class CycleError(IcmjError):
    """A cycle was not found, or a branch of cycles cannot be followed."""


class LogError(IcmjError):
    """A log cannot be written or read, or does not contain the requested data."""


class DataError(IcmjError):
    """A time series, or a file of them, cannot be read, written or measured."""


class ReportError(IcmjError):
    """A report cannot be built from these logs."""


class StudyError(IcmjError):
    """A study cannot be carried out, or one of its processes died."""


class SweepError(IcmjError):
    """A sweep cannot be carried out, or its folder holds another one or belongs to another process."""


class IdentificationError(IcmjError):
    """Nothing can be identified from the given motion."""


class FitError(IcmjError):
    """A family of controllers, a bank of its simulations, or a fit cannot be made, or belongs elsewhere."""


@contextmanager
def explain_refusal(error: type[IcmjError], words: str, instead: str = "") -> Iterator[None]:
    """What the file system refuses within the block is an ``error``: ``words``, its reason, and what to do."""
    try:
        yield
    except OSError as why:
        raise error(f"{words} ({why.strerror or why}){instead}") from why


@contextmanager
def prefix_errors(path: Path | str) -> Iterator[None]:
    """Errors within the block begin with the path of the file that they are about."""
    try:
        yield
    except IcmjError as error:
        if str(error).startswith(f"{path}: "):
            raise
        raise type(error)(f"{path}: {error}") from error
