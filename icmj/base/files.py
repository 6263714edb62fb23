"""Files that are complete or absent.

A file appears under its name only when it is complete. Remains of unfinished files are cleared, and reading is bounded.
"""

from __future__ import annotations

import errno
import hashlib
import io
import os
import re
import shutil
import stat
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

SUFFIX = ".tmp"
"""Ends the name of what is under way; the name says who writes it, so that what the dead left can be told."""

LOCK = ".lock"

_OURS = re.compile(r"\..+\.(?P<place>[0-9a-f]{6})-(?P<pid>\d+)-[0-9a-f]{8}" + re.escape(SUFFIX))
_A_DAY = 86400.0  # [s]
_PART = 1 << 20  # bytes that are read at a time


_ENDS = (
    ".csv", ".parquet", ".npz", ".rrd", ".html", ".htm", ".json", ".toml", ".xml", ".svg", ".pdf", ".png", ".txt",
    ".nc", ".md", ".mot", ".sto", ".c3d", ".zip", ".log",
)  # fmt: skip


def is_file_name(path: Path) -> bool:
    """Whether a name ends as those of files do; .9 and .wide end names of folders and cases, too."""
    return path.suffix.lower() in _ENDS


@contextmanager
def whole(target: Path) -> Iterator[Path]:
    """A path beside ``target`` to write to; renamed to it if the block ends well, removed if it does not.

    The path is of this block alone, so that two processes may write the same target; the later one wins.

    Raises:
        OSError: if it cannot be renamed, or :func:`expect_replaceable` refuses what is there.
    """
    expect_replaceable(target)
    part = _beside(target)
    try:
        yield part
        expect_replaceable(target)
        os.replace(part, target)
    finally:
        with suppress(OSError):
            part.unlink()


@contextmanager
def make_scratch(target: Path) -> Iterator[Path]:
    """A folder beside ``target`` for the length of the block.

    Raises:
        OSError: if it cannot be made.
    """
    folder = _beside(target)
    folder.mkdir()
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def expect_replaceable(*targets: Path) -> None:
    """Check that these names belong to regular files, or to nothing; anything else must not be replaced.

    A link is refused, too, whatever it leads to: it would be replaced and not followed.

    Raises:
        OSError: with what is there in its ``strerror``.
    """
    for target in targets:
        try:
            mode = target.lstat().st_mode
        except FileNotFoundError:
            continue
        if not stat.S_ISREG(mode):
            words = f"a {_kind(mode)} is there and is not replaced; remove it, or choose another name"
            raise OSError(errno.EEXIST, words, str(target))


def open_regular(path: Path, flags: int) -> int:
    """The file descriptor of a regular file; neither a pipe is waited for, nor a device touched.

    Where it is opened for writing, no link is followed, and none of another name of the same file is accepted.

    Args:
        path: the file.
        flags: of :func:`os.open`.

    Raises:
        OSError: if it cannot be opened, or is no regular file.
    """
    writes = bool(flags & (os.O_WRONLY | os.O_RDWR))
    try:
        if writes:
            expect_replaceable(path)
        else:
            _refuse_irregular(path, os.stat(path))  # opening some devices does something to them
        flags |= sum(getattr(os, name, 0) for name in ("O_NONBLOCK", "O_CLOEXEC", "O_BINARY", "O_NOCTTY"))
        handle = os.open(path, flags | (getattr(os, "O_NOFOLLOW", 0) if writes else 0), 0o666)
    except ValueError as error:  # a zero byte in it, or what the file system has no letters for
        raise OSError(errno.EINVAL, "not a name of a file", str(path)) from error
    try:
        found = os.fstat(handle)  # of what was opened: it may have been replaced since
        _refuse_irregular(path, found)
        if writes and found.st_nlink > 1:
            raise OSError(errno.EINVAL, f"{path.name} has another name elsewhere, a hard link", str(path))
    except BaseException:
        os.close(handle)
        raise
    return handle


def open_file(path: Path, most: float) -> io.BufferedReader:
    """A regular file, or a link to one, open for reading; whoever reads it may be interrupted after each megabyte.

    A pipe is not waited for, and a device not touched. The bound also holds for a file that grows while it is read, or
    that says that it is empty and is not, as files of ``/proc`` do.

    Raises:
        OSError: if it cannot be opened, is no regular file, or has more than ``most`` bytes; ``strerror`` says which.
    """
    file = _BoundedReader(open_regular(path, os.O_RDONLY), path, most)
    try:
        file.refuse_beyond(os.fstat(file.fileno()).st_size)
    except OSError:
        file.close()
        raise
    return io.BufferedReader(file, _PART)


def read_bytes(path: Path, most: float) -> bytes:
    """The content of a regular file of at most ``most`` bytes.

    Raises:
        OSError: as :func:`open_file`.
    """
    with open_file(path, most) as file:
        return b"".join(iter(lambda: file.read(_PART), b""))


class _BoundedReader(io.FileIO):
    """What a buffered reader reads from: a part at a time, up to a limit."""

    def __init__(self, handle: int, path: Path, most: float) -> None:
        super().__init__(handle, "rb")
        self._path, self._most = path, most

    def refuse_beyond(self, size: int) -> None:
        if size > self._most:
            words = f"has {size / 1e6:.3g} MB or more; expected at most {self._most / 1e6:g} MB"
            raise OSError(errno.EFBIG, words, str(self._path))

    def readinto(self, buffer: Any) -> int:
        count = super().readinto(buffer)
        self.refuse_beyond(self.tell())
        return count

    def readall(self) -> bytes:
        part = bytearray(_PART)
        return b"".join(iter(lambda: bytes(part[: self.readinto(part)]), b""))


def _refuse_irregular(path: Path, found: os.stat_result) -> None:
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, f"{path.name} is a {_kind(found.st_mode)}, not a file", str(path))


def _kind(mode: int) -> str:
    names = {stat.S_IFDIR: "folder", stat.S_IFLNK: "link", stat.S_IFIFO: "pipe", stat.S_IFSOCK: "socket"}
    return names.get(stat.S_IFMT(mode), "device")


@contextmanager
def lock(folder: Path, what: str) -> Iterator[None]:
    """Nobody else at the folder, where system and file system have locks; it goes with the process, however that ends.

    Args:
        folder: which one; a file ``.lock`` in it says who is there.
        what: what writes there, in words.

    Raises:
        BlockingIOError: if somebody is at it, with who it is in its ``strerror``.
        OSError: if the lock cannot be made, or is no file of this folder alone.
    """
    try:
        import fcntl
    except ImportError:
        yield
        return
    with os.fdopen(open_regular(folder / LOCK, os.O_RDWR | os.O_CREAT), "r+b") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            who = file.read(20).decode(errors="replace").strip()
            whose = f" (process {who})" if who.isdecimal() else ""
            words = f"another {what}{whose} is writing there; wait for it"
            raise BlockingIOError(errno.EAGAIN, words, str(folder)) from None
        except OSError as error:
            if error.errno not in (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOTSUP):
                raise
        file.truncate(0)
        file.write(str(os.getpid()).encode())
        file.flush()
        yield


def write_text(target: Path, text: str) -> None:
    """Write ``text`` as UTF-8, whole or not at all.

    Raises:
        OSError: if it cannot be written.
    """
    write_bytes(target, text.encode())


def write_bytes(target: Path, content: bytes) -> None:
    """Write ``content``, whole or not at all.

    Raises:
        OSError: if it cannot be written.
    """
    with whole(target) as part:
        part.write_bytes(content)


def make_ready(folder: Path, *names: str) -> None:
    """Make ``folder`` if it is not there, clear what dead writers left in it, and see that it can be written to.

    So that files of these ``names`` can be put into it, they are checked by :func:`expect_replaceable`.

    Raises:
        OSError: if it cannot.
    """
    folder.mkdir(parents=True, exist_ok=True)
    expect_replaceable(*(folder / name for name in names))
    clear_leftovers(folder)
    with make_scratch(folder / "icmj") as inside:
        (inside / "probe").write_bytes(b"icmj")


@contextmanager
def discard_if_failed(folder: Path) -> Iterator[None]:
    """A folder that is made within the block is taken away again if the block fails before anything is in it."""
    there = os.path.lexists(folder)  # false of what can be no name of a folder
    try:
        yield
    except Exception:
        if not there:
            with suppress(OSError):
                folder.rmdir()
        raise


def clear_leftovers(folder: Path) -> None:
    """Remove what writers in ``folder`` left that ended before it was complete; those still alive keep theirs.

    It is unknown whether a writer on another machine, or in another container, still runs; its part is removed after a
    day.
    """
    with suppress(OSError):
        for path in folder.iterdir():
            found = _OURS.fullmatch(path.name)
            if found and _is_left_behind(path, found["place"], int(found["pid"])):
                if path.is_dir() and not path.is_symlink():
                    shutil.rmtree(path, ignore_errors=True)
                else:
                    with suppress(OSError):
                        path.unlink()


def _beside(target: Path) -> Path:
    return target.with_name(f".{target.name}.{_place()}-{os.getpid()}-{uuid.uuid4().hex[:8]}{SUFFIX}")


def _is_left_behind(path: Path, place: str, pid: int) -> bool:
    if place != _place() or os.name != "posix":
        try:
            return time.time() - path.lstat().st_mtime > _A_DAY
        except OSError:
            return False
    return not is_alive(pid)


def is_alive(pid: int) -> bool:
    """Whether a process of this number runs on this machine; always true on systems other than Unix."""
    if os.name != "posix":
        return True  # os.kill would not ask it, but end it
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    try:
        # one that ended and that nobody has waited for writes nothing more
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in ("Z", "X")
    except (OSError, IndexError):
        return True


@cache
def _place() -> str:
    """Where process numbers mean the same: this machine, this container; six hexadecimal digits."""
    name = os.uname().nodename if hasattr(os, "uname") else ""
    with suppress(OSError):
        name += os.readlink("/proc/self/ns/pid")
    return hashlib.sha256(name.encode()).hexdigest()[:6]
