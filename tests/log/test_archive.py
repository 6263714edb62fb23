"""The archive alone, without a file: what goes in comes out, and nothing else can."""

import json
from dataclasses import replace

import numpy as np
import pytest
from log_cases import assert_same, awkward, made_up, standing

from icmj.errors import LogError
from icmj.log.archive import digest, pack, unpack
from icmj.simulation.pressure import Pressure
from icmj.theory.orbit_family import OrbitFamily


def test_pressure_comes_back_bit_for_bit_and_a_log_of_before_it_is_read() -> None:
    result = standing()
    assert_same(result, unpack(*pack(result)))
    assert isinstance(unpack(*pack(result)).simulation.pressure, Pressure)
    without = replace(result, simulation=replace(result.simulation, pressure=None))
    tree, arrays = pack(without)
    old = json.loads(tree)
    for simulation in ("simulation", "continuous"):
        assert old[simulation].pop("pressure", "none") is None
    assert_same(without, unpack(json.dumps(old), arrays))


def test_changed_values_come_back_and_a_log_of_before_they_were_kept_has_none() -> None:
    result, _ = made_up(duration=1.0)
    changed = replace(result, run=result.run.with_(**{"actual.gain": 1.3, "case.title": "Strong"}))
    tree, arrays = pack(changed)
    found = unpack(tree, arrays).run
    assert dict(found.changes) == {"actual.gain": "1.3", "case.title": '"Strong"'}
    assert found.changes_in_words == "Changed from the file: actual.gain = 1.3."
    assert found.title == "Strong"
    old = json.loads(tree)
    assert old["run"].pop("changes") == dict(found.changes)
    before = unpack(json.dumps(old), arrays).run
    assert (dict(before.changes), before.actual.gain) == ({}, 1.3)
    for bad in (["a", "b"], 3, "text"):
        with pytest.raises(LogError, match="not one of this version"):
            unpack(json.dumps(old | {"run": old["run"] | {"changes": bad}}), arrays)


def test_of_a_log_of_before_its_run_file_says_when_what_is_given_jumps() -> None:
    result, _ = made_up(duration=1.0)
    push = {"kind": "impulse", "input": result.actual.inputs[0], "size": 1e-3, "duration": 0.05}
    late = {"kind": "step", "input": result.actual.inputs[0], "size": 1e-3, "start": 1.5}
    pushed = replace(result, run=result.run.with_(**{"simulation.disturbance": [{**push, "start": 0.3}, late]}))
    tree, arrays = pack(pushed)
    old = json.loads(tree)
    for simulation in ("simulation", "continuous"):
        del old[simulation]["edges"]
    np.testing.assert_allclose(unpack(json.dumps(old), arrays).simulation.edges, [0.3, 0.35], rtol=0, atol=1e-15)
    assert len(unpack(tree, arrays).simulation.edges) == 0  # as it was written


def test_the_digest_sees_every_bit() -> None:
    tree, arrays = pack(awkward())
    before = digest(tree, arrays)
    assert digest(tree + " ", arrays) != before
    for key, values in arrays.items():
        if values.size:
            other = values.copy()
            other.view(np.uint8)[-1] ^= 1
            assert digest(tree, arrays | {key: other}) != before, key


def test_a_class_is_read_under_its_former_name_too() -> None:
    result, _ = made_up(duration=1.0)
    orbits = OrbitFamily(2, np.eye(4)[:, :2], 8, 5, 3, "five are admissible")
    tree, arrays = pack(replace(result, prediction=replace(result.prediction, family=orbits)))
    assert tree.count('"OrbitFamily"') == 1
    for text in (tree, tree.replace('"OrbitFamily"', '"Family"')):
        assert_same(orbits, unpack(text, arrays).prediction.family)


def test_only_known_classes_are_built() -> None:
    tree, arrays = pack(made_up(duration=1.0)[0])
    evil = json.loads(tree)
    evil["measurement"] = {"@": "Popen", "args": "true"}
    with pytest.raises(LogError, match="not one of this version"):
        unpack(json.dumps(evil), arrays)


@pytest.mark.parametrize(("tree", "says"), [("{", "version"), ("[]", "no result"), ('{"@": "Result"}', "version")])
def test_a_tree_that_is_no_result_is_refused(tree: str, says: str) -> None:
    with pytest.raises(LogError, match=says):
        unpack(tree, {})


def test_what_has_no_place_in_a_log_is_named() -> None:
    result, _ = made_up(duration=1.0)
    odd = replace(result, provenance={"hook": print})  # type: ignore[dict-item]
    with pytest.raises(LogError, match=r"provenance\.hook.*no place"):
        pack(odd)


def test_an_array_of_objects_is_not_made() -> None:
    tree, arrays = pack(made_up(duration=1.0)[0])
    with pytest.raises(LogError, match="array of object"):
        unpack(tree.replace('"dtype": "<f8"', '"dtype": "|O"'), arrays)


def test_a_log_of_before_the_catalogue_is_judged_by_its_orbit() -> None:
    """It called a cycle predicted by the paper's condition, and had one orbit."""
    result, _ = made_up(duration=1.0)
    assert_same(result, unpack(*pack(result)))
    for verdict, cycle in (("attracting", True), ("repelling", False)):
        told = replace(result.prediction, verdict=verdict, cycle=not cycle)
        tree, arrays = pack(replace(result, prediction=told))
        old = json.loads(tree)
        assert old["prediction"].pop("others") == {"@tuple": []}
        found = unpack(json.dumps(old), arrays).prediction
        assert (found.cycle, found.period is None, found.others) == (cycle, not cycle, ())
        assert [one.verdict for one in found.orbits] == [verdict]
    other = replace(result.prediction, others=result.prediction.orbits)
    catalogue = replace(result, prediction=other)
    assert_same(catalogue, unpack(*pack(catalogue)))
