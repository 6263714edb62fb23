"""Words that make no command: one line of ours, with what was probably meant."""

import pytest

from icmj.cli.main import main
from icmj.cli.parsing import parse
from icmj.errors import IcmjError


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("analyze x", "no command 'analyze'; did you mean analyse?"),
        ("linearize x", "did you mean linearise?"),
        ("dance", "no command 'dance'; there are study, analyse, run, "),
        ("analyse x --jsn", "analyse has no option --jsn; did you mean --json?; see icmj analyse --help"),
        ("run x --plan=linear", "run has no option --plan; did you mean --plant?"),
        ("run x -p linear", "run has no option -p; see"),
        (
            "continue x --from 1 --to 2 --parameter b --branch",
            "continue has no option --branch; did you mean --branches?",
        ),
        ("continue x --to 1 --parameter b --form 1", "continue has no option --form; did you mean --from?"),
        ("continue x", "continue: missing --parameter STR and --to FLOAT; see icmj continue --help"),
        ("--vresion", "icmj has no option --vresion; did you mean --version?"),
        ("analyse x y", "analyse: one argument too many: y"),
        ("analyse", "analyse: missing PATH: Run file"),
        ("run x --plant lineal", "--plant: expected linear or mujoco, got 'lineal'; did you mean linear?"),
        ("person x --height tall", "--height: expected a number, got 'tall'"),
        ("replay x --time late", "--time: expected a number, got 'late'"),
        ("study --jobs two", "--jobs: expected a whole number, got 'two'"),
        ("run x --out", "--out: its value is missing"),
    ],
)
@pytest.mark.parametrize("columns", ["80", "40"])
def test_one_line_says_what_was_meant(words, said, columns, monkeypatch):
    monkeypatch.setenv("COLUMNS", columns)
    with pytest.raises(IcmjError) as raised:
        parse(words.split())
    assert said in str(raised.value)
    assert "\n" not in str(raised.value)


def test_options_come_with_underscores_too():
    command = parse(["linearise", "x", "--operating_point", "balance", "--free", "a", "b"])
    assert (command.operating_point, command.free) == ("balance", ("a", "b"))


def test_set_is_repeatable():
    command = parse(["run", "x", "--set", "a.b=1", "--plant", "linear", "--set", "c.d=2"])
    assert command.set == ("a.b=1", "c.d=2")


def test_version_is_the_package_s(capsys):
    import icmj

    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"icmj {icmj.__version__}\n"
