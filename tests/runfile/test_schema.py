"""A run file changed in code says what it is: its text, its fingerprint, and what it may still claim of the paper."""

import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from icmj.errors import RunFileError
from icmj.runfile.plant_tables import Actual
from icmj.runfile.reading import load_run, parse_run
from icmj.runfile.schema import RunFile, overridden, to_toml


def test_text_as_read_stays_to_the_letter(root):
    for path in sorted((root / "runs").glob("*.toml")):
        assert load_run(path).text == path.read_text(encoding="utf-8")


def test_a_changed_run_file_says_so_whatever_way_it_was_changed(root):
    run = load_run(root / "runs" / "three-link-0.9.toml")
    for changed in (run.with_(**{"actual.gain": 0.85}), run.model_copy(update={"actual": Actual(gain=0.85)})):
        again = parse_run(changed.text, changed.path)
        assert again.actual.gain == 0.85
        assert again.design == run.design
        assert again.simulation == run.simulation
        assert again.text == changed.text
        assert "0.85" in changed.text


def test_values_of_every_kind_survive(root):
    run = load_run(root / "runs" / "three-link-0.9.toml").with_(**{
        "case.title": 'A "quoted" title, ζ = \\0.1',
        "actual.change": [{"what": "mass", "of": "trunk", "factor": 1.1}, {"what": "gravity", "value": [0, 0, -1.6]}],
        "simulation.disturbance": [{"kind": "step", "input": "hip_torque", "size": 1e-12}],
        "simulation.integrator": "Euler",
        "controller.Q_t": [[1.0, 0.5], [0.5, 2.0]],
        "actual.gain": [0.9, 1.0, 1 / 3],
    })  # fmt: skip
    again = parse_run(run.text, run.path)
    assert again.model_dump() == run.model_dump()


def test_files_of_older_versions_may_say_that_runs_are_compiled(root):
    path = root / "runs" / "three-link-0.9.toml"
    text = path.read_text(encoding="utf-8")
    assert "native" not in text
    older = text.replace("[simulation]\n", "[simulation]\nnative = true\n")
    assert older != text
    run = parse_run(older, path)
    assert run.simulation == load_run(path).simulation
    assert "native" not in run.with_(**{"simulation.duration": 1.0}).text
    words = r"simulation: native = false is no longer a key: set the environment variable ICMJ_INTERPRETED=1, with"
    for wrong in (
        lambda: parse_run(older.replace("native = true", "native = false"), path),
        lambda: overridden(run, ["simulation.native=false"]),
        lambda: run.with_(**{"simulation.native": False}),
    ):
        with pytest.raises(RunFileError, match=words) as caught:
            wrong()
        assert "\n" not in str(caught.value)


PLAIN = st.recursive(
    st.booleans() | st.integers(-(2**60), 2**60) | st.floats(allow_nan=False) | st.text(st.characters(codec="utf-8")),
    lambda inner: st.lists(inner, max_size=3),
)


@settings(max_examples=200)
@given(
    st.dictionaries(
        st.text(st.characters(codec="utf-8"), min_size=1),
        PLAIN | st.dictionaries(st.text(min_size=1), PLAIN, max_size=3),
        max_size=4,
    )
)
def test_toml_reads_back_what_was_written(data):
    assert tomllib.loads(to_toml(data)) == data


def test_unknown_keys_are_one_line(root):
    run = load_run(root / "runs" / "simple-0.8.toml")
    with pytest.raises(RunFileError, match=r"simple-0.8.toml: actual.gian: no such key; did you mean gain"):
        run.with_(**{"actual.gian": 1})
    with pytest.raises(RunFileError, match=r"actual.gain.x: gain is no table"):
        run.with_(**{"actual.gain.x": 1})


def test_the_paper_does_not_speak_of_a_changed_copy(root):
    run = load_run(root / "runs" / "simple-0.8.toml")
    assert run.case.paper.delta_crit == 1.8
    assert not run.disowned
    for harmless in ({"simulation.duration": 9.0}, {"controller.q_t": 0.1}, {"case.title": "mine"}):
        assert run.with_(**harmless).case.paper == run.case.paper
    for other in ({"actual.gain": 0.85}, {"design.R_c": 1.0}, {"controller.hold": "zero-order"}):
        copy = run.with_(**other)
        assert copy.disowned
        assert copy.case.paper.delta_crit is None
        assert copy.fingerprint != run.fingerprint
    text = run.text.replace("gain = 0.8 ", "gain = 0.85 ")
    assert parse_run(text, run.path).disowned


@pytest.mark.parametrize(
    ("controller", "words"),
    [
        ("event", "controller: expected a table, got 'event'"),
        ({"kind": None}, "controller: kind must be 'intermittent', 'predictor', 'switching', 'delayed-pid' or"),
        ({"kind": "switching", "channel": []}, "controller.channel: has 0 entries; expected at least 1"),
        ({"kind": "switching"}, "controller.position is missing"),
    ],
)
def test_a_controller_that_is_none_is_told_what_it_may_be(root, controller, words):
    data = tomllib.loads((root / "runs" / "simple-0.8.toml").read_text(encoding="utf-8"))
    with pytest.raises(RunFileError) as told:
        RunFile.validated(data | {"controller": controller}, Path("a.toml"))
    assert words in str(told.value)
