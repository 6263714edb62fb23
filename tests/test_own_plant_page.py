"""docs/own_plant.md: every example on the page is run, in its order, and gives what the page says."""

import re
from pathlib import Path

import numpy as np
import pytest

from icmj.cli.main import main


def blocks(root: Path) -> list[tuple[str, str]]:
    """Language and text of each block on the page."""
    page = (root / "docs" / "own_plant.md").read_text(encoding="utf-8")
    return re.findall(r"^```(\w+)\n(.*?)^```$", page, flags=re.S | re.M)


@pytest.mark.slow
def test_the_page_s_examples_run(root, tmp_path, monkeypatch, capsys, shell):
    monkeypatch.chdir(tmp_path)
    known: dict = {"__name__": "page"}
    shown: dict[str, str] = {}
    for language, text in blocks(root):
        if language == "python":
            exec(compile(text, "own_plant.md", "exec"), known)
        elif language == "toml":
            (tmp_path / "by-matrices.toml").write_text(text, encoding="utf-8")
        else:
            assert language == "sh"
            for line in text.strip().splitlines():
                words, _, file = line.removeprefix("icmj ").partition(" > ")
                assert main(words.split()) == 0, line
                shown[line] = capsys.readouterr().out
                if file:
                    (tmp_path / file).write_text(shown[line], encoding="utf-8")
    assert known["lean"].A[1, 0] == pytest.approx(9.81 * np.cos(0.1), rel=1e-8)
    assert known["other"].delta_crit == pytest.approx(known["prediction"].delta_crit, rel=1e-9)
    assert known["prediction"].cycle
    # what was put together in code is the same case when it comes back from its file
    back = shell.answers(["analyse", "plant.toml", "--json"])
    assert back["delta_crit"] == pytest.approx(known["prediction"].delta_crit, rel=1e-9)
    assert {"plant.linear.rrd", "report.html", "body.json"} <= {path.name for path in tmp_path.iterdir()}
    assert "1.80654" in shown["icmj analyse by-matrices.toml"]
    assert (tmp_path / "runs" / "out" / "by-matrices.linear.rrd").is_file()


def test_a_rule_that_is_one_face_of_the_box_is_that_box(root):
    """The page's rule against the shipped one with the same face and another that is never reached."""
    import icmj

    known: dict = {"__name__": "page"}
    for language, text in blocks(root)[:5]:
        if language == "python":
            exec(compile(text, "own_plant.md", "exec"), known)
    box = icmj.BoxTrigger(np.array([1e9, 0.01]), "state")
    law = known["by_rate"].triggered_by(box)
    run = icmj.simulate_plant(known["actual"], law, icmj.Settings(duration=30), x0=[0.02, 0])
    np.testing.assert_allclose(known["run"].events.t, run.events.t, atol=1e-9)
