"""A linearisation on the terminal and as a file: every number is there, and a large one can be read."""

import io
import re

import numpy as np
import pytest

from icmj.cli.commands.linearise import FEW, show_plant
from icmj.cli.main import main
from icmj.cli.terminal import Terminal
from icmj.plant.linear_plant import LinearPlant


def large(n: int = 30) -> LinearPlant:
    rng = np.random.default_rng(1)
    names = {"states": tuple(f"state_{i:02d}" for i in range(n)), "inputs": ("force_0", "force_1"), "outputs": ("y",)}
    return LinearPlant(rng.normal(size=(n, n)), rng.normal(size=(n, 2)), rng.normal(size=(1, n)), **names)


def printed(plant: LinearPlant, full: bool) -> list[str]:
    out = io.StringIO()
    show_plant(plant, Terminal(file=out, width=80, force_terminal=True, color_system=None), full=full)
    return out.getvalue().splitlines()


@pytest.mark.parametrize("full", [False, True])
def test_thirty_states_are_shown_within_the_width_of_a_terminal(full: bool) -> None:
    plant = large()
    lines = printed(plant, full)
    assert max(map(len, lines)) <= 80
    assert "…" not in "".join(lines)  # nothing is cut
    assert (len(lines) < 80) is not full
    assert any("--full" in line for line in lines) is not full


def test_full_prints_every_entry_once() -> None:
    plant = large()
    numbers = re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", " ".join(printed(plant, True)))
    for value in np.concatenate([plant.A.ravel(), plant.B.ravel(), plant.C.ravel()]):
        assert f"{value:.5g}" in numbers


def test_every_pole_is_shown_once_with_its_time() -> None:
    """A pole at −2 has a time constant of half a second; one at −1 ± 3j a damping of 1/√10."""
    A = np.array([[-2.0, 0, 0], [0, -1, 3], [0, -3, -1]])
    lines = [line.split() for line in printed(LinearPlant(A, np.ones((3, 1)), np.ones((1, 3))), False)]
    assert ["-2", "–", "0.5", "–"] in lines
    assert ["-1", "±", "3j", "0.316", "1", "0.4775"] in lines


def test_matrices_are_saved_with_their_names(root, tmp_path, shell) -> None:
    file = tmp_path / "three_link.npz"
    shell.says(["linearise", str(root / "models" / "three_link.xml"), "--out", str(file), "--json"])
    saved = np.load(file)  # no pickles
    assert saved["A"].shape == (6, 6)
    assert FEW >= 6
    assert saved["poles"].real.max() == pytest.approx(3.106, abs=5e-4)
    assert list(saved["states"])[:3] == ["ankle", "knee", "hip"]
    assert list(saved["state_units"])[:3] == ["rad"] * 3


def test_another_kind_of_file_is_one_line_and_nothing_is_written(root, tmp_path, capsys) -> None:
    file = tmp_path / "three_link.mat"
    assert main(["linearise", str(root / "models" / "three_link.xml"), "--out", str(file)]) == 2
    assert "call it three_link.npz" in capsys.readouterr().err
    assert not file.exists()
