"""Words that make no command: one line of ours, with what was probably meant."""

import subprocess
import sys

import pytest

from icmj.cli.arguments import GROUPS
from icmj.cli.main import main, parse
from icmj.errors import IcmjError


@pytest.mark.parametrize(("words", "said"), [
    ("analyze x", "no command 'analyze'; did you mean analyse?"),
    ("linearize x", "did you mean linearise?"),
    ("dance", "no command 'dance'; there are cases, new, person, linearise, schema, analyse, "),
    ("analyse x --jsn", "analyse has no option --jsn; did you mean --json?; see icmj analyse --help"),
    ("run x --plan=linear", "run has no option --plan; did you mean --plant?"),
    ("run x -p linear", "run has no option -p; see"),
    ("continue x --from 1 --to 2 --parameter b --branch", "continue has no option --branch; did you mean --branches?"),
    ("continue x --to 1 --parameter b --form 1", "continue has no option --form; did you mean --from?"),
    ("continue x", "continue: missing --parameter STR and --to FLOAT; see icmj continue --help"),
    ("--vresion", "icmj has no option --vresion; did you mean --version?"),
    ("analyse x y", "analyse: one argument too many, y"),
    ("analyse", "analyse: missing PATH (Run file"),
    ("run x --plant lineal", "--plant: expected linear or mujoco, got 'lineal'; did you mean linear?"),
    ("person x --height tall", "--height: expected a number, got 'tall'"),
    ("replay x --time late", "--time: expected a number, got 'late'"),
    ("study --jobs two", "--jobs: expected a whole number, got 'two'"),
    ("run x --out", "--out: its value is missing"),
])  # fmt: skip
@pytest.mark.parametrize("columns", ["80", "40"])
def test_one_line_says_what_was_meant(words, said, columns, monkeypatch):
    monkeypatch.setenv("COLUMNS", columns)
    with pytest.raises(IcmjError) as raised:
        parse(words.split())
    assert said in str(raised.value)


def test_a_stream_without_characters_for_a_box_is_told_as_much(shell):
    """It was told "Invalid choice", the title of the box."""
    for words, said in (("run x --plant lineal", "expected linear or mujoco"), ("study --jobs two", "a whole number")):
        assert said in shell.refuses(words.split())


def test_options_come_with_underscores_too_and_set_is_repeatable():
    command = parse(["linearise", "x", "--operating_point", "balance", "--free", "a", "b"])
    assert (command.operating_point, command.free) == ("balance", ("a", "b"))
    command = parse(["run", "x", "--set", "a.b=1", "--plant", "linear", "--set", "c.d=2"])
    assert command.set == ("a.b=1", "c.d=2")


def test_version_is_the_package_s(shell):
    import icmj

    assert shell.says(["--version"]) == f"icmj {icmj.__version__}\n"


def test_the_overview_names_every_command_once_in_a_group(shell):
    from icmj.cli.main import _classes

    shown = shell.says([])
    assert [name for group in GROUPS.values() for name in group] == list(_classes())
    for name in _classes():
        assert shown.count(f"\n  {name} ") == 1
    assert max(map(len, shown.splitlines())) <= 80


@pytest.mark.parametrize("name", [name for group in GROUPS.values() for name in group])
def test_help_shows_nothing_that_only_python_has(name, shell):
    """It had "{None}|PATH" and "(default: )"."""
    shown = shell.says([name, "--help"])
    for odd in ("None", "(default: )", "TUPLE", "False"):
        assert odd not in shown
    assert "general options" in shown
    assert "-q, --quiet" in shown


def test_quiet_leaves_results_and_verbose_tells_steps(capsys, monkeypatch):
    monkeypatch.setattr("icmj.cli.terminal.FIRST", 0.0)
    command = ["analyse", "simple-0.8", "--set", "actual.gain=0.85"]
    assert main([*command, "-q"]) == 0
    out, err = capsys.readouterr()
    assert "critical interval" in out
    assert "note:" not in out
    assert err == ""
    assert main([*command, "-v"]) == 0
    assert "icmj: analysing simple-0.8" in capsys.readouterr().err


def test_completion_for_a_shell_is_printed():
    command = [sys.executable, "-m", "icmj.cli", "--tyro-print-completion", "bash"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    script = f"{done.stdout}\nCOMP_WORDS=(icmj an) COMP_CWORD=1; _tyro_icmj; echo ${{COMPREPLY[@]}}"
    assert subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True).stdout == "analyse\n"
