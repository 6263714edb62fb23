"""A folder of results that is taken up again where it was left.

    FOLDER/WHAT.json     what the results are of: what must be the same to go on, versions, texts, provenance
    FOLDER/PARTS/        what is finished
    FOLDER/SHA256SUMS    digests, without which no file is trusted; ``sha256sum -c`` reads them
    FOLDER/.lock         while it is written

A digest is there before its file is, so that a process that dies in between leaves a file that is either new or as it
was before. A file may have several: any content that was written there is known. The folder may come from somebody
else: no link is followed for writing, and whatever a file makes its reader raise ends in one line.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from icmj.base.files import LOCK, clear_leftovers, lock, make_ready, open_file, open_regular, read_bytes, whole
from icmj.base.text import one_line, parse_json
from icmj.errors import IcmjError
from icmj.work.provenance import versions

SUMS = "SHA256SUMS"
_MOST_SUMS = 200e6  # bytes: two million files
_MOST_WORDS = 5e6  # bytes of a description: texts of files, each of a megabyte at most
_LARGEST = 1e11  # bytes of a file whose digest is asked for

T = TypeVar("T")


@dataclass(frozen=True)
class Description:
    """What the results in a folder are of.

    Attributes:
        what: in a word, such as ``sweep``; the description is ``sweep.json``.
        parts: folder of what is finished.
        mark: what must be the same for it to go on, such as a fingerprint.
        of: what is another one where the mark differs, in words; it is given the description that is there.
        more: what else is written, for people.
        check: raises ValueError if a description that is there is none.
        versions: of the packages that decide the results; these must be the same, too.
    """

    what: str
    parts: str
    mark: Mapping[str, Any]
    of: Callable[[Mapping[str, Any]], str]
    more: Mapping[str, Any]
    check: Callable[[bytes], object] = bool
    versions: Mapping[str, str] = field(default_factory=versions)


class Folder:
    """A folder with the digests of its files.

    Args:
        path: of the folder.
        error: class of what is raised.
        again: what becomes of a file that is removed: it is ``computed`` again.
    """

    def __init__(self, path: Path, error: type[IcmjError], again: str = "computed") -> None:
        self.path, self._error, self._again = path, error, again
        self._known: frozenset[str] = frozenset()

    @contextmanager
    def seal(self, target: Path) -> Iterator[Path]:
        """A path to write to, as of :func:`icmj.base.files.whole`; the digest of what is written there is noted.

        Raises:
            IcmjError: of the class of this folder, if it cannot be written, or its digest cannot.
        """
        try:
            with whole(target) as part:
                yield part
                with open(part, "r+b") as file:
                    os.fsync(file.fileno())
                self._note(self._line(target, digest_of(part)))
            _settle(target.parent)
        except OSError as error:
            words = f"cannot be written ({error.strerror or error}); what is finished is kept"
            raise self._error(f"{target}: {words}") from error

    def read(self, path: Path, most: float, parse: Callable[[bytes], T]) -> T:
        """What ``parse`` makes of the content of a file of at most ``most`` bytes that was sealed.

        Raises:
            IcmjError: of the class of this folder, if it cannot be read, is not as it was written, or ``parse`` fails.
        """
        try:
            return parse(self._content(path, most))
        except Exception as error:  # readers of tables and arrays raise a dozen types on damaged files
            words = f"cannot be read ({_why(error)}); remove it, and it is {self._again} again"
            raise self._error(f"{path}: {words}") from error

    def expect_readable(self, paths: Iterable[Path]) -> None:
        """See that no table among these ends the process that reads it: all at once, before they are :meth:`read`.

        Raises:
            IcmjError: of the class of this folder, if one does.
        """
        from icmj.base.parquet import FATAL, find_fatal

        if (fatal := find_fatal(paths)) is not None:
            raise self._error(f"{fatal}: cannot be read ({FATAL}); remove it, and it is {self._again} again")

    def describe(self, what: str, parse: Callable[[bytes], T]) -> T:
        """What ``parse`` makes of the description of the folder.

        Raises:
            IcmjError: of the class of this folder, if there is none, or it is not as it was written.
        """
        try:
            return parse(self._content(self.path / f"{what}.json", _MOST_WORDS))
        except Exception as error:
            words = f"not the folder of {'an' if what[0] in 'aeiou' else 'a'} {what}"
            raise self._error(f"{self.path}: {words}; it has no sound {what}.json ({_why(error)})") from error

    def begin(self, of: Description, instead: str) -> None:
        """Write the description, or check that the one that is there is of the same.

        Raises:
            IcmjError: of the class of this folder, if it is of something else, or of other versions.
        """
        file = self.path / f"{of.what}.json"
        if not os.path.lexists(file):
            if os.path.lexists(self.path / of.parts):
                raise self._error(f"{self.path}: has {of.parts} but no {file.name} that describes them; {instead}")
            facts = {**of.mark, "versions": of.versions, **of.more}
            with self.seal(file) as part:
                part.write_text(json.dumps(facts, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
            return
        self.describe(of.what, of.check)
        known = self.describe(of.what, _table)
        if any(known.get(key) != value for key, value in of.mark.items()):
            raise self._error(f"{self.path}: holds another {of.what}, of {one_line(of.of(known), 400)}; {instead}")
        before = known["versions"] if isinstance(known.get("versions"), dict) else {}
        now = of.versions  # folders of earlier versions do not have all of them
        other = [f"{name} {old} (now {now[name]})" for name, old in before.items() if old != now.get(name, old)]
        if other:
            words = f"was begun with {one_line(', '.join(other), 400)}, and would not be of one piece"
            raise self._error(f"{self.path}: {words}; {instead}")

    def _content(self, path: Path, most: float) -> bytes:
        content = read_bytes(path, most)
        line = self._line(path, hashlib.sha256(content).hexdigest())
        if line not in self._known:
            self._known = self._read_sums()
            if line not in self._known:
                words = f"{path.name} is not as it was written: its SHA-256 is not in {SUMS}"
                raise OSError(errno.EINVAL, words, str(path))
        return content

    def _line(self, path: Path, digest: str) -> str:
        return f"{digest}  {path.relative_to(self.path).as_posix()}"

    def _read_sums(self) -> frozenset[str]:
        try:
            content = read_bytes(self.path / SUMS, _MOST_SUMS)
        except FileNotFoundError:
            return frozenset()
        return frozenset(content.decode(errors="replace").split("\n"))

    def _note(self, line: str) -> None:
        """Add a line, after the end of one that a process or a full disk left unfinished."""
        path = self.path / SUMS
        with os.fdopen(open_regular(path, os.O_RDWR | os.O_APPEND | os.O_CREAT), "a+b", buffering=0) as file:
            torn = file.seek(0, os.SEEK_END) > 0 and file.seek(-1, os.SEEK_END) >= 0 and file.read(1) != b"\n"
            text = b"\n" * torn + line.encode() + b"\n"
            if file.write(text) != len(text):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
            os.fsync(file.fileno())


@contextmanager
def resume(
    path: Path | str | None,
    of: Description,
    error: type[IcmjError],
    *,
    again: str = "computed",
    instead: str = "choose another --out",
    beside: Sequence[str] = (),
    alone: bool = True,
) -> Iterator[Folder]:
    """The folder of some results, new or taken up again; without a path a temporary one.

    A new one in which nothing was finished is taken away again if the block fails.

    Args:
        path: of the folder.
        of: what its results are of.
        error, again: as of :class:`Folder`.
        instead: what to do if it cannot be used.
        beside: names of further files that will be written there.
        alone: whether no other process may write to it within the block.

    Raises:
        IcmjError: of the class ``error``, if another process is at it, or it holds something else, or was begun with
            other versions, or cannot be written to.
    """
    with ExitStack() as stack:
        folder = Folder(Path(stack.enter_context(TemporaryDirectory()) if path is None else path), error, again)
        new, parts = not folder.path.exists(), folder.path / of.parts
        try:
            folder.path.mkdir(parents=True, exist_ok=True)
            if alone:
                stack.enter_context(lock(folder.path, of.what))
            stack.enter_context(_clear(folder.path, (f"{of.what}.json", of.parts, SUMS, LOCK) if new else ()))
            make_ready(folder.path, SUMS, *beside)
            if parts.is_symlink():
                raise error(f"{parts}: is a link, not a folder; {instead}")
            folder.begin(of, instead)
            parts.mkdir(exist_ok=True)
            clear_leftovers(parts)
        except BlockingIOError as busy:
            raise error(f"{path}: {busy.strerror}, or {instead}") from busy
        except OSError as why:
            raise error(f"{path}: cannot be written to ({why.strerror or why}); {instead}") from why
        yield folder


@contextmanager
def _clear(path: Path, ours: tuple[str, ...]) -> Iterator[None]:
    """If the block fails, take a folder away again in which nothing stands but these names."""
    try:
        yield
    except BaseException:
        if ours and all(child.name in ours for child in path.rglob("*")):
            shutil.rmtree(path, ignore_errors=True)
        raise


def digest_of(path: Path) -> str:
    """SHA-256 of a regular file, as hexadecimal text.

    Raises:
        OSError: if it cannot be read.
    """
    with open_file(path, _LARGEST) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def fingerprint_of(identity: Mapping[str, Any]) -> str:
    """Sixteen hexadecimal digits of plain data, the same wherever it is computed."""
    return hashlib.sha256(json.dumps(identity, sort_keys=True, default=str).encode()).hexdigest()[:16]


def _settle(folder: Path) -> None:
    """Flush the folder, so that a new file name is on the disk."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _table(content: bytes) -> dict[str, Any]:
    found = parse_json(content)
    if not isinstance(found, dict):
        raise ValueError("no table")
    return found


def _why(error: Exception) -> str:
    """The reason of an error in one line."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return one_line(f"no {error}" if isinstance(error, KeyError) else error or type(error).__name__, 200)
