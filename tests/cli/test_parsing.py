"""Words that make no command: one line of ours, with what was probably meant."""

import subprocess
from pathlib import Path

import pytest

from icmj.cli.arguments import ALSO, Command
from icmj.cli.commands import COMMANDS
from icmj.cli.main import main
from icmj.cli.overrides import Overrides
from icmj.cli.parsing import parse
from icmj.errors import IcmjError


@pytest.mark.parametrize(("words", "said"), [
    ("analyze x", "no command 'analyze'; did you mean analyse?"),
    ("linearize x", "did you mean linearise?"),
    ("dance", "no command 'dance'; there are cases, new, person, linearise, schema, analyse, "),
    ("analyse x --jsn", "analyse has no option --jsn; did you mean --json?; see icmj analyse --help"),
    ("run x --plant linear y z", "run: one argument too many, y"),
    ("measure x --band 1", "--band: expected 2 arguments"),
    ("schema case", "expected experiment or family or run or sweep, got 'case'"),
    ("run x --plan=linear", "run has no option --plan; did you mean --plant?"),
    ("run x -p linear", "run has no option -p; see"),
    ("continue x --from 1 --to 2 --parameter b --branch", "continue has no option --branch; did you mean --branches?"),
    ("continue x --to 1 --parameter b --form 1", "continue has no option --form; did you mean --from?"),
    ("continue x", "continue: the following arguments are required: --parameter, --to; see icmj continue --help"),
    ("--vresion", "icmj has no option --vresion; did you mean --version?"),
    ("analyse x y", "analyse: one argument too many, y"),
    ("analyse", "analyse: the following arguments are required: PATH; see"),
    ("run x --plant lineal", "--plant: expected linear or mujoco, got 'lineal'; did you mean linear?"),
    ("person x --height tall", "--height: expected a number, got 'tall'"),
    ("replay x --time late", "--time: expected a number, got 'late'"),
    ("study --jobs two", "--jobs: expected a whole number, got 'two'"),
    ("run x --out", "run: argument --out: expected one argument; see icmj run --help"),
])  # fmt: skip
@pytest.mark.parametrize("columns", ["80", "40"])
def test_one_line_says_what_was_meant(words, said, columns, monkeypatch):
    monkeypatch.setenv("COLUMNS", columns)
    with pytest.raises(IcmjError) as raised:
        parse(words.split())
    assert said in str(raised.value)


def test_options_come_with_underscores_too_and_set_is_repeatable():
    command = parse(["linearise", "x", "--operating_point", "balance", "--free", "a", "b"])
    assert (command.operating_point, command.free) == ("balance", ("a", "b"))
    command = parse(["run", "x", "--set", "a.b=1", "--plant", "linear", "--set", "c.d=2"])
    assert command.set == ("a.b=1", "c.d=2")
    command = parse(["continue", "x", "--parameter=b", "--from", "-1", "--to", "2", "-qv"])
    assert (command.from_, command.to, command.quiet, command.verbose) == (-1.0, 2.0, True, True)


def test_arguments_and_options_come_in_any_order():
    """Before and after an option, and after -- whatever they begin with."""
    assert parse(["study", "a", "--jobs", "2", "b"]) == parse(["study", "--jobs=2", "a", "b"])
    assert parse(["measure", "x", "--columns", "a", "b", "--rate", "1"]).columns == ("a", "b")
    assert parse(["run", "--json", "--", "-x"]).run == Path("-x")
    assert parse(["identify"]).motions == ()
    assert (parse(["new", "run"]).of, parse(["schema"]).kind) == ((), "run")


def test_version_is_the_package_s(shell):
    import icmj

    assert shell.says(["--version"]) == f"icmj {icmj.__version__}\n"


def test_the_overview_names_every_command_once_in_a_group(shell):
    shown = shell.says([])
    also = [name for name in COMMANDS.names if COMMANDS[name].COMMAND.group == ALSO]
    assert f"\nAlso: {', '.join(also)}\n" in shown
    listed = [name for name in COMMANDS.names if shown.count(f"\n  {name} ") == 1]
    assert sorted([*listed, *also]) == sorted(COMMANDS.names)
    assert len(listed) <= 16
    assert max(map(len, shown.splitlines())) <= 80


@pytest.mark.parametrize("name", COMMANDS.names)
def test_a_command_is_a_class_of_its_file_and_inherits_from_the_frame_alone(name):
    command = COMMANDS[name].COMMAND
    assert command.__module__ == COMMANDS[name].__name__
    assert {"group", "carry_out"} <= vars(command).keys()
    assert command.__bases__[0] in (Command, Overrides)


@pytest.mark.parametrize("name", COMMANDS.names)
def test_help_shows_nothing_that_only_python_has(name, shell):
    """It had "{None}|PATH" and "(default: )"."""
    shown = shell.says([name, "--help"])
    for odd in ("None", "(default: )", "TUPLE", "False"):
        assert odd not in shown
    assert "general options" in shown
    assert "-q, --quiet" in shown


def test_quiet_leaves_results_and_verbose_tells_steps(capsys, monkeypatch):
    monkeypatch.setattr("icmj.cli.progress.FIRST", 0.0)
    command = ["analyse", "simple-0.8", "--set", "actual.gain=0.85"]
    assert main([*command, "-q"]) == 0
    out, err = capsys.readouterr()
    assert "critical interval" in out
    assert "note:" not in out
    assert err == ""
    assert main([*command, "-v"]) == 0
    assert "icmj: analysing simple-0.8" in capsys.readouterr().err


def test_completion_for_a_shell_is_printed(shell):
    script = f"{shell.says(['--print-completion', 'bash'])}\ncomplete -p icmj | sed 's/.*-F *//; s/ .*//'"
    function = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True).stdout.strip()
    for words, offered in (("icmj an", "analyse"), ("icmj run --pla", "--plant"), ("icmj run --plant lin", "linear")):
        at = f"COMP_WORDS=({words}) COMP_CWORD={len(words.split()) - 1}; {function} icmj; echo ${{COMPREPLY[@]}}"
        done = subprocess.run(["bash", "-c", f"{script} >/dev/null\n{at}"], capture_output=True, text=True, check=True)
        assert done.stdout.split() == [offered]
    assert "#compdef icmj" in shell.says(["--print-completion", "zsh"])
    assert "expected bash or zsh or tcsh, got 'bush'" in shell.refuses(["--print-completion", "bush"])
