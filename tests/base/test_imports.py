"""What the command line loads late, and how: nothing is lost to whoever wants it after all."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from patience import PATIENCE


def told(code: str) -> list[str]:
    """What a process of its own prints."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_modules_that_nobody_asks_for_wait_until_somebody_does() -> None:
    code = (
        "import sys; from icmj.base.process import defer_idle_modules as unhurried; unhurried(); import scipy.linalg\n"
        "print(any(name.startswith('numpy.f2py.') or name == 'unittest' for name in sys.modules))\n"
        "import numpy.testing; numpy.testing.assert_equal(1, 1); print('unittest' in sys.modules)"
    )
    assert told(code) == ["False", "True"]


def test_a_package_that_offers_much_loads_what_is_asked_for_and_offers_it_all() -> None:
    """Every public name of rerun and of its blueprints is the same thing as without any of this."""
    show = """
    print(package.__name__, name, *(getattr(value, key, "") for key in ("__module__", "__qualname__")), sep="/")
"""
    plain = told(f"""
import rerun, rerun.blueprint
for package, name in [(p, n) for p in (rerun, rerun.blueprint, rerun.components) for n in vars(p) if n[0] != "_"]:
    value = getattr(package, name){show}""")
    late = told(f"""
import sys
from icmj.base.process import defer_idle_modules as unhurried
unhurried()
import rerun, rerun.blueprint
def count(): print(len([name for name in sys.modules if name.startswith("rerun.")]))
count()
for package, name in [line.split("/")[:2] for line in {plain!r}]:
    package = sys.modules[package]
    value = getattr(package, name){show}
count()""")
    assert late[1:-1] == plain
    assert len(plain) > 300
    assert int(late[0]) < 100 < 400 < int(late[-1])


@pytest.mark.skipif(find_spec("pandas") is None, reason="no pandas here")
def test_arrow_does_not_load_pandas_and_others_still_can() -> None:
    code = (
        "import sys; from icmj.base.process import arrow_alone; arrow_alone(); import pyarrow\n"
        "print(pyarrow.array([1.0, 2.0]).sum(), 'pandas' in sys.modules)\n"
        "import pandas; print(len(pandas.DataFrame({'a': [1, 2]})))"
    )
    assert told(code) == ["3.0", "False", "2"]


def test_reading_the_command_line_asks_typeguard_nothing_and_leaves_it_to_others() -> None:
    code = (
        "import sys; from icmj.cli.main import parse; command = parse(['run', 'a.toml', '--set', 'actual.gain=1'])\n"
        "print(*command.set, 'typeguard' in sys.modules); import typeguard; print(typeguard.check_type(1, int))"
    )
    assert told(code) == ["actual.gain=1", "False", "1"]


@pytest.mark.skipif(find_spec("pandas") is None, reason="no pandas here")
def test_a_run_loads_no_pandas(tmp_path: Path) -> None:
    words = ["run", "simple-0.8", "--plant", "linear", "--set", "simulation.duration=2", "--out", str(tmp_path)]
    code = (
        f"import sys; from icmj.cli.main import main; status = main({words!r}); print(status, 'pandas' in sys.modules)"
    )
    assert told(code)[-2:] == ["0", "False"]


@pytest.mark.skipif(find_spec("pandas") is None, reason="no pandas here")
def test_whoever_has_pandas_already_keeps_it_in_arrow() -> None:
    code = (
        "import pandas; from icmj.base.process import arrow_alone; arrow_alone(); import pyarrow\n"
        "print(pyarrow.Table.from_pandas(pandas.DataFrame({'a': [1, 2]})).num_rows)"
    )
    assert told(code) == ["2"]


def test_what_is_imported_meanwhile_is_there_for_whoever_waits_for_it() -> None:
    code = (
        "from icmj.base.process import meanwhile; meanwhile('json.tool'); import json.tool; print(json.tool.__name__)"
    )
    assert told(code) == ["json.tool"]
    assert told("from icmj.base.process import meanwhile; meanwhile('no.such.module'); print('on')") == ["on"]


def test_another_thread_s_import_meets_every_finder_while_arrow_is_loaded() -> None:
    """One in some thousand runs ended with "No module named", of a module that is there."""
    code = """
import sys
from icmj.base.process import arrow_alone
class Spy:
    begun, met = None, []
    def find_spec(self, fullname, path, target=None):
        if fullname == "pyarrow":  # as another thread would that begins to look for a module just now
            self.begun = iter(sys.meta_path)
            self.met.append(next(self.begun))
spy = Spy()
sys.meta_path.insert(0, spy)
before = list(sys.meta_path)
arrow_alone()
spy.met.extend(spy.begun)
print(all(finder in spy.met for finder in before))
"""
    assert told(code) == ["True"]


def test_icmj_in_a_program_of_ones_own_leaves_imports_alone() -> None:
    code = "import sys; before = list(sys.meta_path); import icmj, icmj.case.case; print(sys.meta_path == before)"
    assert told(code) == ["True"]
