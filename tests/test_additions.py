"""Every shelf: one file and one line add a thing, and each shipped one can be taken away."""

import ast
import shutil

import additions
import pytest

FAMILY = '    "family": "icmj.fits.family_file:FamilyFile",\n'
WITHOUT_FITS = """
import pkgutil
from importlib import import_module
for found in pkgutil.walk_packages(icmj.__path__, "icmj."):
    if not found.name.endswith("__main__"):
        import_module(found.name)
for words in (["--help"], ["cases"], ["new", "sweep", "simple-0.8"]):
    try:
        status = main(words)
    except SystemExit as end:
        status = end.code
    assert not status, words
"""


@pytest.mark.slow
@pytest.mark.parametrize("title", additions.SHELVES)
def test_one_file_and_one_line_add_a_thing(title):
    with additions.copied() as place:
        additions.add(place, additions.SHELVES[title])


@pytest.mark.slow
@pytest.mark.parametrize("title", additions.SHELVES)
def test_each_shipped_thing_can_be_taken_away(title):
    """Several at once, and of any two the one without the other; ``python -m tests.additions`` takes each alone."""
    shelf = additions.SHELVES[title]
    names = additions.names_of(shelf)
    sets = additions.separate(names)
    assert all(any(one in gone and two not in gone for gone in sets) for one in names for two in {*names} - {one})
    with additions.copied() as place:
        for gone in sets:
            additions.take_away(place, shelf, gone)


@pytest.mark.slow
def test_fits_can_be_taken_away():
    """The folder, its command and its kind of file: the rest imports, lists its commands, and runs."""
    with additions.copied() as place:
        shutil.rmtree(place / "icmj" / "fits")
        (place / "icmj" / "cli" / "commands" / "fit.py").unlink()
        for path, entry in (("cli/commands/__init__.py", '        "fit",\n'), ("study/file_kinds.py", FAMILY)):
            file = place / "icmj" / path
            text = file.read_text(encoding="utf-8")
            assert entry in text
            file.write_text(text.replace(entry, ""), encoding="utf-8")
        additions.execute(place, additions.READ_REST + additions.RUN_REST + WITHOUT_FITS, "fit")


@pytest.mark.parametrize("title", additions.SHELVES)
def test_the_list_names_every_file_of_a_shelf_and_nobody_else_imports_one(title, root):
    folder = root / "icmj" / additions.SHELVES[title].folder
    names = additions.names_of(additions.SHELVES[title])
    assert sorted(names) == sorted(path.stem for path in folder.glob("*.py") if path.stem != "__init__")
    package = ".".join(folder.relative_to(root).parts)
    for path in (root / "icmj").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            given = [alias.name for alias in getattr(node, "names", ())] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                given = [str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)]
            assert not {f"{package}.{name}" for name in names} & set(given), path


# words of the command line's code that are names of commands, too, and what they are there
OTHERWISE = {
    "commands/new": {"run", "sweep", "experiment"},  # kinds of files
    "commands/schema": {"run", "sweep", "experiment"},
    "commands/fit": {"person"},  # a column of a table
    "comparisons": {"cycle"},  # a motion
}


def test_nothing_is_decided_by_the_name_of_a_command(root):
    names = set(additions.names_of(additions.SHELVES["commands"]))
    found = {}
    for path in {*(root / "icmj" / "cli").rglob("*.py")} - {root / "icmj/cli/commands/__init__.py"}:
        said = {
            node.value
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.Constant)
        }
        if others := said & names - {path.stem}:
            found[path.relative_to(root / "icmj" / "cli").with_suffix("").as_posix()] = others
    assert found == OTHERWISE


@pytest.mark.parametrize("title", [title for title, shelf in additions.SHELVES.items() if shelf.alone])
def test_the_list_alone_has_the_names_of_a_shelf(title, root):
    shelf = additions.SHELVES[title]
    names, entries = set(additions.names_of(shelf)), root / "icmj" / shelf.folder / "__init__.py"
    for path in {*(root / "icmj").rglob("*.py")} - {entries}:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        its_own = {path.stem} if path.parent == entries.parent else set()
        assert not (names - its_own) & {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}, path
