"""Whatever a user's own class does wrong is told as its mistake in one line, and never as one of icmj."""

import subprocess
import sys
from textwrap import indent

import pytest
from patience import PATIENCE

from icmj import load_run, prepare
from icmj.errors import IcmjError

LAW = """
import numpy as np
import icmj
from icmj.controller import Layout, Mode, Realisation


def realise(n_v, n_u):
    mode = Mode("on", np.zeros((0, 0)), np.zeros((0, n_v)), np.zeros((n_u, 0)), np.zeros((n_u, n_v)))
    none = np.zeros((0, 0))
    return Realisation(Layout.of(a=0), (mode,), none, none, none, np.zeros(1, dtype=int))


class Own(icmj.Law):
    kind = "own"

    def __init__(self, plant, **parameters):
        self.assumed = plant

    @property
    def plant(self):
        return self.assumed

    @property
    def realisation(self):
        return realise(self.assumed.n_y, self.assumed.n_u)

    def facts(self):
        return {}

"""
RUN = """
[case]
name = "own"
title = "A controller of one's own"
[assumed]
model = "one_link"
[controller]
kind = "own:Own"
{}
[simulation]
duration = 1.0
"""
WRONG = {
    "a realisation that raises": ("@property\ndef realisation(self):\n    raise KeyError('gain')", "KeyError: 'gain'"),
    "no realisation": ("@property\ndef realisation(self):\n    return None", "its realisation is a NoneType"),
    "other commands": ("@property\ndef realisation(self):\n    return realise(self.assumed.n_y, 7)", "7 commands"),
    "too few readings": ("@property\ndef realisation(self):\n    return realise(0, 1)", "0 readings"),
    "facts that raise": ("def facts(self):\n    raise ZeroDivisionError", "ZeroDivisionError"),
    "facts that are none": ("def facts(self):\n    return None", r"its facts\(\) is a NoneType"),
    "no plant": ("@property\ndef plant(self):\n    return None", "its plant is a NoneType"),
    "a kind that is no word": ("kind = 3", "its kind is a int"),
    "an exit": ("def facts(self):\n    raise SystemExit(3)", "SystemExit: 3"),
    "an exit where it is made": ("def __init__(self, plant):\n    raise SystemExit", "SystemExit"),
    "no arguments": ("def __init__(self):\n    pass", "TypeError"),
}


@pytest.fixture
def prepared(tmp_path):
    """Prepares the case of a controller with this body, and these keys of its table."""

    def make(body, keys=""):
        (tmp_path / "own.py").write_text(LAW + indent(body, "    ") + "\n")
        (tmp_path / "run.toml").write_text(RUN.format(keys))
        return prepare(load_run(tmp_path / "run.toml", allow_code=True))

    return make


def test_one_that_is_right_is_taken(prepared):
    assert prepared("").controller.facts() == {}
    assert prepared("", "parameters = { reference = 2, name = 3, arguments = 1 }").controller.kind == "own"


@pytest.mark.parametrize("kind", WRONG)
def test_what_is_wrong_with_it_is_told_as_its_own(prepared, kind):
    body, words = WRONG[kind]
    with pytest.raises(IcmjError, match=f"own:Own.*{words}"):
        prepared(body)


def test_a_parameter_of_any_name_is_the_class_s_own_business(prepared):
    """One that it cannot take is refused by it."""
    with pytest.raises(IcmjError, match=r"own:Own fails \(TypeError"):
        prepared("", "parameters = { self = 1 }")


@pytest.mark.parametrize("status", [0, 3])
def test_one_that_ends_the_process_leaves_its_status_and_nothing_half_written(tmp_path, status):
    """Nothing of icmj runs after ``os._exit``, so nothing can be said; what is documented is all that is left."""
    (tmp_path / "own.py").write_text(LAW + f"    def facts(self):\n        import os\n        os._exit({status})\n")
    (tmp_path / "run.toml").write_text(RUN.format(""))
    command = [sys.executable, "-m", "icmj.cli", "run", "run.toml", "--allow-code"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=PATIENCE)
    assert (done.returncode, done.stdout, done.stderr) == (status, "", "")
    assert not [path for path in tmp_path.rglob("*") if path.suffix in (".rrd", ".html", ".json")]
