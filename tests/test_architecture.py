"""The floor plan: who may import whom, that CONTRIBUTING.md draws it, and that each thing has one home."""

import ast
import importlib
import re
from pathlib import Path

import pytest

from icmj.errors import IcmjError

PACKAGE = Path(__file__).resolve().parents[1] / "icmj"

# from the ground up; folders on one floor do not know each other
FLOORS = (
    ("errors", "base"),
    ("plant", "series", "work"),
    ("controller",),
    ("theory", "simulation"),
    ("linear", "engine", "measurement", "runfile"),
    ("case",),
    ("cycle", "experiments"),
    ("log", "report"),
    ("identification",),
    ("study",),
    ("fits", "fitting"),
    ("cli",),
)
LEVEL = {folder: level for level, floor in enumerate(FLOORS) for folder in floor}
# what is compiled: the loop on the engine, the exact simulation of the linear plant, and how both are
ROOMS = ("engine/native", "linear/native", "base/compilation", "base/linking", "base/references", "base/roots")
TABLES = ("runfile", "study/experiment_file", "study/kind", "study/sweep_facts", "fits/family_file")  # of files
ONLY_IN = {"mujoco": "engine", "rerun": "log", "numba": ROOMS, "argparse": "cli", "pydantic": TABLES}
MODULES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


def folder_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def name_of(path: Path) -> str:
    return ".".join(("icmj", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__")


ALL_NAMES = {name_of(path) for path in MODULES}


def imports(path: Path) -> set[str]:
    """Modules that a file imports, wherever in it; those for type checkers count."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            # a module taken out of its package is an arrow to the module alone
            found |= inner & ALL_NAMES or {node.module, *inner}
    return found


def test_every_folder_has_its_floor_and_nothing_else_lies_at_the_root() -> None:
    folders = {path.name for path in PACKAGE.iterdir() if path.is_dir() and (path / "__init__.py").exists()}
    files = {path.stem for path in PACKAGE.glob("*.py")}
    assert folders | (files - {"__init__"}) == set(LEVEL)


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_no_arrow_runs_up(path: Path) -> None:
    here = folder_of(path)
    assert "icmj" not in imports(path), f"{name_of(path)} imports the roof"
    for name in imports(path):
        if not name.startswith("icmj."):
            continue
        there = name.split(".")[1]
        if there in LEVEL and there != here:
            assert LEVEL[there] < LEVEL[here], f"{name_of(path)} imports {name}"


def test_no_circle_among_modules() -> None:
    names = {name_of(path): path for path in MODULES}
    arrows = {
        name: {other for other in imports(path) if other in names and other != name} for name, path in names.items()
    }
    # a package's own __init__ re-exports its modules; they do not import it back
    done: set[str] = set()

    def visit(name: str, way: tuple[str, ...]) -> None:
        assert name not in way, " → ".join([*way[way.index(name) :], name])
        if name not in done:
            for other in arrows[name]:
                visit(other, (*way, name))
            done.add(name)

    for name in names:
        visit(name, ())


@pytest.mark.parametrize("library", ONLY_IN)
def test_libraries_stay_in_their_rooms(library: str) -> None:
    for path in MODULES:
        if not path.relative_to(PACKAGE).as_posix().startswith(ONLY_IN[library]):
            used = {name for name in imports(path) if name == library or name.startswith(f"{library}.")}
            assert not used, f"{name_of(path)} imports {library}"


def test_nobody_asks_what_class_a_trigger_is_outside_its_home() -> None:
    asked = re.compile(r"(isinstance\([^)]*|case )\b(Event|Clock|Box)?(Trigger|EventRule|Continuous)\b")
    for path in MODULES:
        if folder_of(path) != "controller":
            assert not asked.search(path.read_text(encoding="utf-8")), name_of(path)


LICENSED = {"icmj.engine.native.memory", "icmj.base.linking"}  # which say why at their head
INSIDES = ("numba.core", "loky.backend")  # without an underscore, and not promised to stay
PUBLIC = {"_replace", "_asdict", "_fields", "_make", "_exit"}  # of named tuples, and of os
IMPORTS = {"modules", "meta_path", "path_hooks", "path_importer_cache"}  # of sys, by which modules are found


def private(name: str) -> bool:
    return name.startswith("_") and not (name.startswith("__") and name.endswith("__"))


def foreign_insides(tree: ast.AST, own: set[str] = frozenset()) -> set[str]:
    """What a module uses of libraries that they do not offer, and where it changes how modules are found.

    A private name is its own if a module of icmj defines it (``own``).
    """
    found = set()
    for node in ast.walk(tree):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        for name in names:
            inside = any(f"{name}.".startswith(f"{each}.") for each in INSIDES)
            if name != "__future__" and (inside or any(map(private, name.split(".")))):
                found |= {name} if not name.startswith("icmj.") else set()
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id.endswith("attr"):
            names = [each.value for each in node.args[1:2] if isinstance(each, ast.Constant)]
            found |= {name for name in names if private(name) and name not in own}
        if isinstance(node, ast.Attribute) and private(node.attr) and node.attr not in own | PUBLIC:
            found.add(ast.unparse(node))
        if isinstance(node, ast.Attribute) and any(
            f"{ast.unparse(node)}.".startswith(f"{inside}.") for inside in INSIDES
        ):
            found.add(ast.unparse(node))
        changed = node.value if isinstance(node, ast.Subscript) and not isinstance(node.ctx, ast.Load) else node
        called = node.func.value if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) else None
        reads = isinstance(node, ast.Call) and getattr(node.func, "attr", "") in ("get", "keys", "values", "items")
        for thing in (changed, None if reads else called):
            stored = thing is not node or not isinstance(getattr(node, "ctx", ast.Load()), ast.Load)
            if isinstance(thing, ast.Attribute) and thing.attr in IMPORTS and stored:
                found |= {ast.unparse(node)} if ast.unparse(thing.value) == "sys" else set()
    return found


def own_private_names(tree: ast.AST) -> set[str]:
    """Names with an underscore that a module defines: functions, classes, fields, and attributes of ``self``."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.add(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            found |= {node.attr} if ast.unparse(node.value) in ("self", "cls") else set()
    return {name for name in found if private(name)}


def test_no_library_s_inside_is_used_or_changed() -> None:
    """Their next release may change it; and whoever imports icmj gets libraries as they are."""
    trees = {name_of(path): ast.parse(path.read_text(encoding="utf-8")) for path in MODULES}
    own = set().union(*map(own_private_names, trees.values()))
    found = {name: insides for name, tree in trees.items() if (insides := foreign_insides(tree, own))}
    # the user's own module, under its own name
    assert found.pop("icmj.work.own_code") == {"sys.modules[own]"}
    assert found.keys() == LICENSED


@pytest.mark.parametrize("line", [
    "sys.modules['typeguard'] = guard", "sys.meta_path.insert(0, finder)", "del sys.modules['x']", "import numba.core",
    "sys.modules.update(more)", "sys.meta_path = []", "from numba import _dynfunc", "from loky.backend import context",
    "import loky\nloky.backend.context.get_context()", "getattr(library, '_real_set_num_threads')", "process._config",
    "sys.meta_path += [finder]", "from numba.core.caching import FunctionCache", "from tyro._cli import x",
])  # fmt: skip
def test_what_uses_an_inside_is_found(line: str) -> None:
    assert foreign_insides(ast.parse(line))


@pytest.mark.parametrize("line", [
    "sys.modules.get('numba')", "'numba' in sys.modules", "os._exit(1)", "point._replace(x=1)", "self._own",
    "module.__getattr__('x')", "from __future__ import annotations", "from icmj.base.text import _spelt",
])  # fmt: skip
def test_what_is_offered_may_be_used(line: str) -> None:
    assert not foreign_insides(ast.parse(line), {"_own"})


def test_what_is_on_disk_is_read_in_one_way() -> None:
    """Elsewhere a pipe is waited for, and a link to a device fills the memory."""
    read = re.compile(
        r"\w\.read_(text|bytes)\(|(?<!os)\.open\((?!.w)|(?<![\w.])open\([^)]*\br|np\.load\(|(pq|parquet)\.(read_|P)"
    )
    ours = {
        *("base.files", "base.npz", "base.parquet", "work.folder"),  # the way itself
        *(
            "base.compilation",
            "work.own_code",
            "work.shipped",
            "work.provenance",
            "cli.commands.new",
        ),  # files of the installation
        *(
            "report.builder",
            "report.drawing",
            "log.target",
            "series.formats.c3d",
            "study.sweep",
            "study.sweep_folder",
        ),  # what they just wrote
        *("series.formats.parquet",),
    }
    found = {name_of(path) for path in MODULES if read.search(path.read_text(encoding="utf-8"))}
    assert found <= {f"icmj.{name}" for name in ours}


def test_what_goes_on_where_it_ended_does_so_in_one_way() -> None:
    """Lock, description and digests of a folder are those of :mod:`icmj.work.folder`."""
    own = re.compile(r"(?<![\w.])lock\(|\"SHA256SUMS\"")
    found = {name_of(path) for path in MODULES if own.search(path.read_text(encoding="utf-8"))}
    assert found == {"icmj.base.files", "icmj.work.folder"}


def test_nobody_asks_which_family_a_controller_is_of() -> None:
    """What it has is asked for, a prediction, a trigger, taps or modes; a Law is what every controller is."""
    asked = re.compile(
        r"isinstance\([^)]*\b(Trial|Tried|Case|Result|Controller|PredictorController|SwitchingPD|DelayedPID"
        r"|SwitchingChannels|Control|Switching|Predictor)\b"
    )
    assert not [name_of(path) for path in MODULES if asked.search(path.read_text(encoding="utf-8"))]


def test_there_is_one_event_loop() -> None:
    """What is compiled and follows a run does so in ``run_loop``, which alone calls the verbs of a flow.

    So what comes first at an instant stands in one place. Flows plan and pass instants only where these verbs are.
    """
    verbs = {"travel", "change", "act", "tick", "cross", "fire", "end"}
    homes = {"take_action": {"act"}, "plan_after": {"fire"}, "await_sample": {"cross"}, "next_event": {"tick"}}
    loops, entries = set(), {}
    for path in MODULES:
        if "native" not in path.parts:
            continue
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(function, ast.FunctionDef):
                continue
            calls = [
                node.func.id for node in ast.walk(function) if isinstance(node, ast.Call) and hasattr(node.func, "id")
            ]
            name, called = function.name.removeprefix("_"), {each.removeprefix("_") for each in calls}
            if "run_loop" in calls:
                assert name == "run", f"{name_of(path)}: {function.name} runs the loop"
            if called & verbs - {name}:
                loops.add(function.name)
            for helper in homes.keys() & called:
                assert name in homes[helper] | {"next_instant"}, f"{name_of(path)} calls {helper} in {function.name}"
            if any(getattr(decorator, "id", "") == "entry" for decorator in function.decorator_list):
                entries[f"{path.parts[-3]}.{path.stem}"] = bool({"run_loop", "_run"} & set(calls))
    assert loops == {"run_loop"}
    assert {name for name, through in entries.items() if through} == {
        "linear.pieces", "linear.stretches", "engine.steps", "engine.stretches",
    }  # fmt: skip
    # the others visit states of a motion that is known, or evaluate sinusoids
    others = {"engine.state", "simulation.waves"}
    assert {name for name, through in entries.items() if not through} <= others


def test_fits_are_an_add_on_that_commands_alone_know() -> None:
    knows = {name_of(path) for path in MODULES if any(name.startswith("icmj.fits") for name in imports(path))}
    outside = {name for name in knows if not name.startswith("icmj.fits")}
    assert outside == {"icmj.cli.commands.fit", "icmj.cli.commands.new"}


def test_contributing_draws_these_floors() -> None:
    page = (PACKAGE.parent / "CONTRIBUTING.md").read_text(encoding="utf-8")
    drawn = [tuple(re.findall(r"`icmj/(\w+)/`", line)) for line in page.splitlines() if line.startswith("| `icmj/")]
    expected = [tuple(folder for folder in floor if (PACKAGE / folder).is_dir()) for floor in reversed(FLOORS)]
    assert drawn == expected


def test_contributing_names_files_that_exist_and_few_for_each_change() -> None:
    """A file is named by its path, or by the end of it if no other path has this end."""
    root = PACKAGE.parent
    page = (root / "CONTRIBUTING.md").read_text(encoding="utf-8")
    folders = [PACKAGE, *(root / name for name in ("docs", "examples", "tests", "benchmarks"))]
    paths = {path.relative_to(root).as_posix() for folder in folders for path in folder.rglob("*.py*")}
    for name in re.findall(r"`([^`\s]+\.pyi?)`", page):
        found = {name} & paths or {path for path in paths if path.endswith(f"/{name}")}
        assert len(found) == 1, f"CONTRIBUTING.md names {name}: {sorted(found) or 'no such file'}"
    for name in re.findall(r"`((?:icmj|docs|tests|examples|\.ci)/[^`\s]*)`", page):
        assert (root / name).exists(), f"CONTRIBUTING.md names {name}, which is not there"
    table = page.partition("## To change X, open Y")[2].partition("\n## ")[0]
    rows = [row for row in table.splitlines() if row.startswith("| ")][2:]
    assert 20 <= len(rows) <= 30
    for row in rows:
        opened = re.findall(r"`((?:icmj|docs|tests)/[^`\s]+)`", row)
        assert 1 <= len(opened) == len(set(opened)) <= 2, f"one or two files, each once: {row}"


def test_the_main_line_is_read_in_ten_files() -> None:
    page = (PACKAGE.parent / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert len(re.findall(r"^\d+\. `icmj/[^`]+\.py`: ", page, flags=re.M)) == 10


def test_the_command_line_prints_in_one_place() -> None:
    """What is printed elsewhere may hold what a terminal obeys, or end in a stream that nobody reads."""
    printed = re.compile(r"(?<![.\w])print\(|\bConsole\(|sys\.stdout\.write|from rich\.(console|markup) ")
    found = {name_of(path) for path in MODULES if printed.search(path.read_text(encoding="utf-8"))}
    assert found == {"icmj.cli.terminal", "icmj.cli.main", "icmj.log.replay", "icmj.engine.faults"}


def test_every_error_can_be_said_again_with_more_words() -> None:
    """Whoever knows the file or the class of a user's own that an error is about says so in an error of its kind."""
    for name in sorted(ALL_NAMES):
        if not name.startswith("icmj.shipped"):
            importlib.import_module(name)
    kinds, left = set[type](), [IcmjError]
    while left:
        kinds.add(kind := left.pop())
        left += kind.__subclasses__()
    for kind in kinds:
        assert str(kind("case.toml: it fell")) == "case.toml: it fell", kind
