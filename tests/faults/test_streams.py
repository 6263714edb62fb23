"""Where words are printed: streams that are closed, full, gone or know only ASCII; and names that would be obeyed."""

import contextlib
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from fault_cases import short_run
from patience import PATIENCE
from terminal_cases import told

from icmj.cli.main import main
from icmj.log.reader import read_log

ROOT = Path(__file__).resolve().parent.parent.parent
HOSTILE = "a\u202eb\x9b31m[/][red]:smile:\u2066"  # MJCF and TOML cannot hold C0 controls; what else is obeyed they can
SHELL = 'exec "$0" -m icmj.cli "$@" '


def icmj(where: str, *words: str | Path, cwd: Path, **environment: str) -> subprocess.CompletedProcess[bytes]:
    """A command with its streams redirected as a shell does it."""
    command = ["/bin/sh", "-c", SHELL + where, sys.executable, *map(str, words)]
    env = os.environ | {"PYTHONPATH": str(ROOT)} | environment
    return subprocess.run(command, capture_output=True, cwd=cwd, env=env, timeout=PATIENCE, check=False)


COMMANDS = {
    "--help": ["--help"],
    "run": ["run", "{run}", "--plant", "linear", "--out", "out"],
    "person": ["person", "three_link", "--height", "1.7", "--mass", "70"],
    "refused": ["analyse", "no/body"],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_no_stream_makes_a_mistake(name: str, tmp_path: Path) -> None:
    run, refused = short_run(tmp_path, duration=2.0), name == "refused"
    words = [word.format(run=run) for word in COMMANDS[name]]
    said = b"icmj: no/body: cannot be read (No such file or directory)\n"
    full = ">/dev/full", 2, b"icmj: No space left on device\n"
    others = [(where, 0, b"") for where in (">&-", "<&- >&- 2>&-", "2>/dev/full", "")]
    for i, (where, status, err) in enumerate((full, *others)):
        here = tmp_path / str(i)
        here.mkdir()
        ascii_only = {} if where else {"PYTHONIOENCODING": "ascii"}
        done = icmj(where, *words, cwd=here, **ascii_only)
        if refused:
            status, err = 2, b"" if "2>" in where else said
        elif name == "person" and where == ">/dev/full" and done.returncode == 2:
            assert list(here.iterdir())  # what was asked for is there
        assert (done.returncode, told(done.stderr.decode())) == (status, told(err.decode())), where
        assert not done.stdout or ">" not in where.replace("2>", "")
        done.stdout.decode("ascii" if not where else "utf-8")
        if name == "run":
            read_log(here / "out" / "short.linear.rrd")  # nothing that was printed is in it


@pytest.mark.slow
def test_a_locale_without_utf_8_is_enough(tmp_path: Path) -> None:
    run = short_run(tmp_path)
    plain = {"LC_ALL": "C", "LANG": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    done = icmj("", "analyse", run, cwd=tmp_path, **plain)
    assert (done.returncode, told(done.stderr.decode())) == (0, [])
    words = done.stdout.decode("ascii")
    assert "critical interval Delta_crit" in words
    assert "rad" in words


def test_a_reader_of_standard_error_that_goes_away_stops_nothing(tmp_path, monkeypatch, capfd):
    run = short_run(tmp_path, duration=5.0)
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as gone:
        monkeypatch.setattr("icmj.cli.commands.run.TOLD", 0.0)  # what it will cost is said
        monkeypatch.setattr("icmj.cli.progress.SHARE", 0.0)
        monkeypatch.setattr("icmj.cli.progress.PAUSE", 0.01)  # and often that it goes on
        monkeypatch.setattr(sys, "stderr", gone)
        assert main(["run", str(run), "--out", str(tmp_path / "out")]) == 0
        with contextlib.suppress(BrokenPipeError):
            gone.flush()
        os.dup2(os.open(os.devnull, os.O_WRONLY), gone.fileno())
    assert "log " in capfd.readouterr().out
    assert (tmp_path / "out" / "short.mujoco.rrd").is_file()


@pytest.fixture
def odd(tmp_path: Path) -> Path:
    """A run file of a model with names and a title that would be obeyed."""
    names = HOSTILE.replace("\x9b", "&#x9b;").replace("\u202e", "&#x202e;").replace("\u2066", "&#x2066;")
    model = (ROOT / "models" / "pendulum.xml").read_text(encoding="utf-8")
    model = model.replace('name="angle"', f'name="{names}"').replace('"torque"', f'"torque{names}"')
    (tmp_path / "odd.xml").write_text(model, encoding="utf-8")
    run = short_run(tmp_path, duration=2.0)
    text = run.read_text().replace('title = "Short"', 'title = "[/]Short[bold] :smile:"')
    run.write_text(text.replace(str(ROOT / "models" / "pendulum.xml"), "odd.xml"), encoding="utf-8")
    return run


def obeyed(words: str) -> list[str]:
    """Characters that a terminal obeys, but for ends of lines."""
    marks = {*range(0x202A, 0x202F), *range(0x2066, 0x206A), 0x200E, 0x200F, 0x61C, *range(0x7F, 0xA0), *range(0x20)}
    return [hex(ord(c)) for c in words if ord(c) in marks and c != "\n"]


@pytest.mark.slow
def test_names_are_shown_and_not_obeyed(odd, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    shown = "ab31m[/][red]:smile:"
    for words in (
        ["analyse", odd],
        ["analyse", odd, "--json"],
        ["run", odd, "--out", "out"],
        ["run", odd, "--plant", "linear", "--out", "out"],
        ["cycle", odd, "--plant", "linear"],
        ["continue", odd, "--parameter", "b", "--to", "0.81", "--points", "3", "--plant", "linear", "--out", "out"],
        ["linearise", "odd.xml"],
        ["linearise", "odd.xml", "--full"],
        ["linearise", "odd.xml", "--json"],
        ["new", "odd.xml", "--out", "new.toml"],
        ["analyse", "new.toml"],
        ["measure", "out/short.mujoco.rrd"],
        ["export", "out/short.mujoco.rrd", "--out", "a.csv"],
        ["measure", "a.csv", "--columns", f"y.{HOSTILE}"],
        ["measure", "a.csv", "--columns", HOSTILE],
        ["identify", "out/short.linear.rrd", "--json"],
        ["report", "out/short.mujoco.rrd"],
    ):
        status = main([str(word) for word in words])
        out, err = capfd.readouterr()
        assert obeyed(out) == [], words
        assert obeyed(err) == [], words
        assert "Traceback" not in err
        assert "mistake in icmj" not in err, err
        if words[0] in ("analyse", "linearise", "cycle") and "--json" not in words:
            assert status == 0, err
            assert shown in "".join(out.split()).replace("|", "") or shown[:12] in out
        if words[:2] == ["analyse", odd] and "--json" not in words:
            assert "[/]Short[bold] :smile:" in out


def test_a_bar_shows_a_label_as_it_is() -> None:
    """On a terminal of its own, where a bar is drawn."""
    import pty

    from icmj.cli import progress
    from icmj.cli.terminal import Terminal

    class Drawn(Terminal):
        @property
        def is_terminal(self) -> bool:
            return True

    ours, theirs = pty.openpty()
    heard = bytearray()

    def listen() -> None:
        while True:
            try:
                heard.extend(os.read(ours, 1000))
            except OSError:
                return

    listener = threading.Thread(target=listen, daemon=True)
    listener.start()
    with os.fdopen(theirs, "w", encoding="utf-8") as stream, pytest.MonkeyPatch.context() as patch:
        patch.setattr(progress, "FIRST", 0.0)
        patch.setattr(sys, "stderr", stream)
        with progress.Working(f"study {HOSTILE}\x1b[2J", Drawn(stderr=True)):
            deadline = time.monotonic() + PATIENCE
            while b"[2J" not in heard and time.monotonic() < deadline:
                time.sleep(0.02)
    listener.join(PATIENCE)
    os.close(ours)
    words = heard.decode(errors="replace")
    assert "study ab31m[/][red]:smile:[2J" in words
    assert "\x1b[2J" not in words
    assert "\u202e" not in words
    assert "\x9b" not in words


def test_a_file_by_a_name_that_is_no_text_is_shown(tmp_path: Path) -> None:
    name = os.fsdecode(b"caf\xe9.npz")
    try:
        (tmp_path / name).touch()
    except OSError:
        pytest.skip("this file system takes UTF-8 names alone")
    (tmp_path / name).unlink()
    done = icmj("", "linearise", "pendulum", "--out", name, cwd=tmp_path)
    assert (done.returncode, told(done.stderr.decode())) == (0, [])
    assert (tmp_path / name).is_file()
    assert b"caf" in done.stdout
