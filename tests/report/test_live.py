"""The live page's loop against the simulators of icmj: the same events, from the same description, in a browser."""

import html
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from report_browser import CHROMIUM, chromium

import icmj
from icmj.cli.main import main
from icmj.engine.planar_chain import find_chain
from icmj.errors import ReportError
from icmj.report import live
from icmj.report.player import join_scripts, script

HERE = Path(__file__).parent
RUN = (HERE / "live_loop.js").read_text(encoding="utf-8")
# s, of an event: the same steps by the same rule; steps against exact motion; and of a switched law, whose events icmj
# finds on a curve through the steps, and the page by repeating the step
ENGINE, LINEAR, SWITCHED = 1e-9, 1e-6, 1e-8
# one at a time: the two together make a motion in which rounding grows to 1e-7 s in the course of the run
TORQUE = """
[[simulation.disturbance]]
kind = "noise"
input = "ankle_torque"
size = 0.5
bandwidth = 5.0
seed = 3
"""
READING = """
[[simulation.disturbance]]
kind = "noise"
output = "trunk"
size = 2e-4
corner = 0.5
seed = 4
"""
# what a loop could do wrong, as a change of its text
FAULTS = {
    "": ("", ""),
    "late": (
        "if (this.armed) fired = this.crosses(begin, length);",
        "if (this.armed) fired = this.levels[1][2 * this.face(this.levels[1])] >= 0;",
    ),
    "midpoint": ("(k[0][i] / 6 + k[1][i] / 3 + k[2][i] / 3 + k[3][i] / 6)", "k[1][i]"),
    "least": ("Math.max(settings.least, this.faces ? settings.delay : 0)", "this.faces ? settings.delay : 0"),
}
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here; on Debian: apt-get install chromium")


@pytest.fixture
def small(monkeypatch):
    """Descriptions without a table over b and delay, which these tests do not read."""
    monkeypatch.setattr(live, "GAINS", (1.0, 1.0))
    monkeypatch.setattr(live, "STEP", 1.0)
    monkeypatch.setattr(live, "DELAYS", (0.0, 0.1))


def loaded(name, extra="", **changes):
    run = icmj.load_run(name)
    if extra:
        run = icmj.parse_run(run.text + extra, run.path)
    run = run.with_(**changes) if changes else run
    return icmj.prepare(run)


def simulated(case, plant):
    return icmj.simulate(case, plant)


def job(model, end, fault="", pieces=1, **settings):
    return {"model": model, "end": end, "fault": fault, "pieces": pieces, "settings": settings}


def run_jobs(folder, jobs, theory=(), shapes=()):
    """What the loop does in Chromium, for each job."""
    source, loops = str(join_scripts("loop.js")), []
    for name, (right, wrong) in FAULTS.items():
        assert not name or source.count(right) == 1, name
        changed = source.replace(right, wrong) if name else source
        loops.append(f"{json.dumps(name)}: (() => {{ {changed}\nreturn Loop; }})()")
    code = f"const loops = {{ {', '.join(loops)} }};\n{join_scripts('theory.js', 'body.js')}\n{RUN}"
    data = "".join(
        f'<script type="application/json" id="{key}">{script(value)}</script>'
        for key, value in (("jobs", {"jobs": jobs, "theory": list(theory)}), ("shapes", list(shapes)))
    )
    page = folder / "loop.html"
    page.write_text(f'<meta charset="utf-8"><body>{data}<script type="module">{code}</script></body>', encoding="utf-8")
    done = chromium(folder, "--dump-dom", page.as_uri())
    match = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.S)
    assert match, done.stderr[-2000:]
    return json.loads(html.unescape(match[1]))


def apart(found, simulation, growth=0.0, threshold=1.0):
    """The largest difference of the times of all events [s]; infinity where their numbers differ.

    Of it is taken what rounding becomes where an unstable mode of the plant multiplies it by e^{``growth`` Δ} over the
    longest interval so far, beside a threshold: with an exact model intervals of half a minute come.
    """
    times = simulation.events.t
    if len(times) != len(found["events"]):
        return np.inf
    longest = np.maximum.accumulate(np.diff(times, prepend=0.0))
    rounding = np.finfo(float).eps * np.exp(growth * longest) / threshold if growth else 0.0
    return float((np.abs(np.array(found["events"]) - times) - rounding).max())


PERSON = {
    "b 0.9": {},
    "b 1.1": {"actual.gain": 1.1},
    "b 0.9, small": {"controller.q_t": 1e-4},
    "b 1.1, small": {"actual.gain": 1.1, "controller.q_t": 1e-4},
    "least": {"controller.delta_min": 0.3},
    "delay": {"assumed.delay": 0.1},
}
SLIDERS = {"actual.gain": "b", "controller.q_t": "q", "controller.delta_min": "least", "assumed.delay": "delay"}


@needs_chromium
@pytest.mark.browser
@pytest.mark.slow
def test_events_come_when_the_engine_says_so_and_with_a_fault_they_do_not(small, tmp_path):
    """One description, whose sliders are moved, against a run of icmj for each place of them."""
    model = live.describe(loaded("three-link-0.9"))
    cases = {name: loaded("three-link-0.9", **changes) for name, changes in PERSON.items()}
    jobs = [job(model, 30.0, **{SLIDERS[key]: value for key, value in of.items()}, noise=0) for of in PERSON.values()]
    for name, noise in (("noise of torque", TORQUE), ("noise of a reading", READING)):
        cases[name] = loaded("three-link-0.9", noise)
        jobs.append(job(live.describe(cases[name]), 30.0))
    jobs += [job(model, 30.0, fault) for fault in ("late", "midpoint")]
    jobs.append(job(model, 30.0, "least", least=0.3))
    found = run_jobs(tmp_path, jobs)["runs"]
    runs = {name: icmj.simulate(case, "mujoco") for name, case in cases.items()}
    for (name, run), mine in zip(runs.items(), found, strict=False):
        assert len(run.events) > 30, name
        assert apart(mine, run) < ENGINE, name
    late, midpoint, least = found[-3:]
    assert apart(late, runs["b 0.9"]) > ENGINE
    assert apart(midpoint, runs["b 0.9"]) > ENGINE
    assert apart(least, runs["least"]) > ENGINE


@needs_chromium
@pytest.mark.browser
@pytest.mark.slow
def test_the_motion_does_not_hang_on_who_looks_on(small, tmp_path):
    """To the last bit: a run in one go, in frames of a sixtieth of a second, and in frames of no simple length."""
    model = live.describe(loaded("three-link-0.9", TORQUE + READING))
    found = run_jobs(tmp_path, [job(model, 12.0, pieces=pieces) for pieces in (1, 720, 977)])["runs"]
    assert len(found[0]["events"]) > 10
    assert found[0]["events"] == found[1]["events"] == found[2]["events"]


@needs_chromium
@pytest.mark.browser
@pytest.mark.slow
def test_every_shipped_case_agrees_or_is_refused_with_its_reason(small, root, tmp_path, capsys):
    """On the engine's plant where the page has it, and on the linear plant."""
    refused, cases = {}, {}
    for path in sorted((root / "runs").rglob("*.toml")):
        try:
            case = loaded(path)
            cases[path.stem] = case, live.describe(case)
        except ReportError as error:
            refused[path.stem] = str(error)
    assert set(refused) == {"one-link-predictor", "three-link-predictor"}
    assert all("own commands" in words and "\n" not in words for words in refused.values())
    assert main(["live", str(root / "runs/rivals/one-link-predictor.toml"), "-o", str(tmp_path / "no.html")]) == 2
    assert "own commands" in capsys.readouterr().err
    assert not (tmp_path / "no.html").exists()
    jobs, runs = [], []
    for name, (case, model) in cases.items():
        for plant in ("mujoco", "linear"):
            if plant == "linear" or model["plant"]["chain"]:
                run = simulated(case, plant)
                jobs.append(job(model, float(run.t[-1]), linear=plant == "linear"))
                runs.append((name, plant, run))
    assert sum(plant == "mujoco" for _, plant, _ in runs) >= 15
    for (name, plant, run), mine in zip(runs, run_jobs(tmp_path, jobs)["runs"], strict=True):
        case, model = cases[name]
        bound = LINEAR if plant == "linear" else ENGINE if case.theory else SWITCHED
        growth = float(np.linalg.eigvals(case.actual.linearisation.plant.A).real.max())
        if len(run.events):
            assert apart(mine, run, growth, model["q"]) < bound, (name, plant)
        else:
            assert mine["events"] == [], (name, plant)
        assert mine["ended"] == ("fell" if "fell" in run.outcome.message else ""), (name, plant)
        if not len(run.events) and abs(mine["t"] - run.t[-1]) < 1e-9:
            size = np.abs(run.x).max() or 1.0
            assert np.abs(np.array(mine["w"][: run.x.shape[1]]) - run.x[-1]).max() < 1e-6 * size, (name, plant)


@needs_chromium
@pytest.mark.browser
@pytest.mark.slow
def test_the_page_draws_the_eigenvalues_of_the_theory_and_outlines_from_any_side(tmp_path, monkeypatch):
    """φ(Δ_crit) has the eigenvalue λ; no point of an ellipsoid is outside its outline, and some are on it."""
    monkeypatch.setattr(live, "GAINS", (0.9, 0.9))
    monkeypatch.setattr(live, "STEP", 0.1)
    monkeypatch.setattr(live, "DELAYS", (0.0, 0.1))
    theory = []
    for b, delay in ((0.9, 0.0), (0.9, 0.1), (1.1, 0.0), (1.1, 0.1)):
        case = loaded("three-link-0.9", **{"actual.gain": b, "assumed.delay": delay or None})
        theory.append({
            "model": live.describe(case), "b": b, "delay": delay, "delta": case.prediction.delta_crit,
        })  # fmt: skip
    random, shapes = np.random.default_rng(5), []
    for yaw, pitch in ((0.0, 0.0), (0.7, 0.1), (2.5, -0.4), (4.0, 1.2)):
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
        axes = (np.diag([0.1, 0.05, 0.2]) @ turn).tolist()
        shapes.append({"axes": axes, "view": {"yaw": yaw, "pitch": pitch}})
    found = run_jobs(tmp_path, [], theory, shapes)
    for each, values in zip(theory, found["eigenvalues"], strict=True):
        expected = 1.0 if each["b"] < 1 else -1.0
        values = np.array([complex(*value) for value in values])
        assert np.abs(values - expected).min() < 1e-6
        assert (np.abs(values) > 1 + 1e-6).sum() == 0
    points = random.normal(size=(40000, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    for shape, (long, short, angle) in zip(shapes, found["silhouettes"], strict=True):
        yaw, pitch = shape["view"]["yaw"], shape["view"]["pitch"]
        x, y, z = (points @ np.array(shape["axes"])).T
        deep = np.cos(yaw) * y - np.sin(yaw) * x
        seen = np.array([np.cos(yaw) * x + np.sin(yaw) * y, np.cos(pitch) * z + np.sin(pitch) * deep])
        c, s = np.cos(angle), np.sin(angle)
        outward = np.hypot((c * seen[0] + s * seen[1]) / long, (c * seen[1] - s * seen[0]) / short)
        assert 0.999 < outward.max() < 1 + 1e-9


def test_what_the_page_cannot_do_is_refused_in_one_line(small):
    person = icmj.load_run("three-link-0.9")
    pushed = (
        '\n[[simulation.disturbance]]\nkind = "impulse"\nbody = "trunk"\nforce = [1, 0, 0]\nsize = 1.0\nstart = 1.0\n'
    )
    late = {"assumed.delay": 0.1, "actual.delay": 0.12}
    for run, words in (
        (icmj.parse_run(person.text + pushed, person.path), "leave out the others"),
        (person.with_(**late), "leave out [actual] delay"),
        (person.with_(**{"controller.sampling_delay": 0.01}), "leave out sampling_delay"),
        (person.with_(**{"actual.gain": [0.9, 0.9, 1.0]}), "one positive number"),
    ):
        with pytest.raises(ReportError, match=re.escape(words)):
            live.describe(icmj.prepare(run))


@pytest.mark.parametrize(("changes", "exact"), [
    ({}, True),
    ({"assumed.person.mass": 68, "actual.person.mass": 80, "actual.gain": 1}, False),
    ({"assumed.person.mass": 68}, True),
])  # fmt: skip
def test_the_model_is_exact_at_b_1_where_body_and_model_are_the_same_else(small, changes, exact):
    case = loaded("three-link-0.9-delay", **changes)
    described = live.describe(case)
    assert described["exact"] is exact
    assert "b = " not in described["title"]  # which a slider moves
    assert described["title"].endswith("(changed)") is bool(changes)
    page = live.page(described)
    assert all(f"{key} = {value}" in page for key, value in changes.items())
    # the prediction says the same: an exact model has none
    rows = described["table"]["rows"]
    at = described["table"]["gains"].index(1.0) + len(described["table"]["gains"]) * described["delays"].index(0.1)
    assert (rows[at][0] < 0) is exact


@pytest.mark.parametrize(("b", "delay", "count"), [(1.3, 0.0, 4), (0.75, 0.1, 4), (1.3, 0.1, 4), (1.0, 0.0, 0)])
def test_the_page_has_every_orbit_with_the_verdict_that_analyse_gives_it(monkeypatch, b, delay, count):
    monkeypatch.setattr(live, "GAINS", (b, b))
    monkeypatch.setattr(live, "DELAYS", (delay,))
    table = live.describe(loaded("three-link-0.9", **{"assumed.delay": delay or None, "actual.gain": b}))["table"]
    found = loaded("three-link-0.9", **{"assumed.delay": delay or None, "actual.gain": b}).prediction
    shown, _, orbits = table["rows"][table["gains"].index(b)]
    assert len(found.orbits) == len(orbits) == count
    for (delta, sign, verdict, largest), one in zip(orbits, found.orbits, strict=True):
        assert delta == pytest.approx(one.crossing.delta, rel=1e-7)
        assert (sign, verdict) == (np.sign(one.crossing.eigenvalue.real), one.verdict)
        assert largest == pytest.approx(min(one.multiplier, 99.0), abs=1e-4)
    assert (shown >= 0) is bool(count)
    if count:
        assert orbits[shown][0] == pytest.approx(found.delta_crit, rel=1e-7)


def test_the_page_says_where_crossings_may_be_missing(small, monkeypatch):
    predict = live.predict
    monkeypatch.setattr(live, "predict", lambda *of, **more: replace(predict(*of, **more), unresolved=((0.5, 0.6),)))
    described = live.describe(loaded("simple-0.8"))
    assert all(
        row[1].startswith("crossings may be missing between 0.5 and 0.6 s") for row in described["table"]["rows"]
    )


def test_a_model_that_is_no_chain_gets_the_linear_plant_and_the_page_says_so(small, root):
    """A person on a floor is a chain to be drawn, and what the floor does to it is not in the links."""
    plant = icmj.load_plant(root / "models/three_link_floor.xml")
    links, why = find_chain(plant)
    assert links is not None
    assert "contacts" in why


def test_a_spring_on_a_tendon_is_found_to_be_more_than_links(root, tmp_path):
    """Where the links do not move as the engine moves the model, it is not taken for a chain."""
    text = (root / "models/three_link.xml").read_text(encoding="utf-8")
    path = tmp_path / "tied.xml"
    path.write_text(text.replace('<fixed name="thigh_angle">', '<fixed name="thigh_angle" stiffness="5">'), "utf-8")
    assert "more acts in it" in find_chain(icmj.load_plant(path))[1]


def test_the_links_move_as_the_closed_form_of_a_pendulum_on_a_cart(tmp_path):
    """A slide and a hinge, with a rotor, against Lagrange's equations."""
    text = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"><flag contact="disable"/></option>
      <worldbody><body>
        <joint name="x" type="slide" axis="1 0 0" damping="0.3"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
        <body><joint name="q" axis="0 1 0" armature="0.1" stiffness="3"/>
          <inertial pos="0 0 0.7" mass="1.5" diaginertia="0.2 0.2 0.2"/></body>
      </body></worldbody>
      <actuator><motor name="f" joint="x" gear="2"/><motor name="m" joint="q"/></actuator>
      <sensor><jointpos joint="q"/></sensor></mujoco>"""
    path = tmp_path / "cart.xml"
    path.write_text(text, encoding="utf-8")
    links, why = find_chain(icmj.load_plant(path))
    assert why == ""
    q, v, w, f, m = 0.4, 0.3, -1.2, 0.7, 0.5
    M, mass, l, inertia = 2.0, 1.5, 0.7, 0.2 + 0.1
    left = np.array([[M + mass, mass * l * np.cos(q)], [mass * l * np.cos(q), inertia + mass * l**2]])
    right = [2 * f - 0.3 * v + mass * l * w**2 * np.sin(q), m - 3 * q + mass * 9.81 * l * np.sin(q)]
    found = links(np.array([0.2, q, v, w]), np.array([f, m]))
    np.testing.assert_allclose(found, [v, w, *np.linalg.solve(left, right)], rtol=1e-12)
