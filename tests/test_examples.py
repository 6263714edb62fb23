"""What the examples find is looked at where they run, in the documentation's build."""

import re
import sys
import tomllib


def test_a_page_that_does_not_show_what_its_example_finds_is_named(root, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", [str(root / "docs" / "_ext"), *sys.path])
    from promises import PROMISED, list_broken

    assert {*PROMISED} <= {path.stem for path in (root / "examples").glob("*.py")}
    # one was not run, one printed something else, one misses its library
    odd = {"muscle": "nothing", "dm_control_model": "dm_control is not installed"}
    for name, words in PROMISED.items():
        shown = f"sphx-glr-script-out: {odd.get(name, words)}" if name != "lean" else ""
        (tmp_path / f"{name}.rst").write_text(shown, encoding="utf-8")
    assert list(list_broken(tmp_path)) == ["examples/muscle.py does not print 'Settled on a period-1 cycle of 1.16'"]


def test_the_documentation_s_extra_brings_what_examples_look_for(root):
    """It did not, so that the documentation could be built only where the tests were installed."""
    extras = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    for example in (root / "examples").glob("*.py"):
        for name in re.findall(r'find_spec\("(\w+)"\)', example.read_text(encoding="utf-8")):
            assert any(re.match(rf"{name}\b", wanted) for wanted in extras["docs"]), example
