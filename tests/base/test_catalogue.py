"""Things of one kind by name, imported when asked for; and names that have moved."""

import importlib
import sys

import pytest

import icmj
from icmj.base.catalogue import Catalogue, find_moved


@pytest.fixture
def shelf(tmp_path, monkeypatch):
    for name in ("one", "two"):
        (tmp_path / "shelf_of_test").mkdir(exist_ok=True)
        (tmp_path / "shelf_of_test" / f"{name}.py").write_text(f"NUMBER = {len(name)}\n{name.upper()} = 1\n", "utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    yield Catalogue("shelf_of_test", ("two", "one"))
    for name in [name for name in sys.modules if name.startswith("shelf_of_test")]:
        del sys.modules[name]


def test_a_thing_is_imported_when_it_is_asked_for(shelf):
    assert not [name for name in sys.modules if name.startswith("shelf_of_test.")]
    assert shelf["one"].NUMBER == 3
    assert "shelf_of_test.two" not in sys.modules
    assert [module.__name__ for module in shelf] == ["shelf_of_test.two", "shelf_of_test.one"]
    assert shelf.collect("ONE") == (1,)
    assert shelf.collect("NUMBER") == (3, 3)
    with pytest.raises(KeyError):
        shelf["three"]


MOVED = {
    "icmj.controller.trigger": ("EventTrigger", "BoxTrigger", "as_weight", "output_weight"),
    "icmj.controller.delayed": ("PredictorController", "DelayedPID", "SwitchingPD", "SwitchingChannels", "Channel"),
    "icmj.fitting": (
        *("Bank", "Family", "TrialOf", "public_trials", "read_bank", "read_trials", "simulate_bank"),
        *("Identification", "Observed", "Unknown"),
    ),
    "icmj.study": ("Fit", "Subject"),
}


@pytest.mark.parametrize(("module", "name"), [(module, name) for module, names in MOVED.items() for name in names])
def test_a_public_name_that_has_moved_is_found_with_a_warning(module, name):
    with pytest.warns(DeprecationWarning, match=rf"{module}\.{name} is now icmj\.\S+\.{name}$") as told:
        found = getattr(importlib.import_module(module), name)
    assert told[0].filename == __file__
    rooms = (icmj, icmj.controller, icmj.fits, icmj.identification)
    assert found is next(getattr(room, name) for room in rooms if hasattr(room, name))


def test_what_was_never_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match=r"module 'icmj.controller.trigger' has no attribute 'Nonsense'"):
        _ = importlib.import_module("icmj.controller.trigger").Nonsense
    with pytest.raises(AttributeError):
        find_moved("a", "b", {})
