"""A file is one concept: what is public in it uses one another, but for the files that say here why not."""

import ast
from collections import defaultdict
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "icmj"
LARGE = 25  # lines, from which a group of names that use one another is a thing of its own
HEAD = 5  # lines of the first paragraph of a module's docstring, at most
# why a file holds several things that do not use each other
TOGETHER = {
    "base/linking": "the one exception to public interfaces of libraries, with all that it needs",
    "base/parquet": "whether a table ends the process that reads it is asked before it is read",
    "case/notices": "notices, each for itself",
    "measurement/measurement": "a motion, and its growth",
    "report/findings": "figures of fits and experiments, small ones",
    "series/plates": "the load of plates, and what is left out by it",
    "study/kind": "what a kind of experiment offers, and what all of them share",
}


def names_of(node: ast.stmt) -> list[str]:
    """What a statement of a module defines."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    if isinstance(node, ast.Assign):
        return [each.id for target in node.targets for each in ast.walk(target) if isinstance(each, ast.Name)]
    return [node.target.id] if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) else []


def groups_of(source: str) -> list[tuple[str, ...]]:
    """The public names of a module in groups of :data:`LARGE` lines or more that do not use each other."""
    used, lines, group = {}, {}, {}
    for node in ast.parse(source).body:
        here = {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}
        # names of types in quotes, and of what is looked up by name
        here |= {str(each.value) for each in ast.walk(node) if isinstance(each, ast.Constant)}
        for name in names_of(node):
            used[name], lines[name], group[name] = here, (node.end_lineno or 0) - node.lineno + 1, name

    def head(name: str) -> str:
        return name if group[name] == name else head(group[name])

    for name, others in used.items():
        for other in others & set(used):
            group[head(name)] = head(other)
    found = defaultdict(list)
    for name in used:
        found[head(name)].append(name)
    return [
        tuple(name for name in names if not name.startswith("_"))
        for names in found.values()
        if sum(lines[name] for name in names) >= LARGE and not all(name.startswith("_") for name in names)
    ]


def test_groups_are_found() -> None:
    body = "\n".join(f"    x = {i}" for i in range(LARGE))
    apart = f"def one():\n{body}\n\ndef two():\n{body}\n"
    assert groups_of(apart) == [("one",), ("two",)]
    assert groups_of(apart + "\ndef three():\n    one(), two()\n") == [("one", "two", "three")]
    assert groups_of("def one():\n    pass\n\ndef two():\n    pass\n") == []


def test_no_file_holds_two_things() -> None:
    several = {
        path.relative_to(PACKAGE).with_suffix("").as_posix(): groups
        for path in PACKAGE.rglob("*.py")
        if "native" not in path.parts and len(groups := groups_of(path.read_text(encoding="utf-8"))) > 1
    }
    assert several.keys() == TOGETHER.keys(), {name: several.get(name) for name in several.keys() ^ TOGETHER.keys()}


def test_the_first_paragraph_of_every_head_is_short() -> None:
    heads = {
        path.relative_to(PACKAGE).as_posix(): (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "")
        for path in PACKAGE.rglob("*.py")
    }
    first = {name: head.split("\n\n")[0] for name, head in heads.items()}
    assert not {name: text for name, text in first.items() if not text or text.count("\n") >= HEAD}
