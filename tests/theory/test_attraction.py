"""Multipliers against simulation: started beside the orbit, does the exact simulator go back to it or leave?"""

import numpy as np
import pytest
from theory_cases import random_systems, shipped, started_beside

from icmj import EventTrigger, predict


@pytest.mark.slow
def test_random_orbits_attract_or_repel_as_their_multipliers_say():
    clear, repelling, disagreements = 0, 0, []
    for i, system in enumerate(random_systems(2024, 800)):
        trigger = EventTrigger(np.eye(system.n_hat), 0.01, 1e-4)
        prediction = predict(system, trigger, delta_max=2.0)
        if prediction.verdict not in ("attracting", "repelling"):
            continue
        largest = np.abs(prediction.multipliers).max()
        if 0.9 <= largest <= 1.1:
            continue
        clear += 1
        repelling += largest > 1
        if started_beside(system, trigger, prediction, i)[1] != (largest < 1):
            disagreements.append((i, float(largest)))
        if clear == 80:
            break
    assert clear == 80
    assert repelling >= 8  # both answers are tried
    assert disagreements == []


@pytest.mark.parametrize("case", ["b=0.8", "b=1.2", "b=1.7", "b=0.9 three-link", "b=1.1 three-link", "zeta=0.1"])
def test_shipped_orbits_attract_or_repel_as_their_multipliers_say(case):
    system = shipped(case)
    trigger = EventTrigger(np.eye(system.n_hat), 0.01)
    prediction = predict(system, trigger, delta_max=4.0)
    assert started_beside(system, trigger, prediction, 1)[1] == (prediction.verdict == "attracting")
    assert (prediction.verdict == "repelling") == (case == "b=1.7")
