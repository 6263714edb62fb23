"""Switched feedback of several joints: against its equation, the one-joint controller, and the method of steps."""

from dataclasses import replace

import numpy as np
import pytest
from oracles.delay import of_law
from tapped_cases import BODY, SWITCHING

from icmj import LinearPlant, Settings
from icmj.controller.channels import Channel, SwitchingChannels
from icmj.errors import AnalysisError
from icmj.linear.run import simulate

# two links on each other, coupled, both falling
STIFF = np.array([[2.2, -0.8], [-0.9, 3.1]])
TWO = LinearPlant(
    np.block([[np.zeros((2, 2)), np.eye(2)], [STIFF, -0.3 * np.eye(2)]]),
    np.vstack([np.zeros((2, 2)), np.array([[0.02, -0.015], [-0.015, 0.05]])]), np.eye(4),
    ("q1", "q2", "v1", "v2"), ("ankle", "hip"), ("theta", "phi", "omega", "psi"),
)  # fmt: skip
ANKLE = Channel("theta", "omega", 260.0, 60.0, "ankle", slope=-0.5, dead_zone=0.003)
HIP = Channel("phi", "psi", 150.0, 25.0, "hip", slope=-0.6)
STEADY = replace(HIP, switches=False)
PENDULUM = Channel({"theta": 0.7, "phi": 0.3}, {"omega": 0.7, "psi": 0.3}, 200.0, 50.0, "ankle", slope=-0.4)


def _commanded(channels: tuple[Channel, ...], y: np.ndarray) -> np.ndarray:
    """The command by the equation of each channel."""
    u = np.zeros(2)
    for channel in channels:
        position, rate = channel.rows(TWO.outputs)
        theta, omega = position @ y, rate @ y
        on = theta * (omega - channel.slope * theta) > 0 and theta**2 + omega**2 > channel.dead_zone**2
        if on or not channel.switches:
            u[TWO.inputs.index(channel.input)] -= channel.P * theta + channel.D * omega
    return u


@pytest.mark.parametrize("channels", [(ANKLE, HIP), (ANKLE, STEADY), (PENDULUM, HIP), (PENDULUM, ANKLE, STEADY)])
def test_it_commands_what_the_equation_of_each_channel_says(channels: tuple[Channel, ...]) -> None:
    real, random, seen = SwitchingChannels(TWO, channels, 0.1).realisation, np.random.default_rng(3), set()
    assert len(real.modes) == 2 ** sum(channel.switches for channel in channels)
    for y in 0.01 * random.standard_normal((1500, 4)):
        mode = real.following(int(random.integers(len(real.modes))), y)
        seen.add(mode)
        assert -real.modes[mode].S @ y == pytest.approx(_commanded(channels, y), rel=1e-12, abs=1e-15)
    assert seen == set(range(len(real.modes)))


def test_one_channel_is_the_one_joint_controller() -> None:
    law = SWITCHING
    channel = Channel("theta", "omega", float(law.P[0]), float(law.D[0]), slope=law.slope, dead_zone=law.dead_zone)
    settings = Settings(duration=20.0)
    laws = (SwitchingChannels(BODY, (channel,), law.delay), law)
    mine, known = (simulate(BODY, each, settings, x0=[0.01, 0.0]) for each in laws)
    np.testing.assert_array_equal(mine.x, known.x)
    assert mine.modes == known.modes == ("on", "off")


@pytest.mark.parametrize("channels", [(ANKLE, HIP), (PENDULUM, STEADY)])
def test_it_moves_as_the_method_of_steps_says(channels: tuple[Channel, ...]) -> None:
    law, x0 = SwitchingChannels(TWO, channels, 0.1), np.array([0.02, -0.01, 0.0, 0.05])
    run = simulate(TWO, law, Settings(duration=2.0, record_interval=0.05), x0=x0)
    motion = of_law(TWO, law, x0).run(2.0)
    assert len(run.events) > 2
    assert run.events.t == pytest.approx(motion.switches, abs=1e-9)
    expected = np.array([motion.z(t) for t in run.t])
    assert np.abs(run.x - expected).max() < 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize(("make", "words"), [
    (lambda: SwitchingChannels(TWO, (), 0.1), "at least one channel"),
    (lambda: SwitchingChannels(TWO, (ANKLE,), 0.0), "must be positive"),
    (lambda: SwitchingChannels(TWO, (HIP,) * 6, 0.1), "at most 5 channels can switch"),
    (lambda: SwitchingChannels(TWO, (replace(HIP, input=""),), 0.1), "name the input of each channel"),
    (lambda: SwitchingChannels(TWO, (replace(HIP, rate="knee"),), 0.1), "the plant's outputs are theta, phi"),
    (lambda: SwitchingChannels(TWO, (replace(HIP, rate={"phi": 2.0}),), 0.1), "the same combination"),
    (lambda: SwitchingChannels(TWO, (replace(HIP, position={"phi": 0.0}),), 0.1), "not all zero"),
    (lambda: replace(HIP, P=np.inf), "P of a channel must be a finite number"),
    (lambda: replace(HIP, dead_zone=-1.0), "dead zone of a channel"),
])  # fmt: skip
def test_what_makes_no_sense_is_refused(make, words: str) -> None:
    with pytest.raises(AnalysisError, match=words):
        make()
