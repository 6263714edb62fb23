"""Settings, starts and endings: what is wrong is one line, and both simulators share one set of words."""

from dataclasses import fields

import numpy as np
import pytest
from linear_cases import PENDULUM, event_controller, pendulum_design

from icmj.errors import SimulationError
from icmj.runfile.run_tables import SimulationTable
from icmj.runfile.shapes import bias, gaussian, impulse, noise, step
from icmj.simulation import ending
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Bias, Gaussian, Impulse, Noise, Step
from icmj.simulation.start import start_states


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ({"duration": 0.0}, "duration must be positive"),
        ({"duration": float("inf")}, "duration must be positive and finite"),
        ({"timestep": -1e-3}, "timestep must be positive"),
        ({"limit": float("nan")}, "limit"),
        ({"record_interval": 1e-9}, "raise record_interval"),
        ({"initial": {"hinge": float("nan")}}, "initial.hinge must be finite"),
        ({"integrator": "rk45"}, "no integrator 'rk45'; expected one of RK4"),
    ],
)
def test_bad_settings_are_refused(bad: dict, words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        Settings(**bad)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Impulse("u", float("nan")),
        lambda: Impulse("u", 1.0, duration=0.0),
        lambda: Step("u", 1.0, start=-1.0),
        lambda: Noise("u", 0.0, 1.0, 1),
        lambda: Noise("u", 1.0, -1.0, 1),
        lambda: Noise("u", 1.0, 1.0, -1),
    ],
)
def test_bad_sources_are_refused(make) -> None:
    with pytest.raises(SimulationError, match=r"negative|positive|finite"):
        make()


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ({"size": 1.0, "bandwidth": 1.0}, "one of input, output, body and surface"),
        ({"input": "u", "output": "y", "size": 1.0, "bandwidth": 1.0}, "one of input, output, body and surface"),
        ({"output": "y", "size": 1.0}, "noise on 'y': give one of bandwidth and corner"),
        (
            {"output": "y", "size": 1.0, "bandwidth": 1.0, "corner": 1.0},
            "noise on 'y': give one of bandwidth and corner",
        ),
        ({"output": "y", "size": -1.0, "corner": 1.0}, "size -1.0 must be positive"),
        ({"output": "y", "size": float("inf"), "corner": 1.0}, "size must be finite"),
        ({"output": "y", "size": 1.0, "corner": 0.0}, "corner 0.0 Hz must be positive"),
        ({"output": "y", "size": 1.0, "corner": float("nan")}, "corner must be finite"),
        ({"output": "y", "size": 1.0, "corner": 1.0, "terms": 0}, "terms 0: expected between"),
        ({"output": "y", "size": 1.0, "corner": 1.0, "terms": 10**6}, "terms 1000000: expected between"),
    ],
)
def test_bad_noise_is_refused(bad: dict, words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        Noise(**bad)


def test_bad_bias_is_refused() -> None:
    with pytest.raises(SimulationError, match="bias: size must be finite"):
        Bias("y", float("nan"))
    with pytest.raises(SimulationError, match=r"bias on 'y': start -1\.0 s is negative"):
        Bias("y", 1.0, start=-1.0)


def test_only_noise_makes_a_run_noisy() -> None:
    assert not Settings(disturbance=(Step("u", 1.0), Bias("y", 1.0))).noisy
    assert Settings(disturbance=(Noise(output="y", size=1.0, corner=1.0),)).noisy


def test_the_run_file_s_tables_say_all_that_the_dataclasses_hold() -> None:
    pairs = [(SimulationTable, Settings), (impulse.DISTURBANCE, Impulse), (step.DISTURBANCE, Step)]
    pairs += [(noise.DISTURBANCE, Noise), (bias.DISTURBANCE, Bias), (gaussian.DISTURBANCE, Gaussian)]
    for table, data in pairs:
        assert set(table.model_fields) - {"kind", "vertical", "vertical_rate"} == {field.name for field in fields(data)}
    assert SimulationTable().settings() == Settings()


def test_starts_are_named_or_whole() -> None:
    controller = event_controller(pendulum_design())
    settings = Settings(initial={"hinge": 0.1}, observer={"hinge_rate": 0.2})
    x, a = start_states(PENDULUM, controller, settings)
    np.testing.assert_array_equal(x, [0.1, 0.0])
    np.testing.assert_array_equal(a, [0.0, 0.2, 0.0, 0.2])
    x, a = start_states(PENDULUM, controller, settings, [1, 2], [3, 4], [5, 6])
    np.testing.assert_array_equal(np.concatenate([x, a]), [1, 2, 3, 4, 5, 6])
    with pytest.raises(SimulationError, match="plant: no state 'knee'; its states are hinge, hinge_rate"):
        start_states(PENDULUM, controller, Settings(initial={"knee": 0.1}))
    with pytest.raises(SimulationError, match="hold: expected 2 finite numbers"):
        start_states(PENDULUM, controller, settings, x_h=[np.inf, 0])


def test_sliding_is_twenty_least_intervals_at_the_end() -> None:
    least, longer = np.full(20, 0.05), np.array([0.3])
    assert ending.end_complete(9.0, np.concatenate([longer, least]), 0.05).kind == "sliding"
    assert ending.end_complete(9.0, np.concatenate([least, longer]), 0.05).kind == "completed"
    assert ending.end_complete(9.0, least[:19], 0.05).kind == "completed"
    assert ending.end_complete(9.0, np.zeros(40), 0.0).kind == "completed"
    assert ending.end_complete(9.0, least * (1 + 1e-12), 0.05).kind == "sliding"
