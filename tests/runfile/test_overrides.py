"""Values changed from outside: what becomes of each kind of text, and one line for what cannot be put in."""

import pytest

from icmj.errors import RunFileError
from icmj.runfile.reading import load_run
from icmj.runfile.schema import overridden, place_of


@pytest.fixture(scope="module")
def run(root):
    return load_run(root / "runs" / "quiet-standing.toml")


def test_without_changes_it_is_the_same_run_file(run):
    assert overridden(run, ()) is run


@pytest.mark.parametrize(
    ("change", "attributes", "value"),
    [
        ("actual.gain=0.85", "actual.gain", 0.85),
        (" actual.gain = [0.9, 1, 1.1] ", "actual.gain", [0.9, 1, 1.1]),
        ("controller.hold=zero-order", "controller.hold", "zero-order"),
        ('controller.hold="zero-order"', "controller.hold", "zero-order"),
        ("simulation.limit=0.5", "simulation.limit", 0.5),
        ("simulation.initial={ hip = 0.1 }", "simulation.initial", {"hip": 0.1}),
        ("simulation.initial.hip=0.1", "simulation.initial", {"ankle": 0.002, "hip": 0.1}),
        ('case.title="a = b"', "case.title", "a = b"),
    ],
)
def test_a_value_is_toml_and_a_word_is_text(run, change, attributes, value):
    found = overridden(run, [change])
    for name in attributes.split("."):
        found = getattr(found, name)
    assert found == value


def test_what_was_changed_is_known_and_the_title_says_so(run):
    """Under the title "b = 0.9" stood a case with b = 1, of another person."""
    changed = overridden(run, ["actual.gain=1.0", "assumed.person.mass=68", "simulation.initial={ hip = 0.1 }"])
    said = {"actual.gain": "1", "assumed.person.mass": "68", "simulation.initial": "{ hip = 0.1 }"}
    assert dict(changed.changes) == said
    each = ", ".join(f"{key} = {value}" for key, value in said.items())
    assert changed.changes_in_words == f"Changed from the file: {each}."
    assert changed.title == f"{run.case.title} (changed)"
    assert changed.text.splitlines()[0] == f"# {run.path.name}: {changed.changes_in_words}"
    again = changed.with_(**{"controller.delta_min": 0.02})
    assert list(again.changes) == [*changed.changes, "controller.delta_min"]


def test_what_is_as_it_was_is_no_change(run):
    same = overridden(run, ["simulation.duration=60", "actual.gain=1.035"])
    for one in (run, same, run.resolve()):
        assert (dict(one.changes), one.changes_in_words, one.title) == ({}, "", run.case.title)


def test_a_title_of_its_own_is_left_as_it_is(run):
    named = overridden(run, ["actual.gain=0.8", "case.title=Weak", "case.name=weak"])
    assert named.title == "Weak"
    assert named.changes_in_words == "Changed from the file: actual.gain = 0.8."


def test_an_entry_of_a_list_goes_by_its_number(run):
    changed = overridden(run, ["simulation.disturbance[1].size=0.7"])
    before, after = run.simulation.disturbance, changed.simulation.disturbance
    assert [d.size for d in after] == [before[0].size, 0.7, *(d.size for d in before[2:])]


def test_changes_are_put_in_together_and_the_last_of_one_key_counts(run):
    box = ["controller.rule=box", "controller.threshold=0.01"]
    with pytest.raises(RunFileError, match="the box rule has no q_t"):
        overridden(run, box)
    changed = overridden(run, [*box, "controller.q_t=", "controller.Q_t="])
    assert (changed.controller.rule, changed.controller.threshold, changed.controller.q_t) == ("box", 0.01, None)
    assert overridden(run, ["actual.gain=2", "actual.gain=3"]).actual.gain == 3


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("actual.gian=1", "actual.gian: no such key; did you mean gain?"),
        ("q_t=1", r"q_t: no such key; it belongs in \[controller\]"),
        ("actual.gain=O.85", "actual.gain: expected a number or a list of numbers; got 'O.85'"),
        ("actual.gain", "expected KEY=VALUE"),
        ("=1", "expected KEY=VALUE"),
        ("case.name=", "case.name is missing"),
        ("actual.gain=[1", r"\[1 is not a value as TOML writes it"),
        ("actual.gain=1\nactual.rho=2", "is more than one value"),
        ("actual.gain=" + "[" * 5000, "is not a value as TOML writes it"),
        ("actual.gain=" + "9" * 5000, "is not a value as TOML writes it"),
        ("actual..gain=1", "is no key"),
        ("actual.=1", "is no key"),
        ("actual.gain.x=1", "gain is no table"),
        ("simulation.disturbance[6].size=1", r"disturbance has no entry \[6\]"),
        ("actual[0]=1", r"actual has no entry \[0\]"),
    ],
)
def test_what_cannot_be_put_in_is_one_line(run, change, words):
    with pytest.raises(RunFileError, match=words) as raised:
        overridden(run, [change])
    assert str(raised.value).startswith("--set ")
    assert "\n" not in str(raised.value)
    assert len(str(raised.value)) < 1000


def test_quotes_hold_dots_together():
    assert place_of('''actual.dynprm."left.leg"''') == ("actual", "dynprm", "left.leg")
    assert place_of("study.law_q_t[2]") == ("study", "law_q_t", 2)


def test_what_is_put_in_is_not_shared(run):
    thresholds = [0.1, 0.01]
    run.with_(**{"study.law_q_t": thresholds, "study.law_q_t[0]": 0.2})
    assert thresholds == [0.1, 0.01]


def test_a_value_that_is_put_back_has_not_changed(root) -> None:
    run = load_run(root / "runs" / "three-link-0.9.toml")
    there = run.with_(**{"actual.gain": 0.8, "assumed.delay": 0.1})
    assert there.with_(**{"actual.gain": 0.9}).changes == {"assumed.delay": "0.1"}
    back = there.with_(**{"actual.gain": 0.9, "assumed.delay": 0.0})
    assert (dict(back.changes), back.title) == ({}, run.case.title)
    # of a run that a log has, nobody knows what its file had
    logged = run.with_(**{"actual.gain": 0.8}).recall({"actual.gain": "0.8"})
    assert logged.with_(**{"actual.gain": 0.85}).with_(**{"actual.gain": 0.8}).changes == {"actual.gain": "0.8"}
