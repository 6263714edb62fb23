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
    """Half of a shelf, then the other half; ``python -m tests.additions`` takes each thing alone.

    That no thing needs another one of its shelf is read off the code below: nobody imports one, or has its name.
    """
    shelf = additions.SHELVES[title]
    names = additions.names_of(shelf)
    with additions.copied() as place:
        for gone in (names[::2], names[1::2]):
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


# what a word is elsewhere that is the name of a thing on a shelf, too: by shelf and meaning, the words, and files or
# folders where they mean it; a folder beneath the command line knows of no command
ELSEWHERE = {
    "shapes": {
        "a file: a column of a table, a key, what a message is about": (
            "file", "cli/commands/cases cli/commands/fit cli/commands/new runfile/messages study/experiment"
        ),
        "any noise: whether a run has some, and its size": (
            "noise", "case/comparison report/live report/sections/noise_statistics study/chunk study/first_file"
        ),
        "a step of an integration": ("step", "engine/native/steps linear/run report/live"),
    },
    "event rules": {"the shape of a geom in MuJoCo": ("box", "engine/pose log/figure report/player")},
    "controllers": {
        "what the controller itself, on the floor beneath, says that it is": (
            "delayed-pid predictor switching", "controller/delayed_pid controller/predictor controller/switching"
        ),
    },
    "kinds of experiments": {
        "a shipped run file": ("quiet-standing", "study/first_file study/kinds/intersection_point")
    },
    "commands": {
        "a motion that repeats": (
            "cycle", "case cli/comparisons experiments log measurement report study/sweep_folder theory/prediction"
        ),
        "a kind of file, a table at its head, and what is of it": (
            "experiment run sweep",
            "case/case cli/commands/new cli/commands/schema cycle/branch fits/bank fits/family study work/shipped",
        ),
        "somebody who stands: a table, a column, a line of what is known": (
            "person", "case/notices cli/commands/fit fits report/sections/case_panels "
            "runfile/plant_tables series/long_table study/experiment"
        ),
        "the cases of a page, or of what is shipped": ("cases", "report/sections work/shipped"),
        "a part of an array, and a part of the work": ("fit measure report", "engine/flow fits/arviz_file study/study"),
    },
}  # fmt: skip


def strings_of(source):
    """The strings of a module, but for its docstrings and the pieces of texts with values in them."""
    tree = ast.parse(source)
    pieces = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    pieces |= {id(piece) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for piece in node.values}
    return {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and id(node) not in pieces}


def test_strings_of_a_module_are_found():
    source = '''"step"\nx = "pulse"\n"""ramp"""\ndef f(y=["file"]):\n    """box"""\n    return f"noise{'own'}"\n'''
    assert strings_of(source) == {"pulse", "file", "own"}


@pytest.mark.parametrize("title", additions.SHELVES)
def test_no_other_code_has_the_name_of_a_thing(title, root):
    folder = root / "icmj" / additions.SHELVES[title].folder
    names = {said for name in additions.names_of(additions.SHELVES[title]) for said in (name, name.replace("_", "-"))}
    found = set()
    for path in {*(root / "icmj").rglob("*.py")} - {folder / "__init__.py"}:
        its_own = {path.stem, path.stem.replace("_", "-")} if path.parent == folder else set()
        place = path.relative_to(root / "icmj").with_suffix("").as_posix()
        found |= {(place, name) for name in (names - its_own) & strings_of(path.read_text(encoding="utf-8"))}
    meant = [(words.split(), places.split()) for words, places in ELSEWHERE.get(title, {}).values()]
    for words, places in meant:
        here = {one for one in found if one[1] in words and f"{one[0]}/".startswith(tuple(f"{at}/" for at in places))}
        assert {name for _, name in here} == {*words}
        assert all(any(f"{place}/".startswith(f"{at}/") for place, _ in here) for at in places), places
        found -= here
    assert not found, "a thing of a shelf is found through its list; say here what else the word means"
