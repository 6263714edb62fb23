"""Run files: the shipped ones, and one clear line for each thing that can be wrong."""

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
        ("quiet-standing", 0.9, None),
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
        (GOOD + "qt = 3", ["controller.qt", "not permitted"]),
        (GOOD.replace('name = "a"', 'name = "../a"'), ["case.name", "pattern"]),
        (GOOD.replace('[assumed]\nmodel = "m.xml"', ""), ["assumed", "required"]),
        (GOOD + "[study]\nlaw_q_t = [1e-2]", ["law_q_t", "two"]),
        (GOOD + "[simulation]\nduration = 1e6", ["simulation", "record_interval", "1e+08"]),
        (GOOD + '[[simulation.disturbance]]\nkind = "storm"\ninput = "u"', ["disturbance", "storm"]),
        (GOOD + NOISE + 'input = "u"\noutput = "y"\ncorner = 1.0', ["simulation", "one of input and output"]),
        (GOOD + NOISE + "corner = 1.0", ["simulation", "one of input and output"]),
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
