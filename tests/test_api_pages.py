"""docs/api/: examples on the pages of the Python interface are run in the order of the pages, and say what they say."""

import doctest
import importlib
import re

import pytest


@pytest.mark.slow
def test_examples_of_the_interface(root):
    folder = root / "docs" / "api"
    pages = re.findall(r"^([\w-]+)$", (folder / "index.md").read_text(encoding="utf-8"), flags=re.M)
    known: dict[str, object] = {}
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    said: list[str] = []
    for page in pages:
        text = (folder / f"{page}.md").read_text(encoding="utf-8")
        test = doctest.DocTestParser().get_doctest(text, known, page, str(folder / f"{page}.md"), 0)
        runner.run(test, out=said.append, clear_globs=False)
        known = test.globs
    assert runner.summarize(verbose=False).failed == 0, "".join(said)
    assert runner.tries > 20


def test_examples_in_the_code_run(root):
    """That of ``find_factor`` had a former name."""
    found = [path for path in (root / "icmj").rglob("*.py") if ">>>" in path.read_text(encoding="utf-8")]
    assert found
    for path in found:
        name = ".".join(path.relative_to(root).with_suffix("").parts)
        assert doctest.testmod(importlib.import_module(name)).failed == 0, name
