"""Digests beside files: what was written is believed, anything else is not, whenever the writer died."""

import json
import os
import shutil
import subprocess
from contextlib import suppress
from pathlib import Path

import pytest
from sweep_cases import GRID, sweep_file
from tampering import EXPERIMENT

import icmj
from icmj.errors import DataError, IcmjError
from icmj.fits.bank import simulate_bank
from icmj.fits.family import load_family
from icmj.work.folder import SUMS, Description, Folder, resume


def sealed(path: Path, content: bytes) -> None:
    with Folder(path.parent, DataError).seal(path) as part:
        part.write_bytes(content)


def read(path: Path) -> bytes:
    return Folder(path.parent, DataError).read(path, 100, bytes)


def test_what_was_sealed_is_read_and_every_bit_counts(tmp_path: Path) -> None:
    path, content = tmp_path / "a.bin", os.urandom(40)
    sealed(path, content)
    assert read(path) == content
    for bit in range(8 * len(content)):
        path.write_bytes(bytes(byte ^ (1 << bit % 8 if i == bit // 8 else 0) for i, byte in enumerate(content)))
        with pytest.raises(DataError, match=r"a\.bin is not as it was written: its SHA-256 is not in SHA256SUMS"):
            read(path)
    path.write_bytes(content)
    (tmp_path / SUMS).unlink()
    with pytest.raises(DataError, match="not as it was written"):
        read(path)


def test_another_program_checks_the_digests(tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    folder = Folder(tmp_path, DataError)
    for name in ("a", "inner/b"):
        with folder.seal(tmp_path / name) as part:
            part.write_text(name)
    done = subprocess.run(["sha256sum", "-c", SUMS], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "a: OK\ninner/b: OK\n")


def test_a_file_that_has_the_name_of_another_is_not_it(tmp_path: Path) -> None:
    sealed(tmp_path / "a", b"one")
    sealed(tmp_path / "b", b"two")
    (tmp_path / "b").write_bytes(b"one")
    with pytest.raises(DataError, match="b is not as it was written"):
        read(tmp_path / "b")


@pytest.mark.parametrize("last", ["rename", "line"])
def test_whoever_dies_in_between_leaves_a_file_that_is_new_or_as_before(last, tmp_path, monkeypatch):
    path = tmp_path / "a"
    sealed(path, b"before")

    def die(*_: object) -> None:
        raise SystemExit

    with monkeypatch.context() as patched:
        patched.setattr(os, "replace", die) if last == "rename" else patched.setattr(os, "fsync", die)
        with pytest.raises(SystemExit):
            sealed(path, b"after")
    assert read(path) == b"before"
    sealed(path, b"after")
    assert read(path) == b"after"


def test_a_line_that_was_left_unfinished_spoils_no_other(tmp_path: Path) -> None:
    sealed(tmp_path / "a", b"one")
    with (tmp_path / SUMS).open("a") as file:
        file.write("0123")
    sealed(tmp_path / "b", b"two")
    assert [read(tmp_path / name) for name in "ab"] == [b"one", b"two"]


@pytest.mark.parametrize("make", [os.mkfifo, Path.mkdir, lambda path: path.symlink_to("/dev/zero")])
def test_digests_that_are_no_file_are_refused(make, tmp_path: Path) -> None:
    sealed(tmp_path / "a", b"one")
    (tmp_path / SUMS).unlink()
    make(tmp_path / SUMS)
    with pytest.raises(DataError, match=r"not a file|is a pipe"):
        read(tmp_path / "a")
    with pytest.raises(DataError, match=r"not replaced|not a file|is there"):
        sealed(tmp_path / "b", b"two")
    assert not (tmp_path / "b").exists()


def _description(mark: str) -> Description:
    return Description("thing", "parts", {"fingerprint": mark}, lambda _: "another thing file", {"name": "a"})


@pytest.mark.parametrize("finished", [True, False])
def test_a_folder_in_which_nothing_was_finished_is_not_left_behind(finished: bool, tmp_path: Path) -> None:
    with suppress(KeyboardInterrupt), resume(tmp_path / "a", _description("1"), DataError) as folder:
        if finished:
            with folder.seal(folder.path / "parts" / "one") as part:
                part.write_bytes(b"one")
        raise KeyboardInterrupt
    assert (tmp_path / "a").exists() == finished
    (tmp_path / "b").mkdir()  # it was there before, and is not ours to take away
    with pytest.raises(KeyboardInterrupt), resume(tmp_path / "b", _description("1"), DataError):
        raise KeyboardInterrupt
    assert (tmp_path / "b").exists()


def test_without_a_path_the_folder_is_a_temporary_one() -> None:
    with resume(None, _description("1"), DataError) as folder:
        assert (folder.path / "thing.json").exists()
    assert not folder.path.exists()


def test_whatever_a_reader_raises_is_one_line_that_says_what_to_do(tmp_path: Path) -> None:
    sealed(tmp_path / "a", b"one")

    def fail(content: bytes) -> None:
        raise NotImplementedError(f"{content!r}\nof two lines")

    with pytest.raises(DataError) as caught:
        Folder(tmp_path, DataError, "simulated").read(tmp_path / "a", 10, fail)
    said = "cannot be read (b'one' of two lines); remove it, and it is simulated again"
    assert str(caught.value) == f"{tmp_path / 'a'}: {said}"


def _sweep(place: Path) -> None:
    icmj.sweep(sweep_file(place, GRID.format(count=2), name="sweep.toml"), place / "out", jobs=1)


def _experiment(place: Path) -> None:
    (place / "experiment.toml").write_text(EXPERIMENT)
    icmj.run_experiment(place / "experiment.toml", place / "out", jobs=1)


def _bank(place: Path) -> None:
    simulate_bank(load_family("delayed-pd"), 2, trials=1, duration=30.0, jobs=1, folder=place / "out")


@pytest.mark.parametrize(("run", "what", "parts"), [
    (_sweep, "sweep", "points"), (_experiment, "experiment", "trials"), (_bank, "bank", "draws")
])  # fmt: skip
def test_sweeps_experiments_and_banks_are_taken_up_again_in_the_one_way(run, what, parts, tmp_path):
    run(tmp_path)
    out, spare = tmp_path / "out", tmp_path / "spare"
    written = {path: path.stat().st_mtime_ns for path in (out / parts).iterdir()}
    assert written
    run(tmp_path)
    assert {path: path.stat().st_mtime_ns for path in (out / parts).iterdir()} == written
    shutil.copytree(out, spare)

    def refused(words: str) -> None:
        with pytest.raises(IcmjError, match=words):
            run(tmp_path)
        shutil.rmtree(out)
        shutil.copytree(spare, out)

    facts = out / f"{what}.json"
    said = json.loads(facts.read_text())
    said["versions"]["numpy"] = "0.9"
    sealed(facts, json.dumps(said).encode())
    refused(r"was begun with numpy 0\.9 \(now .*\), and would not be of one piece; choose another")
    key = "family" if what == "bank" else "fingerprint"
    sealed(facts, json.dumps(said | {key: "0" * 16}).encode())
    refused(f"holds another {what}, of another")
    sealed(facts, b"[]")
    refused(rf"not the folder of an? {what}; it has no sound {what}\.json \(")
    facts.unlink()
    refused(f"has {parts} but no {what}.json that describes them; choose another")
    shutil.rmtree(out / parts)
    (out / parts).symlink_to(spare / parts)
    with pytest.raises(IcmjError, match="is a link, not a folder; choose another"):
        run(tmp_path)
    assert {path.name for path in (spare / parts).iterdir()} == {path.name for path in written}
