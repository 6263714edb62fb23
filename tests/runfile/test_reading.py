"""Run files: the shipped ones, and one clear line for each thing that can be wrong."""

import os

import pytest

from icmj.errors import RunFileError
from icmj.runfile.reading import load_run, parse_run

GOOD = """
[case]
name = "a"
title = "A"
[assumed]
model = "m.xml"
[controller]
q_t = 0.01
"""


def test_defaults_fill_what_is_not_said():
    run = parse_run(GOOD, "folder/a.toml")
    assert (run.controller.hold, run.controller.Q_t, run.actual.gain) == ("system-matched", "output", 1.0)
    assert run.assumed_path == run.actual_path
    assert run.assumed_path.parts == ("folder", "m.xml")
    assert run.text == GOOD


def test_shipped_run_files_are_the_eleven_cases(root):
    runs = [load_run(path) for path in sorted((root / "runs").glob("*.toml"))]
    assert [(r.path.stem, r.actual.gain, r.actual.dynprm.get("torque")) for r in runs] == [
        ("neglected-0.1", 1.0, [10.0, 0.1]),
        ("neglected-0.5", 1.0, [10.0, 0.5]),
        ("quiet-standing", 1.035, None),
        ("simple-0.8", 0.8, None),
        ("simple-1.2", 1.2, None),
        ("simple-1.7", 1.7, None),
        ("simple-exact", 1.0, None),
        ("three-link-0.9-delay", 0.9, None),
        ("three-link-0.9", 0.9, None),
        ("three-link-1.1-delay", 1.1, None),
        ("three-link-1.1", 1.1, None),
    ]
    assert all(r.path.stem == r.case.name for r in runs)


def test_values_the_paper_does_not_print_are_marked(root):
    for path in (root / "runs").glob("*.toml"):
        for line in path.read_text(encoding="utf-8").splitlines():
            if line.split("=")[0].strip() in ("Q_t", "q_t", "delta_min", "duration", "initial", "timestep"):
                assert "# ours" in line, f"{path.name}: {line}"


NOISE = '[[simulation.disturbance]]\nkind = "noise"\nsize = 1.0\nseed = 1\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = [\n3 = 4", ["not TOML", "line 2"]),
        (GOOD.replace("q_t = 0.01", "q_t = -1"), ["controller.q_t", "greater than 0", "-1"]),
        (GOOD.replace("q_t = 0.01", "q_t = inf"), ["controller.q_t", "finite"]),
        (GOOD + "qt = 3", ["controller.qt", "no such key", "did you mean q_t?"]),
        (GOOD.replace('name = "a"', 'name = "../a"'), ["case.name", "pattern"]),
        (GOOD.replace('[assumed]\nmodel = "m.xml"', ""), ["assumed", "missing"]),
        (GOOD + "[study]\nlaw_q_t = [1e-2]", ["law_q_t", "two"]),
        (GOOD + "[simulation]\nduration = 1e6", ["simulation", "record_interval", "1e+08"]),
        (GOOD + '[[simulation.disturbance]]\nkind = "step"\ninput = "u"', ["simulation", "size is required"]),
        (GOOD + '[[simulation.disturbance]]\nkind = "step"\nbody = "b"\nsize = 2.0', ["push on body 'b'", "a force"]),
        (GOOD + '[[simulation.disturbance]]\nkind = "step"\nbody = "b"\nforce = [1, 0]', ["force"]),
        (GOOD + '[[simulation.disturbance]]\nkind = "step"\ninput = "u"\nsize = 1.0\non = "floor"', ["on", "command"]),
        (GOOD + '[[simulation.disturbance]]\nkind = "storm"\ninput = "u"', ["disturbance", "storm"]),
        (
            GOOD + NOISE + 'input = "u"\noutput = "y"\ncorner = 1.0',
            ["simulation", "one of input, output, body and surface"],
        ),
        (GOOD + NOISE + "corner = 1.0", ["simulation", "one of input, output, body and surface"]),
        (GOOD + NOISE + 'output = "y"\ncorner = 1.0\nbandwidth = 2.0', ["simulation", "one of bandwidth and corner"]),
        (GOOD + NOISE + 'output = "y"', ["simulation", "one of bandwidth and corner"]),
        (GOOD + NOISE + 'output = "y"\ncorner = -1.0', ["corner", "greater than 0"]),
        (GOOD + NOISE + 'output = "y"\ncorner = inf', ["corner", "finite"]),
        (GOOD + '[[simulation.disturbance]]\nkind = "bias"\noutput = "y"\nsize = nan', ["size", "finite"]),
    ],
)
def test_errors_are_one_line_that_names_file_and_key(text, words):
    with pytest.raises(RunFileError) as caught:
        parse_run(text, "folder/a.toml")
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith("folder")
    for word in words:
        assert word in message


def test_files_that_cannot_be_read_are_named(tmp_path):
    with pytest.raises(RunFileError, match="cannot be read"):
        load_run(tmp_path / "none.toml")
    with pytest.raises(RunFileError, match="cannot be read"):
        load_run(tmp_path)
    (tmp_path / "b.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(RunFileError, match="UTF-8"):
        load_run(tmp_path / "b.toml")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (GOOD + "[design]\nR_c = [1, 2, -1]", "design.R_c[2]: must be greater than 0, got -1"),
        (GOOD + "[design]\nQ_c = 'outputs'", "design.Q_c: expected 'output', 'identity', a list of numbers or"),
        (GOOD + "[design]\nQ_c = [[1, 2], [1, 'a']]", "design.Q_c[1][1]: expected a number, got 'a'"),
        (GOOD + "[simulation]\nq_t = 3", "simulation.q_t: no such key; it belongs in [controller]"),
        (GOOD + "[actual]\nperson = { stiffness = 0.8 }", "actual.person.stiffness: expected a list of 3 numbers, got"),
        (GOOD + "[actual]\nperson = { stiffness = [0, 'a', 1] }", "person.stiffness[1]: expected a number, got 'a'"),
        (GOOD + "[analyis]\ndelta_max = 3", "analyis: no such key; did you mean analysis?"),
        (GOOD + "[simulation]\nlimit = -1.0", "simulation.limit: must be greater than 0, got -1.0"),
        (GOOD + "[simulation]\nlimit = { lean = -1.0 }", "simulation.limit.lean: must be greater than 0, got -1.0"),
        (GOOD + "[simulation]\nlimit = 'x'", "simulation.limit: expected a number or a table of names and values; got"),
        (GOOD + "[actual]\nperson = { hieght = 1.8 }", "actual.person.hieght: no such key; did you mean height?"),
        (GOOD + "[actual]\nmass = 68", "actual.mass: no such key; did you mean actual.person.mass?"),
        (GOOD + "[person]\nmass = 68", "person: no such key; it belongs in [assumed] or [actual]"),
        ("b = 0.8\n" + GOOD, "b: no such key; b is actual.gain"),
        (GOOD + "[actual]\nhieght = 1.8", "actual.hieght: no such key; did you mean actual.person.height?"),
        (GOOD + "[actual]\nactivation = { order = 3 }", "actual.activation.order: expected 0, 1 or 2, got 3"),
        (GOOD + "[actual]\nactivation = { order = 1, tau = 1 }", "activation.tau: no such key; there are damping"),
        (GOOD + "[actual]\nactivation = { time_constant = 1 }", "actual.activation.order is missing"),
        (GOOD + "[actual]\nactivation = { order = 1 }", "actual.activation: give a lag of order 1 a time_constant [s]"),
        (GOOD + "[actual]\nactivation = { order = 1, time_constant = {} }", "activation: time_constant names no input"),
        (
            GOOD + "[actual]\nactivation = { order = 2, time_constant = 0 }",
            "time_constant: must be greater than 0, got",
        ),
        (
            GOOD + "[actual]\nactivation = { order = 1, time_constant = { a = 0 } }",
            "actual.activation.time_constant.a: must be greater than 0, got 0",
        ),
        (
            GOOD + "[actual]\nactivation = { order = 1, frequency = 9 }",
            "actual.activation: a lag of order 1 has no frequency",
        ),
        (
            GOOD + "[actual]\nactivation = { order = 0, time_constant = 1 }",
            "actual.activation: a lag of order 0 has no time_constant",
        ),
        (
            GOOD + "[actual]\nactivation = { order = 2, time_constant = 1, frequency = 9 }",
            "give a lag of order 2 either a time_constant [s] or a frequency [rad/s]",
        ),
        (
            GOOD + "[actual]\nactivation = { order = 2, frequency = { a = 9 }, damping_ratio = { b = 1 } }",
            "actual.activation: damping_ratio names 'b', which is given no lag",
        ),
        (GOOD + "[simulation]\nintegrator = 'rk4'", "got 'rk4'; did you mean RK4?"),
        (
            GOOD + "[[simulation.disturbance]]\nkind = 'step'\nsize = 1.0\nduration = 1.0",
            "simulation.disturbance[0].duration: no such key; it belongs in [simulation]",
        ),
        (
            GOOD + "[[simulation.disturbance]]\nkind = 'step'\nsize = 1.0\ncorner = 1.0",
            "simulation.disturbance[0].corner: no such key; there are axis, body, force, "
            "input, kind, on, point, size, start, surface, torque, vertical, vertical_rate",
        ),
        (GOOD + "[[simulation.disturbance]]\ninput = 'u'", "disturbance[0]: kind is missing"),
        (GOOD.replace("0.01", "1e308"), "controller.q_t: must be at most 1e+12, got 1e+308"),
        (GOOD.replace("0.01", "5e-324"), "controller.q_t: must be at least 1e-15"),
        (GOOD + "[analysis]\ndelta_max = 5e-324", "analysis.delta_max: must be at least"),
        (GOOD + "[analysis]\ndelta_max = 1e308", "analysis.delta_max: must be at most 10000"),
        (GOOD + "[actual]\ndynprm = { a = [1,2,3,4,5,6,7,8,9,10,11] }", "actual.dynprm.a: has 11 entries"),
        (GOOD + f"Q_t = {[1] * 5000}", "controller.Q_t"),
        (GOOD + "x = " + "[" * 500 + "]" * 500, "nested too deeply"),
        (GOOD + "x = " + "1" * 5000, "an integer of thousands of digits"),
        (GOOD.replace('"A"', '"\\u001b[31mA"'), "case.title: holds control characters"),
        ("case = 3\nassumed = [1]\ncontroller = 'a'", "case: expected a table, got 3; assumed: expected a table"),
    ],
)
def test_what_is_wrong_is_said_for_people(text, words):
    with pytest.raises(RunFileError) as caught:
        parse_run(text)
    message = str(caught.value)
    assert words in message
    assert "\n" not in message
    assert "Input" not in message
    assert "permitted" not in message
    assert len(message) < 1000


def test_everything_that_is_wrong_is_listed():
    text = GOOD + "".join(f"wrong{i} = {i}\n" for i in range(9)) + "[design]\nR_c = -1\nR_o = -1\n[study]\nseed = -1"
    with pytest.raises(RunFileError) as caught:
        parse_run(text)
    for key in (*(f"controller.wrong{i}" for i in range(9)), "design.R_c", "design.R_o", "study.seed"):
        assert f"{key}: " in str(caught.value)


def test_a_byte_order_mark_and_windows_lines_are_read(tmp_path):
    (tmp_path / "a.toml").write_bytes(b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())
    assert load_run(tmp_path / "a.toml").text == GOOD


def test_what_is_no_file_of_this_size_is_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "large.toml").write_text(GOOD + f"Q_t = {[1] * 500_000}")
    for name, words in (("pipe", "not a file"), ("large.toml", "at most 1 MB"), ("a" * 5000, "cannot be read")):
        with pytest.raises(RunFileError, match=words):
            load_run(tmp_path / name)
    with pytest.raises(RunFileError, match="cannot be read"):
        load_run("a\0b")
