"""What is meant where logs are named, and where results go: the same in every command."""

import re
import shutil
from pathlib import Path
from typing import get_args, get_type_hints

import pytest
from report_cases import result
from terminal_cases import Shell

from icmj import write_log
from icmj.cli.arguments import RESULTS, Given
from icmj.cli.commands import COMMANDS as SHELF
from icmj.errors import LogError
from icmj.log.branch import ENTITY
from icmj.log.selection import find_log, find_logs

TAKE_LOGS = {"report": [], "replay": ["--web"], "export": [], "measure": [], "identify": []}

COMMANDS = {name: SHELF[name].COMMAND.complete() for name in SHELF.names}


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "b0.8.linear.rrd"
    write_log(result("b0.8"), path)
    return path


@pytest.fixture(autouse=True)
def results(log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """``runs/out`` with a case on both plants and another case on one."""
    monkeypatch.chdir(tmp_path)
    folder = Path("runs/out")
    folder.mkdir(parents=True)
    for name in ("b0.8.linear", "b0.8.mujoco", "other.linear"):
        shutil.copy(log, folder / f"{name}.rrd")
    return folder


def names(*given: str) -> list[str]:
    return [path.name.removesuffix(".rrd") for path in find_logs([*map(Path, given)], RESULTS)]


def test_a_folder_is_its_logs_and_a_case_those_of_its_name(results: Path) -> None:
    assert names("runs/out") == ["b0.8.linear", "b0.8.mujoco", "other.linear"]
    assert names("b0.8") == ["b0.8.linear", "b0.8.mujoco"]
    assert names("b0.8.mujoco") == ["b0.8.mujoco"]
    assert names("b0.8", "runs/out/b0.8.linear.rrd", "other") == ["b0.8.linear", "b0.8.mujoco", "other.linear"]
    assert names("events.txt", "there/none") == ["events.txt", "none"]  # what is no log is for who reads it


def test_a_file_of_the_name_of_a_case_is_the_file() -> None:
    Path("b0.8").write_text("0.1\n")
    assert find_logs([Path("b0.8")], RESULTS) == [Path("b0.8")]


def test_other_recordings_in_a_folder_are_none_of_its_logs(results: Path) -> None:
    import rerun as rr

    with rr.RecordingStream("icmj") as recording:
        recording.save(results / "b0.8.b.linear.rrd")
        recording.log(ENTITY, rr.TextDocument("a branch"), static=True)
        recording.flush()
    (results / "cut.rrd").write_bytes((results / "other.linear.rrd").read_bytes()[:5000])  # one that replay salvages
    assert names("runs/out") == ["b0.8.linear", "b0.8.mujoco", "cut", "other.linear"]


def test_one_log_of_a_case_is_that_in_mujoco_and_of_a_folder_none(results: Path) -> None:
    assert find_log(Path("b0.8"), RESULTS).name == "b0.8.mujoco.rrd"
    assert find_log(Path("other"), RESULTS).name == "other.linear.rrd"
    with pytest.raises(LogError, match=r"runs/out: 3 logs \(b0.8.linear, .*\), where one is needed"):
        find_log(results, RESULTS)


def test_every_command_that_takes_logs_asks_the_same(shell: Shell) -> None:
    about = {name for name in SHELF.names if re.search("folders? of logs", _help(SHELF[name].COMMAND))}
    assert about == TAKE_LOGS.keys()
    Path("empty").mkdir()
    for command, more in TAKE_LOGS.items():
        assert "empty: no such log; the folder has none" in shell.refuses([command, "empty", *more])
        assert "b0.7: no such log" in (said := shell.refuses([command, "b0.7", *more]))
        assert "did you mean b0.8?" in said
        assert "simple-0.8: no such log" in (said := shell.refuses([command, "simple-0.8", *more]))
        assert "b0.8" in said or "icmj run simple-0.8 writes one" in said


def _help(cls: type) -> str:
    import inspect

    return " ".join(inspect.getsource(cls).split())


def test_the_report_of_a_folder_is_renewed_in_it(results: Path, shell: Shell) -> None:
    (results / "b0.8.mujoco.rrd").unlink()
    (results / "other.linear.rrd").unlink()
    assert "runs/out/report.html" in shell.says(["report", "runs/out"])
    assert "b0.8" in (results / "report.html").read_text(encoding="utf-8")
    shell.says(["report", "b0.8"])
    assert Path("report.html").is_file()


def test_each_log_of_a_case_is_exported_beside_itself(results: Path, shell: Shell) -> None:
    shell.says(["export", "b0.8"])
    made = {path.name for path in results.glob("*.csv")}
    assert made == {f"b0.8.{plant}{of}.csv" for plant in ("linear", "mujoco") for of in ("", ".events")}
    assert "2 logs are exported" in shell.refuses(["export", "b0.8", "--out", "one.csv"])
    assert len(shell.answers(["measure", "b0.8", "--json"])) == 2


WRITES = [
    (name, option, target)
    for name, cls in COMMANDS.items()
    for option, hint in get_type_hints(cls, include_extras=True).items()
    for target in [given.writes for given in get_args(hint) if isinstance(given, Given)]
    if target is not None
]


def test_every_command_says_what_its_out_is() -> None:
    """A folder or a file, which help shows as such."""
    assert {name for name, option, _ in WRITES if option == "out"} == {
        name for name, cls in COMMANDS.items() if "out" in cls.__annotations__
    }
    assert len(COMMANDS) > len(WRITES) > 12


@pytest.mark.parametrize(("command", "option", "target"), WRITES)
def test_a_name_that_looks_like_the_other_kind_is_asked_about(
    command: str, option: str, target: tuple[str, ...], shell: Shell
) -> None:
    needed = {
        "new": ["pendulum"], "fit": ["x.csv", "--model", "event"], "continue": ["x", "--parameter", "b", "--to", "1"],
        "schema": [], "study": [], "person": ["three_link"], "linearise": ["pendulum"], "export": ["b0.8.linear"],
    }.get(command, ["simple-0.8"])  # fmt: skip
    Path("there.d").mkdir()
    for name in ("page", "there.d") if target else ("here.rrd", "here.html", "here.csv"):
        said = shell.refuses([command, *needed, f"--{option}", name])
        is_other = "a folder is there" if Path(name).is_dir() else f"looks like a {'folder' if target else 'file'}"
        assert f"--{option} {name}: {is_other}" in said
        assert "give one, such as " in said
    assert {path.name for path in Path().iterdir()} == {"runs", "there.d"}


def test_a_folder_may_have_any_name_if_it_is_there(shell: Shell) -> None:
    Path("data.csv").mkdir()
    shell.says(["run", "simple-0.8", "--plant", "linear", "--set", "simulation.duration=5", "--out", "data.csv"])
    assert Path("data.csv/simple-0.8.linear.rrd").is_file()
