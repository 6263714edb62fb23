"""Shared paths, signals as at a terminal, and the rule that no test leaves a MuJoCo callback behind."""

import contextlib
import gc
import os
import signal
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from terminal_cases import Shell

from icmj.base.blas_threads import set_one_thread
from icmj.errors import IcmjError

if "PYTEST_XDIST_WORKER" in os.environ:  # as many processes as cores already; before numpy is there
    set_one_thread()
ROOT = Path(__file__).resolve().parent.parent
# pipes, signals, limits of memory and the benchmarks' processor times: what these files try, Windows has not
UNIX = "base/test_files.py base/test_npz.py base/test_signals.py cli/test_tables.py faults/*"
collect_ignore_glob = [] if hasattr(os, "mkfifo") else UNIX.split()


# on a busy machine whatever is drawn is slow
settings.register_profile("busy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy")


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("icmj", "how long to look for faults, and how far")
    group.addoption("--kills", type=int, default=4, help="signals sent to runs and studies at random moments")
    group.addoption("--mutants", type=int, default=0, help="mutants of each kind; 0: for a fixed time")
    group.addoption("--from-nothing", action="store_true", help="install the wheel with all it needs; the whole study")
    group.addoption("--every", type=int, default=1, help="of the cases of one parametrised test, run every so many")
    group.addoption("--study", type=Path, default=None, help="folder of a study that icmj made; otherwise one is made")
    group.addoption("--all", action="store_true", help="run the long tests, too")
    group.addoption("--seed", type=int, default=None, help="of random faults; one is drawn and printed by default")


def pytest_configure() -> None:
    """Signals as at a terminal: who starts the tests in the background, or under nohup, hands on some as ignored."""
    with contextlib.suppress(ValueError):  # not the main thread
        if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        for name in ("SIGTERM", "SIGHUP"):  # Windows has but the first
            if signal.getsignal(signum := getattr(signal, name, signal.SIGTERM)) is signal.SIG_IGN:
                signal.signal(signum, signal.SIG_DFL)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Long tests run where all are asked for, or they themselves: by a marker, by -k or by name."""
    asked = config.option.markexpr or config.option.keyword or any("::" in word for word in config.args)
    if not asked and not config.option.all:
        long = [item for item in items if item.get_closest_marker("slow")]
        config.hook.pytest_deselected(items=long)
        items[:] = [item for item in items if item not in set(long)]
    cases, rest = Counter[str](), []
    for item in items:
        test = item.nodeid.partition("[")[0]
        if cases[test] % config.option.every:
            rest.append(item)
        cases[test] += 1
    if rest:
        config.hook.pytest_deselected(items=rest)
        items[:] = [item for item in items if item not in set(rest)]


def pytest_collection_finish() -> None:
    """What is loaded by now stays: searches for garbage need not look through it each time."""
    gc.freeze()


@pytest.fixture(scope="session")
def root() -> Path:
    """The checkout: models/, runs/ and so on lie in it."""
    return ROOT


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    """Commands, and what they say."""
    return Shell(capsys)


@pytest.fixture(autouse=True)
def errors_are_one_line(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Every error of icmj that a test meets, whether it looks for it or not."""
    longer: list[str] = []

    def note(error: IcmjError, *words: object) -> None:
        Exception.__init__(error, *words)
        longer.extend(words for words in [str(error)] if "\n" in words)

    monkeypatch.setattr(IcmjError, "__init__", note)
    yield
    assert not longer


@pytest.fixture(autouse=True)
def no_callback_left() -> Iterator[None]:
    """MuJoCo's callbacks are process-global; whoever installs one must take it off again."""
    yield
    import sys

    if (mujoco := sys.modules.get("mujoco")) is not None:
        assert not [name for name in dir(mujoco) if name.startswith("get_mjcb_") and getattr(mujoco, name)()]
