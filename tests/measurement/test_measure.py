"""What a measure of sway is: its signal against closed forms, its options within their bounds, and what is refused."""

import copy
import pickle

import numpy as np
import pytest

from icmj import Series, measure_sway
from icmj.base.array import NonNegative
from icmj.errors import DataError
from icmj.measurement import Number, Signal, define_measure
from icmj.measurement.measures import MEASURES, choose_measures, find_measure, list_options, numbers_of

T = np.arange(6000) / 100


@define_measure("beyond", "share beyond", of=["coordinate"])
def beyond(signal: Signal, *, within: tuple[NonNegative, NonNegative] = (0.0, 1.0), most: int = 3) -> float:
    """Share of the samples that are farther from the mean than a distance.

    Args:
        signal: a coordinate.
        within: distances between which samples count [unit].
        most: a whole number.
    """
    return float(np.mean((signal.distance >= within[0]) & (signal.distance < within[1])))


def signal_of(values):
    return Signal(values, 0.01, np.linspace(0, 50, 11), np.ones(11))


def test_a_circle_and_a_line_have_the_paths_and_distances_of_geometry():
    turn = 2 * np.pi * np.arange(6001) / 6000
    circle = signal_of(np.column_stack([5 + 2 * np.cos(turn), 2 * np.sin(turn) - 1])[:-1])
    assert circle.planar
    assert circle.mean == pytest.approx([5, -1])
    assert circle.distance == pytest.approx(2)
    chord = 2 * 2 * np.sin(np.pi / 6000)
    assert circle.path == pytest.approx(5999 * chord, rel=1e-12)
    line = signal_of(np.linspace(1, 4, 301))
    assert (line.path, float(line.mean)) == pytest.approx((3, 2.5))
    assert line.about == pytest.approx(np.linspace(-1.5, 1.5, 301), abs=1e-12)
    assert line.duration == pytest.approx(3.01)


def test_a_measure_of_ones_own_stands_beside_the_others_with_its_options():
    series = Series(T, np.cos(np.pi * T)[:, None], ("x",), ("m",))
    found = measure_sway(series, measures=[beyond], within=(0.0, np.sqrt(0.5)))
    assert found.coordinates[0].beyond == pytest.approx(0.5, abs=0.01)  # of a cosine, half is within 1/√2
    assert found.coordinates[0].number("beyond") == found.coordinates[0].beyond
    assert measure_sway(series, measures=[beyond.with_options(within=(0.0, 0.0))]).coordinates[0].beyond == 0
    assert not hasattr(measure_sway(series).coordinates[0], "beyond")
    for again in (copy.deepcopy(found), pickle.loads(pickle.dumps(found))):
        assert dict(again.coordinates[0].numbers) == pytest.approx(dict(found.coordinates[0].numbers), nan_ok=True)


@pytest.mark.parametrize(("options", "words"), [
    ({"within": (0.0, -1.0)}, "within: -1.0; expected at least 0"),
    ({"within": (0.0,)}, "within: expected 2 values"),
    ({"within": "01"}, "within: expected 2 values"),
    ({"within": (0.0, "1")}, "within: expected float, got '1'"),
    ({"within": (0.0, True)}, "within: expected float, got True"),
    ({"most": 1.5}, "most: expected int, got 1.5"),
    ({"mosst": 1}, "no option 'mosst'; did you mean most?"),
])  # fmt: skip
def test_an_option_beyond_its_bounds_or_of_another_type_is_refused(options, words):
    with pytest.raises(DataError, match=words.replace("?", r"\?")):
        beyond.with_options(**options)


def test_what_is_no_measure_or_no_option_of_one_is_refused():
    with pytest.raises(DataError, match="no measure has an option 'bannd'; did you mean band"):
        choose_measures((), {"bannd": (0.0, 1.0)})
    with pytest.raises(DataError, match="expected a measure, or the name of one"):
        choose_measures([len], {})
    with pytest.raises(DataError, match="no measure 'stabilograms'; did you mean stabilogram"):
        find_measure("stabilograms")
    other = define_measure("other", numbers=[Number("frequency.mean", "another mean frequency", "Hz")])(
        lambda signal: 1.0
    )
    with pytest.raises(DataError, match=r"two measures have the key 'frequency\.mean'"):
        choose_measures([other], {})


def test_a_measure_that_is_asked_for_twice_or_is_standard_is_computed_once():
    assert choose_measures(MEASURES.names, {}) == choose_measures((), {})
    assert choose_measures([beyond, beyond], {})[-1] is beyond
    assert numbers_of("coordinate", [beyond, find_measure("stabilogram")]) == (*numbers_of(), *beyond.numbers)


def test_every_measure_and_option_of_the_list_says_what_it_is():
    for name, option in list_options().items():
        assert option.meaning, name
    for measure in MEASURES.collect("MEASURE"):
        assert measure.compute.__doc__, measure.name
        assert all(number.words for number in measure.numbers), measure.name
