"""npz files of others: the arrays, or one kind of error, whatever is wrong with the file."""

import io
import random
import zipfile
from pathlib import Path

import numpy as np
import pytest
from fuzz_cases import mutate_bytes

from icmj.base.npz import read_npz


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_arrays_come_back_all_or_those_asked_for(tmp_path: Path, save: object) -> None:
    arrays = {"t": np.arange(5.0), "names": np.array(["a", "b"]), "M": np.eye(3)}
    save(tmp_path / "a.npz", **arrays)  # type: ignore[operator]
    found = read_npz(tmp_path / "a.npz", 1e6)
    assert list(found) == list(arrays)
    for name, values in arrays.items():
        np.testing.assert_array_equal(found[name], values)
    assert list(read_npz(tmp_path / "a.npz", 1e6, ("M", "N"))) == ["M"]


def test_other_files_in_it_are_left_out(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", t=np.arange(3.0))
    with zipfile.ZipFile(tmp_path / "a.npz", "a") as packed:
        packed.writestr("README", "what t is")
    assert list(read_npz(tmp_path / "a.npz", 1e6)) == ["t"]


def test_what_is_more_than_allowed_is_not_unpacked(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", t=np.zeros(10**6))
    assert (tmp_path / "a.npz").stat().st_size < 1e5
    with pytest.raises(ValueError, match="8 MB of arrays; expected at most 5 MB"):
        read_npz(tmp_path / "a.npz", 5e6)


def header(text: bytes) -> bytes:
    """An npy file with this header and nothing behind it."""
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


@pytest.mark.parametrize("npy", [
    header(b"{'descr': '<f8', 'fortran_order': False, 'shape': (10000000000000,), }\n"),
    header(b"{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }\n"),
    header(b"{'descr': 'zz', 'fortran_order': 1, 'shape': 3}\n"),
    header(b"{'descr': '<f8', ((('\n"),
    header(b"\xff\xfe\x00"),
    b"",
    b"plain",
])  # fmt: skip
def test_an_array_that_is_none_is_refused(npy: bytes, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as packed:
        packed.writestr("t.npy", npy)
    with pytest.raises(ValueError, match="not an npz file of plain arrays") as caught:
        read_npz(tmp_path / "a.npz", 1e6)
    assert "\n" not in str(caught.value)


def test_pickles_stay_closed_and_no_file_is_an_error_of_the_system(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", t=np.array([{}], dtype=object))
    with pytest.raises(ValueError, match="not an npz file of plain arrays"):
        read_npz(tmp_path / "a.npz", 1e6)
    with pytest.raises(FileNotFoundError):
        read_npz(tmp_path / "none.npz", 1e6)


def test_damaged_files_are_read_or_refused_in_one_line(tmp_path: Path) -> None:
    """Among them wrong sizes, methods of compression, versions of zip, and streams that do not decode."""
    whole, path, refused = io.BytesIO(), tmp_path / "a.npz", set()
    np.savez_compressed(whole, t=np.linspace(0, 1, 50), y=np.random.default_rng(1).normal(size=50))
    for seed in range(3000):
        path.write_bytes(mutate_bytes(random.Random(seed), whole.getvalue()))
        try:
            read_npz(path, 1e6)
        except ValueError as error:
            refused.add(str(error))
    assert len(refused) > 20
    assert all("\n" not in words for words in refused)
