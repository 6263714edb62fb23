"""Models made by a grammar: legal MJCF, as nasty as the format allows, and run files that speak of them.

All joints, actuators, sensors, equalities and tendons, masses and springs of any size, odd keyframes, mocap bodies.
"""

import random
from pathlib import Path

from grammar_runs import Names, number, positive, run_command, run_tables, toml

FLAGS = """
contact constraint energy gravity equality limit damper spring actuation eulerdamp warmstart sensor invdiscrete
multiccd clampctrl sleep frictionloss island override fwdinv filterparent refsafe
"""
ENABLED = ("energy", "invdiscrete", "multiccd", "sleep", "override", "fwdinv")


def _row(*values: float) -> str:
    return " ".join(f"{value:.6g}" for value in values)


class Model:
    """A model under way: its text, and what there is to refer to."""

    def __init__(self, rng: random.Random) -> None:
        self.rng = rng
        self.joints: list[str] = []  # of one degree of freedom
        self.balls: list[str] = []
        self.free: list[str] = []
        self.bodies: list[str] = []
        self.sites: list[str] = []
        self.geoms: list[str] = []
        self.tendons: list[str] = []
        self.actuators: list[str] = []
        self.sensors: list[str] = []
        self.nq = self.nv = self.nmocap = 0

    def some(self, share: float, **attributes: object) -> str:
        """A part of these attributes, as text; a value may be a function of nothing."""
        kept = [(key.rstrip("_"), value) for key, value in attributes.items() if self.rng.random() < share]
        return "".join(f' {key}="{value() if callable(value) else value}"' for key, value in kept)

    def any(self, *usual: float, count: int = 1, least: float = -1e12) -> str:
        return _row(*(number(self.rng, *usual, low=least) for _ in range(count)))

    def name(self, kind: str, known: list[str]) -> str:
        i, odd = len(known), (f"{kind} ", f"ζ{kind}", f"{kind}.", f"[{kind}]", "y")
        name = f"{kind}{i}" if self.rng.random() < 0.93 else f"{self.rng.choice(odd)}{i}"
        known.append(name)
        return name

    def body(self, depth: int) -> str:
        rng, name = self.rng, self.name("body", self.bodies)
        inner = self.joint(depth) + self.inertia()
        for _ in range(rng.choice((0, 0, 1, 2))):
            inner += self.geom()
        for _ in range(rng.choice((0, 1, 1))):
            place = self.some(0.7, pos=lambda: self.any(0.1, 0.0, count=3))
            inner += f'<site name="{self.name("site", self.sites)}"{place}/>'
        for _ in range(rng.choice((0, 1, 1, 2)) if depth < 3 else 0):
            inner += self.body(depth + 1)
        place = self.some(0.8, pos=f"0 0 {self.any(0.5, 1.0)}") + self.some(0.05, gravcomp=lambda: self.any(1.0, 0.5))
        place += self.some(0.05, euler=lambda: self.any(0.5, 90.0, count=3))
        return f'<body name="{name}"{place}>{inner}</body>'

    def joint(self, depth: int) -> str:
        rng = self.rng
        kinds = ("hinge", "slide", "ball", "free", "two", "none")
        kind = rng.choices(kinds, (8, 2, 1, 1 if depth == 0 else 0, 1, 0.5))[0]
        if kind == "none":
            return ""
        if kind == "free":
            name = self.name("free", self.free)
            self.nq, self.nv = self.nq + 7, self.nv + 6
            damping = self.some(0.2, damping=lambda: self.any(1.0, least=0))
            return rng.choice((f'<freejoint name="{name}"/>', f'<joint type="free" name="{name}"{damping}/>'))
        if kind == "ball":
            name = self.name("ball", self.balls)
            self.nq, self.nv = self.nq + 4, self.nv + 3
            limits = self.some(0.15, range=f"0 {self.any(1.0, 3.0, least=1e-3)}")
            return f'<joint type="ball" name="{name}"{self.passive()}{limits}/>'
        text = ""
        for one in (kind,) if kind != "two" else ("hinge", rng.choice(("hinge", "slide"))):
            name = self.name("joint", self.joints)
            self.nq, self.nv = self.nq + 1, self.nv + 1
            axis = rng.choice(("0 1 0", "0 1 0", "0 1 0", "1 0 0", "0 0 1", self.any(1.0, count=3)))
            low, high = -positive(rng, 1.0), positive(rng, 1.0, 2.0)
            limits = self.some(0.15, range=_row(low, high))
            limits += self.some(0.05, actuatorfrcrange=f"{-abs(high)} {abs(high)}")
            limits += self.some(0.04, limited=lambda: rng.choice(("true", "false", "auto")))
            limits += self.some(0.04, ref=lambda: self.any(0.1), springref=lambda: self.any(0.2))
            text += f'<joint type="{one}" name="{name}" axis="{axis}"{self.passive()}{limits}/>'
        return text

    def passive(self) -> str:
        most = 1 if self.rng.random() < 0.9 else 3
        text = self.some(
            0.3, stiffness=lambda: self.any(1.0, 10.0, count=most),
            damping=lambda: self.any(0.1, 1.0, count=most, least=0),
        )  # fmt: skip
        text += self.some(
            0.1, armature=lambda: self.any(0.01, 1.0, least=0), frictionloss=lambda: self.any(0.1, least=0)
        )
        return text + self.some(
            0.03, springdamper="0.1 1", margin=lambda: self.any(0.01), solreflimit="-100 -1", solimplimit=".9 .9 .1",
            group="2", pos=lambda: self.any(0.1, count=3),
        )  # fmt: skip

    def inertia(self) -> str:
        rng = self.rng
        if rng.random() < 0.3:
            return self.geom(True)
        mass, i = positive(rng, 1.0, 10.0, low=1e-12), positive(rng, 0.1, 1.0, low=1e-12)
        tensor = rng.choice((_row(i, i, i), _row(i, i, i / 2), _row(i, i * 1e-3, i), _row(i, i, 1e-12 * i)))
        if rng.random() < 0.1:
            return f'<inertial pos="0 0 0.5" mass="{mass:.6g}" fullinertia="{_row(i, i, i, 0, 0, i / 10)}"/>'
        place = f"{self.any(0.0, 0.1, count=2)} {self.any(0.5)}"
        return f'<inertial pos="{place}" mass="{mass:.6g}" diaginertia="{tensor}"/>'

    def geom(self, heavy: bool = False) -> str:
        rng = self.rng
        kind, size = rng.choice((("sphere", 1), ("capsule", 2), ("ellipsoid", 3), ("cylinder", 2), ("box", 3)))
        sizes = _row(*(positive(rng, 0.05, 0.1, low=1e-6, high=1e6) for _ in range(size)))
        text = f'<geom name="{self.name("geom", self.geoms)}" type="{kind}" size="{sizes}"'
        if heavy:
            text += f' mass="{positive(rng, 1.0):.6g}"'
        else:
            text += self.some(0.5, mass="0") + self.some(0.1, density=lambda: self.any(1000.0, least=0))
        if rng.random() < 0.75:
            text += ' contype="0" conaffinity="0"'
        text += self.some(
            0.05, condim=lambda: rng.choice("1346"), friction=lambda: self.any(1.0, count=3, least=0), margin="0.01",
            gap="0.001", solref=lambda: rng.choice(("0.02 1", "-1e5 -1e3", "1e-6 1")), solmix="2", priority="1",
            fluidshape="ellipsoid",
        )  # fmt: skip
        return text + "/>"

    def tendon(self) -> str:
        rng, name = self.rng, f"tendon{len(self.tendons)}"
        common = self.some(0.2, stiffness=lambda: self.any(10.0, least=0), damping=lambda: self.any(1.0, least=0))
        common += self.some(
            0.06, frictionloss=lambda: self.any(0.1, least=0), range="-1 1",
            springlength=lambda: rng.choice(("0.1", "0.1 0.5")), armature="0.1", actuatorfrcrange="-1 1", margin="0.01",
            limited="auto",
        )  # fmt: skip
        if len(self.sites) > 1 and rng.random() < 0.5:
            path = [f'<site site="{site}"/>' for site in rng.sample(self.sites, 2)]
            round_ = [geom for geom in self.geoms if rng.random() < 0.1][:1]
            path[1:1] = [f'<geom geom="{geom}"/>' for geom in round_] if rng.random() < 0.3 else []
            if rng.random() < 0.2 and len(self.sites) > 3:
                path += ['<pulley divisor="2"/>', *(f'<site site="{site}"/>' for site in rng.sample(self.sites, 2))]
            self.tendons.append(name)
            return f'<spatial name="{name}"{common}>{"".join(path)}</spatial>'
        if not self.joints:
            return ""
        inner = "".join(
            f'<joint joint="{joint}" coef="{self.any(1.0, -1.0, 0.0)}"/>'
            for joint in rng.sample(self.joints, rng.randint(1, min(3, len(self.joints))))
        )
        self.tendons.append(name)
        return f'<fixed name="{name}"{common}>{inner}</fixed>'

    def actuator(self) -> str:
        rng = self.rng
        ways = [f'joint="{joint}"' for joint in self.joints] + [f'tendon="{tendon}"' for tendon in self.tendons]
        ways += [f'joint="{joint}" gear="{self.any(1.0, count=3)}"' for joint in self.balls]
        ways += [f'joint="{joint}" gear="{self.any(1.0, 0.0, count=6)}"' for joint in self.free]
        ways += [f'site="{site}" gear="{self.any(1.0, 0.0, count=6)}"' for site in self.sites[:1]]
        ways += [f'jointinparent="{joint}"' for joint in self.balls]
        if len(self.sites) > 1:
            ways.append(f'cranksite="{self.sites[0]}" slidersite="{self.sites[1]}" cranklength="1"')
            ways.append(f'site="{self.sites[0]}" refsite="{self.sites[1]}" gear="1 0 0 0 0 0"')
        if not ways:
            return ""
        servo = {"kv": lambda: self.any(1.0, least=0), "timeconst": lambda: self.any(0.1, 0.0, least=0)}
        muscle = {
            "timeconst": "0.01 0.04", "range": "0.75 1.05", "force": lambda: self.any(100.0),
            "scale": lambda: self.any(200.0), "tausmooth": "0.1",
        }  # fmt: skip
        general = {
            "gaintype": lambda: rng.choice(("fixed", "affine")), "biastype": lambda: rng.choice(("none", "affine")),
            "gainprm": lambda: self.any(1.0, count=3), "biasprm": lambda: self.any(1.0, -1.0, 0.0, count=3),
            "actlimited": "true", "actrange": "-1 1", "actearly": "true",
        }  # fmt: skip
        length = {"lengthrange": "0.1 1"}  # without one MuJoCo looks for it, for half a minute at times
        dynamics = ("none", "integrator", "filter", "filterexact", 'user" actdim="2', 'user" actdim="3')
        kind, own = rng.choice((
            *(("motor", ""),) * 8,
            ("position", f' kp="{self.any(10.0, least=0)}"{self.some(0.3, **servo)}'),
            ("position", f' dampratio="{self.any(1.0, least=0)}"'),
            ("velocity", f' kv="{self.any(1.0, least=0)}"'),
            ("intvelocity", f' kp="{self.any(10.0, least=0)}" actrange="-1 1"'),
            ("damper", ' kv="1" ctrlrange="0 1"'),
            ("cylinder", f' timeconst="{self.any(0.1, 1.0)}" area="{self.any(1.0)}" bias="1 2 3"'),
            ("muscle", self.some(0.9, **length) + self.some(0.3, **muscle)),
            *(
                ("general", f' dyntype="{dyn}" dynprm="{self.any(0.1, 10.0, count=2)}"{self.some(0.3, **general)}')
                for dyn in dynamics
            ),
        ))  # fmt: skip
        if "actrange" not in own:
            own = own.replace(' actlimited="true"', "")
        both = "" if "ctrlrange" in own else self.some(
            0.06, ctrlrange="-1 1", forcerange=lambda: f"{-positive(rng, 1.0):.6g} 1", delay="0.05", nsample="8",
            group="1", ctrllimited="false",
        )  # fmt: skip
        if "delay" in both and "nsample" not in both:
            both += ' nsample="60"'
        if kind == "muscle":
            ways = [way for way in ways if "site" not in way and "gear" not in way] or ways
        way = rng.choice(ways)
        gear = self.some(0.1, gear=lambda: self.any(1.0, 50.0, -1.0, 0.0)) if "gear" not in way else ""
        return f'<{kind} name="{self.name("act", self.actuators)}" {way}{gear}{own}{both}/>'

    def sensor(self) -> str:
        rng = self.rng
        of_site = "gyro accelerometer velocimeter force torque touch magnetometer rangefinder"
        frames = ("pos", "quat", "xaxis", "linvel", "angvel", "linacc", "angacc")
        kinds: list[tuple[str, str]] = []
        for names, what, sensors in (
            (self.joints, "joint", "jointpos jointpos jointvel"),
            (self.joints[:1], "joint", "jointactuatorfrc jointactuatorfrc jointlimitfrc"),
            (self.balls, "joint", "ballquat ballangvel"),
            (self.tendons, "tendon", "tendonpos tendonvel tendonactuatorfrc"),
            (self.actuators[:2], "actuator", "actuatorpos actuatorvel actuatorfrc"),
            (self.sites[:2], "site", of_site),
        ):
            kinds += [(kind, f'{what}="{name}"') for name in names for kind in sensors.split()]
        for body in self.bodies[:3]:
            kinds += [(kind, f'body="{body}"') for kind in ("subtreecom", "subtreelinvel", "subtreeangmom")]
            kinds += [(f"frame{what}", f'objtype="body" objname="{body}"') for what in frames]
        kinds += [("clock", ""), ("e_kinetic", ""), ("e_potential", ""), ("user", 'dim="2"')]
        kind, of = rng.choice(kinds)
        more = self.some(
            0.05, noise="0.1", cutoff=lambda: self.any(1.0, least=0), delay="0.05", nsample="8", interval="0.01"
        )
        if "delay" in more and "nsample" not in more:
            more += ' nsample="60"'
        return f'<{kind} name="{self.name("sensor", self.sensors)}" {of}{more}/>'

    def equality(self) -> str:
        rng, found = self.rng, []
        five = self.any(0.0, 1.0, count=5)
        if len(self.joints) > 1:
            found.append(f'<joint joint1="{self.joints[0]}" joint2="{self.joints[-1]}" polycoef="{five}"{{}}/>')
        if self.joints:
            found.append(f'<joint joint1="{self.joints[0]}" polycoef="{self.any(0.0)} 0 0 0 0"{{}}/>')
        if len(self.bodies) > 1:
            found.append(f'<weld body1="{self.bodies[0]}" body2="{self.bodies[-1]}"{{}}/>')
        found.append(f'<connect body1="{self.bodies[-1]}" anchor="{self.any(0.1, 0.0, count=3)}"{{}}/>')
        if self.tendons:
            found.append(f'<tendon tendon1="{self.tendons[0]}"{{}}/>')
        more = {"active": "false", "solref": lambda: rng.choice(("0.02 1", "-1e4 -10", "1e-5 1"))}
        return rng.choice(found).format(self.some(0.2, **more))

    def keyframe(self, name: str) -> str:
        rng = self.rng
        qpos = [number(rng, 0.0, 0.0, 0.1) for _ in range(self.nq)]
        rows = self.some(0.5, qpos=_row(*qpos)) if self.nq else ""
        rows += self.some(0.1, qvel=lambda: self.any(0.0, 1.0, count=self.nv)) if self.nv else ""
        rows += self.some(0.2, ctrl=lambda: self.any(0.0, 1.0, count=len(self.actuators))) if self.actuators else ""
        if self.nmocap:
            rows += self.some(
                0.4, mpos=lambda: self.any(0.0, 1.0, count=3 * self.nmocap),
                mquat=lambda: self.any(1.0, 0.0, count=4 * self.nmocap),
            )  # fmt: skip
        return f'<key name="{name}"{rows}{self.some(0.1, time=lambda: self.any(1.0))}/>'

    def option(self) -> str:
        rng = self.rng
        flags = self.some(0.08, **{flag: "enable" if flag in ENABLED else "disable" for flag in FLAGS.split()})
        more = self.some(
            0.2, integrator=lambda: rng.choice(("Euler", "RK4", "implicit", "implicitfast")),
            timestep=lambda: self.any(0.002, 0.001, least=1e-15),
        )  # fmt: skip
        more += self.some(
            0.05, wind=lambda: self.any(0.0, 1.0, count=3), density=lambda: self.any(1.2, 1000.0, least=0),
            viscosity=lambda: self.any(1e-5, 1.0, least=0), cone="elliptic",
            solver=lambda: rng.choice(("PGS", "CG", "Newton")), iterations=lambda: rng.choice(("0", "1", "100")),
            jacobian=lambda: rng.choice(("dense", "sparse")), impratio="100", tolerance="0", noslip_iterations="3",
        )  # fmt: skip
        usual = ("0 0 -9.81", "0 0 -9.81", "0 0 -1", "0 0 0")
        gravity = rng.choice((*usual, f"0 0 {self.any(9.81)}", self.any(1.0, count=3)))
        return f'<option gravity="{gravity}"{more}><flag{flags}/></option>'

    def text(self) -> str:
        """The whole of it."""
        rng = self.rng
        world = "".join(self.body(0) for _ in range(rng.choice((1, 1, 1, 2))))
        if rng.random() < 0.1:
            held = '<geom size="0.1" contype="0" conaffinity="0"/><site name="held"/>'
            world += f'<body name="mocap0" mocap="true" pos="0 0 2">{held}</body>'
            self.nmocap = 1
            self.sites.append("held")
        if rng.random() < 0.2:
            world += '<geom name="floor" type="plane" size="1 1 .1" pos="0 0 -1"/>'
        tendons = "".join(self.tendon() for _ in range(rng.choice((0, 0, 1, 2))))
        actuators = "".join(self.actuator() for _ in range(rng.choice((1, 1, 1, 2, 3))))
        sensors = "".join(self.sensor() for _ in range(rng.choice((0, 1, 1, 2, 3))))
        equality = "".join(self.equality() for _ in range(rng.choice((0, 0, 0, 0, 0, 1, 2))))
        keys = "".join(self.keyframe(f"key{i}") for i in range(rng.choice((0, 1, 1, 2))))
        contact = ""
        if len(self.bodies) > 1 and rng.random() < 0.1:
            contact = f'<contact><exclude body1="{self.bodies[0]}" body2="{self.bodies[-1]}"/></contact>'
        given = self.some(
            0.05, autolimits="false", balanceinertia="true", boundmass="0.01", boundinertia="1e-4", settotalmass="80",
            fusestatic="true", discardvisual="true", inertiafromgeom="true", eulerseq="zyx",
        )  # fmt: skip
        custom = '<custom><numeric name="n" data="1 2"/><text name="t" data="a"/></custom>' * (rng.random() < 0.05)
        name = rng.choice(("m", "ζ", "a b", "[red]x[/]"))
        return (
            f'<mujoco model="{name}"><compiler angle="radian"{given}/>{self.option()}{custom}'
            f"<worldbody>{world}</worldbody>{contact}<tendon>{tendons}</tendon><actuator>{actuators}</actuator><sensor>{sensors}</sensor>"
            f"<equality>{equality}</equality><keyframe>{keys}</keyframe></mujoco>"
        )


def grammar_model(rng: random.Random, folder: Path) -> list[str]:
    """A model in ``folder``, with a run file where it takes one, and the command to put it to."""
    model = Model(rng)
    text = model.text()
    (folder / "model.xml").write_text(text, encoding="utf-8")
    keys = [f"key{i}" for i in range(text.count("<key "))]
    what = rng.random()
    if what < 0.4:
        options = (
            ["--json"], ["--full"], ["--outputs", "joints"],
            ["--operating-point", rng.choice(("balance", "static control", "as given"))],
            ["--out", "out.npz"], ["--keyframe", "key0"],
        )  # fmt: skip
        return ["linearise", "model.xml", *(word for option in options if rng.random() < 0.25 for word in option)]
    if what < 0.6:
        return ["new", "model.xml", "--out", "out.toml"]
    joints = [*model.joints, *model.balls, *model.free]
    there = (found or ["none"] for found in (joints, model.actuators, model.sensors))
    names = Names({"model": "model.xml"}, *there, model.bodies, keys)
    tables = run_tables(rng, names)
    if rng.random() < 0.7:  # but for the model, nothing strange
        tables["assumed"] = {"model": "model.xml", "outputs": rng.choice(("joints", model.sensors[:1] or "joints"))}
        if keys and rng.random() < 0.5:
            tables["assumed"]["keyframe"] = keys[0]
        tables |= {"design": {}, "controller": {"q_t": 0.01}, "actual": {"gain": 0.8}}
        tables["simulation"] = {"duration": rng.choice((0.01, 0.3, 1.0))}
    (folder / "case.toml").write_text(toml(tables), encoding="utf-8")
    return run_command(rng, names)
