"""docs/api/: examples on the pages of the Python interface are run in the order of the pages, and say what they say."""

import doctest
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
