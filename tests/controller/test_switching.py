"""The switching controller says of itself what its equation says."""

from dataclasses import replace

import numpy as np
import pytest

from icmj import LinearPlant, SwitchingPD
from icmj.errors import AnalysisError

BODY = LinearPlant(
    np.array([[0.0, 1.0], [2.0, -0.07]]), np.array([0.0, 1 / 60]), np.eye(2), ("lean", "lean_rate"), ("ankle",),
    ("theta", "omega"),
)  # fmt: skip
ASAI = SwitchingPD(BODY, "theta", "omega", P=147.0, D=10.0, delay=0.2, slope=-0.4, dead_zone=0.004)


def test_it_is_on_where_its_equation_says_so() -> None:
    real, random = ASAI.realisation, np.random.default_rng(5)
    seen = set()
    for theta, omega in 0.02 * random.standard_normal((4000, 2)):
        on = theta * (omega + 0.4 * theta) > 0 and theta**2 + omega**2 > 0.004**2
        for mode in (0, 1):
            following = real.modes[real.following(mode, np.array([theta, omega]))]
            assert following.name == ("on" if on else "off")
            u = -following.S @ np.array([theta, omega])
            assert u == pytest.approx([-(147 * theta + 10 * omega) if on else 0.0], rel=1e-14)
        seen.add(on)
    assert seen == {True, False}


def test_it_has_no_state_and_reads_late() -> None:
    real = ASAI.realisation
    assert real.layout.size == 0
    assert real.taps == (0.2,)
    assert real.tapped
    assert len(real.cuts) == 1  # no event rule


def test_unswitched_it_is_always_on() -> None:
    real = replace(ASAI, switches=False).realisation
    assert [mode.name for mode in real.modes] == ["on"]
    assert real.following(0, np.zeros(2)) == 0


@pytest.mark.parametrize(("wrong", "words"), [
    ({"position": "knee"}, "the plant's outputs are theta, omega"),
    ({"rate": "theta"}, "the same output, 'theta'; name two"),
    ({"P": np.nan}, "P must be a finite number"),
    ({"D": [1.0, 2.0]}, "one for each of the 1 inputs"),
    ({"delay": 0.0}, "must be positive"),
    ({"slope": np.inf}, "slope"),
    ({"dead_zone": -1.0}, "dead zone"),
])  # fmt: skip
def test_what_makes_no_sense_is_refused(wrong: dict, words: str) -> None:
    with pytest.raises(AnalysisError, match=words):
        replace(ASAI, **wrong)
