"""Small MJCF models that a user could bring, as text, each with one property that is easily got wrong."""

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


TWO = """
<mujoco model="two">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="RK4"><flag contact="disable"/></option>
  <worldbody>
    <body name="cart"><joint name="x" type="slide" axis="1 0 0" damping="0.5"/>
      <inertial pos="0 0 0" mass="2" diaginertia="0.1 0.1 0.1"/>
      <body name="pole"><joint name="tilt" axis="0 1 0"/>
        <inertial pos="0 0 0.5" mass="1" diaginertia="0.02 0.02 0.02"/></body></body>
  </worldbody>
  <actuator>{actuators}</actuator>
  {sensors}
</mujoco>"""
PUSH, TURN = '<motor name="push" joint="x"/>', '<motor name="turn" joint="tilt" gear="20"/>'
SENSORS = ('<jointpos name="place" joint="x"/>', '<jointpos name="angle" joint="tilt"/>')


def two(folder: Path, order: int = 1, name: str = "two.xml", sensors: bool = True) -> Path:
    """A pole on a cart, both driven; actuators and sensors in this order or, for −1, in the other."""
    inside = f"<sensor>{''.join(SENSORS[::order])}</sensor>" if sensors else ""
    return written(folder, TWO.format(actuators="".join((PUSH, TURN)[::order]), sensors=inside), name)


# two inputs, three outputs of which one is a velocity, a ball joint, sensors of two entries, a weak actuator
RICH = """
<mujoco model="rich">
  <option gravity="0 0 -9.81" timestep="0.002" integrator="RK4"><flag constraint="disable"/></option>
  <worldbody>
    <body name="a"><joint name="lean" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 1" size="0.05"/>
      <body name="b" pos="0 0 1"><joint name="turn" axis="0 1 0" damping="2" stiffness="5"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.6" size="0.04"/>
        <body name="c" pos="0.1 0 0"><joint name="hang" type="ball" damping="0.3"/>
          <geom type="capsule" fromto="0 0 0 0.05 0 -0.4" size="0.03"/></body></body></body>
  </worldbody>
  <actuator><motor name="low" joint="lean" gear="3"/><motor name="high" joint="turn"/></actuator>
  <sensor>
    <jointpos name="lean" joint="lean"/><jointpos name="turn" joint="turn"/><jointvel name="spin" joint="turn"/>
  </sensor>
  <keyframe><key name="up" qpos="0.1 -0.1 1 0 0 0" ctrl="1 2"/></keyframe>
</mujoco>
"""

# a rod on a rope to a hook that a keyframe lifts and turns; the rope is at rest where the hook is in the file
HOOKED = """
<mujoco model="hooked">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="RK4"><flag contact="disable"/></option>
  <worldbody>
    <frame pos="0.1 0 0"><body name="hook" mocap="true" pos="0 0 1.2" euler="0 0.3 0">
      <site name="tip" pos="0.1 0 0"/></body></frame>
    <body name="rod"><joint name="lean" axis="0 1 0" damping="2"/><joint name="roll" axis="1 0 0" damping="3"/>
      <inertial pos="0 0 0.5" mass="5" diaginertia="0.5 0.5 0.1"/>
      <site name="top" pos="0 0 1"/></body>
  </worldbody>
  <tendon><spatial name="rope" stiffness="300" damping="1"><site site="tip"/><site site="top"/></spatial></tendon>
  <actuator><motor name="ankle" joint="lean"/><motor name="side" joint="roll"/></actuator>
  <sensor>
    <jointpos name="lean" joint="lean"/><jointpos name="roll" joint="roll"/>
    <framepos name="seen" objtype="site" objname="top" reftype="xbody" refname="hook"/>
  </sensor>
  <keyframe><key name="aside" mpos="0.05 0 1.5" mquat="0.9 0.1 -0.3 0.2" ctrl="3 -1"/></keyframe>
</mujoco>"""

_SHIPPED = (Path(__file__).parents[1] / "models" / "pendulum.xml").read_text(encoding="utf-8")
CROWDED = (
    _SHIPPED.replace("<worldbody>", '<size memory="{memory}"/>\n<worldbody>')
    .replace('<flag constraint="disable" contact="disable"/>', "")
    .replace(
        '<geom name="bob" type="sphere" pos="0 0 1" size="0.09" rgba="0 0.45 0.70 1" mass="0" contype="0" '
        'conaffinity="0"/>',
        "".join(f'<geom type="box" pos="0 {0.01 * i} 1" size="0.2 0.2 0.2" mass="0"/>' for i in range(30)),
    )
    .replace(
        "</worldbody>",
        "".join(
            f'<geom type="box" pos="{0.9 + 0.02 * i} {0.01 * j} 0.3" size="0.3 0.3 0.3"/>'
            for i in range(10)
            for j in range(10)
        )
        + "</worldbody>",
    )
)
"""The pendulum, ``memory`` to be filled in, falls among many boxes, whose contacts need more than there is."""
