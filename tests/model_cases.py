"""Small MJCF models that a user could bring, as text, each with one property that is easily got wrong."""

from __future__ import annotations

from pathlib import Path


def pendulum(actuator: str, *, joint: str = "", key: str = 'qpos="0"', sensor: str = "", body: str = "") -> str:
    """An inverted pendulum of 70 kg and 0.9 m with the actuator, and more, given as MJCF."""
    return f"""
<mujoco model="brought">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="RK4"><flag contact="disable"/></option>
  <worldbody>
    <body name="rod"><joint name="lean" axis="0 1 0" {joint}/>
      <inertial pos="0 0 0.9" mass="70" diaginertia="6 6 1"/>
      <site name="top" pos="0 0 1.8"/>{body}</body>
  </worldbody>
  <actuator>{actuator}</actuator>
  <sensor><jointpos name="angle" joint="lean"/>{sensor}</sensor>
  <keyframe><key name="stand" {key}/></keyframe>
</mujoco>"""


MOTOR = '<motor name="ankle" joint="lean"/>'
SERVO = '<position name="ankle" joint="lean" kp="400"/>'
MUSCLE = (
    '<muscle name="ankle" joint="lean" ctrllimited="false" force="600" range="0.75 1.05" lengthrange="-1 1" '
    'gear="-1" timeconst="0.01 0.04"/>'
)
BIASED = '<general name="ankle" joint="lean" gainprm="2" biastype="affine" biasprm="5 -30 -4"/>'


def written(folder: Path, text: str, name: str = "model.xml") -> Path:
    """The model as a file."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path
