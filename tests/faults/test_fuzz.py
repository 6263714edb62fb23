"""Mutants, and what grammars make: accepted, or refused in one line, in ten seconds or with progress, in 2 GB.

For an hour of it: ``python -m tests.fuzz --minutes 60``.
"""

import random
import tomllib
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import pytest
from fuzz_cases import KINDS, NUMBERS, VALUES, hunt
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import BaseModel
from terminal_cases import told

from icmj import RunFile, parse_run
from icmj.cli.main import main
from icmj.errors import RunFileError

SECONDS = 1.5  # of each kind


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_mutants(kind: str, pytestconfig: pytest.Config) -> None:
    given_seed, mutants = pytestconfig.getoption("--seed"), pytestconfig.getoption("--mutants")
    seed = random.randrange(10**8) if given_seed is None else given_seed
    tally = hunt(kind, range(seed, seed + (mutants or 10**6)), 1e9 if mutants else SECONDS)
    print(f"{kind} from seed {seed}: {tally}")
    assert not tally.failures, f"{kind}: {tally}\n" + "\n".join(tally.failures)
    assert tally.done > 0


def numbers() -> st.SearchStrategy[Any]:
    odd = st.sampled_from([0, 1, -1, 1e-3, 1e308, 5e-324])
    return st.one_of(st.floats(), st.integers(), st.integers(-(10**40), 10**40), odd)


anything = st.recursive(
    st.one_of(numbers(), st.booleans(), st.text(max_size=20)),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=8), inner, max_size=4)),
    max_leaves=8,
)


def of(annotation: Any) -> st.SearchStrategy[Any]:
    """What the schema may mean, good or bad: now and then anything at all."""
    if get_origin(annotation) is Annotated:
        return of(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        return st.one_of(*[of(member) for member in get_args(annotation) if member is not NoneType])
    if get_origin(annotation) is Literal:
        return st.one_of(st.sampled_from(get_args(annotation)), st.text(max_size=12))
    if get_origin(annotation) is list:
        return st.lists(of(get_args(annotation)[0]), max_size=4)
    if get_origin(annotation) is dict:
        return st.dictionaries(st.sampled_from(["hinge", "ankle", "ζ", ""]), of(get_args(annotation)[1]), max_size=3)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return table(annotation)
    return {float: numbers(), int: numbers(), bool: st.booleans(), str: st.text(max_size=30)}.get(annotation, anything)


def table(model: type[BaseModel]) -> st.SearchStrategy[dict[str, Any]]:
    keys = {name: st.one_of(of(field.annotation), anything) for name, field in model.model_fields.items()}
    return st.fixed_dictionaries({}, optional=keys | {"qt": anything})


@pytest.mark.slow
@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
@given(table(RunFile))
def test_any_tables_are_read_or_refused_in_words_for_people(data: dict[str, Any]) -> None:
    from pydantic import ValidationError

    from icmj.runfile.messages import in_words

    try:
        RunFile.model_validate(data)
    except ValidationError as error:
        words = in_words(error, RunFile)
        assert words
        for jargon in ("Input should", "permitted", "Annotated", "typing", "pydantic", "NoneType", "<class"):
            assert jargon not in words.replace(repr(data), "")


@settings(max_examples=300, deadline=None)
@given(st.text(max_size=200))
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        parse_run(text)
    except RunFileError as error:
        assert "\n" not in str(error)  # noqa: PT017


RUN = """
[case]
name = "a"
title = "A"
[assumed]
model = "{root}/models/pendulum.xml"
keyframe = "upright"
[actual]
gain = 0.8
[controller]
q_t = 0.01
"""

# what once ended in a traceback, or in nothing for a long time
CORPUS = (
    *("[design]\nQ_c = [[1, 2], [3]]", "[design]\nQ_o = [[1, 2], [3, 4]]", "[design]\nR_c = [1, 1]"),
    *("[design]\nR_c = 1e12", "[design]\nR_o = 1e-15", "[design]\nQ_c = [0, 0]", "[design]\nQ_c = [1e12, 1e-15]"),
    *("Q_t = [0, 0]", "Q_t = [[1, 2], [3]]", "Q_t = [1, 2, 3]", "Q_t = [[0, 1], [0, 0]]", "Q_t = [1e12, 0]"),
    *("delta_min = 1e12", "delta_min = 1e-300", "hold = 'zero-order'\ndelta_min = 0"),
    *("[actual.dynprm]\ntorque = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]", "[actual.dynprm]\nnobody = [1]"),
    *("[analysis]\ndelta_max = 1e-6", "[analysis]\ndelta_max = 1e4"),
    *("[simulation]\ninitial = { hinge = 1e12 }", "[simulation]\ninitial = { knee = 1 }"),
    *("[simulation]\nduration = 1e-12\ntimestep = 2", "[study]\nattractor_starts = 2\ngrowth_points = 0"),
    *("[simulation]\nduration = 1e-12", "[simulation]\nduration = 1e12\nrecord_interval = 1e12"),
)


@pytest.mark.slow
@pytest.mark.parametrize("more", CORPUS, ids=range(len(CORPUS)))
def test_the_corpus(more, root, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    text = RUN.format(root=root) + more + ("" if "[study]" in more else "\n[study]\ngrowth_points = 0")
    text += "" if "[simulation]" in more else "\n[simulation]\nduration = 10.0"
    (tmp_path / "a.toml").write_text(text, encoding="utf-8")
    for command in (
        ["analyse", "a.toml", "--json"],
        ["run", "a.toml", "--plant", "linear", "--out", "out"],
        ["run", "a.toml", "--out", "mujoco"],
    ):
        status, err = main(command), capfd.readouterr().err
        lines = told(err)
        assert "Traceback" not in err
        assert (status, len(lines)) in ((0, 0), (2, 1)), err
        if status == 2:
            assert not (tmp_path / command[-1]).exists()


def test_hostile_values_are_what_they_are_meant_to_be() -> None:
    """Most are TOML, so that they come as far as the schema."""
    good = 0
    for value in (*VALUES, *NUMBERS):
        try:
            tomllib.loads(f"a = {value}")
            good += 1
        except ValueError:
            pass
    assert good > 0.8 * len((*VALUES, *NUMBERS))
