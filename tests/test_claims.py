"""Every sentence with a number or an agreement names what backs it (``docs/claims.toml``), and numbers are read back.

A sentence of README, documentation, article or report that has a number beside a mark of precision, or a word of
agreement, and stands in no row fails here. Sentences that state no result (a definition, a setting, a source, an
example) stand in rows of their own, ``[[allowed]]``.
"""

import ast
import csv
import json
import math
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

import icmj
from icmj import Case, Result
from icmj.cli.commands import COMMANDS
from icmj.cycle.branch import Branch

ROOT = Path(__file__).resolve().parents[1]
TABLE = tomllib.loads((ROOT / "docs/claims.toml").read_text(encoding="utf-8"))
CLAIMS, ALLOWED = TABLE["claim"], TABLE["allowed"]
WHY = {"definition", "setting", "source", "example"}
PAGES = ["README.md", "paper/paper.md", *sorted(f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md"))]
REPORT = [
    *sorted(str(path.relative_to(ROOT)) for path in (ROOT / "icmj/report/templates").glob("*.j2")),
    *sorted(str(path.relative_to(ROOT)) for path in (ROOT / "icmj/report/sections").glob("*.py")),
    *sorted(str(path.relative_to(ROOT)) for path in (ROOT / "icmj/report/panels").glob("*.py")),
    *(f"icmj/report/{name}.py" for name in ("headline", "abstract", "overview", "wording", "judgement")),
    *(f"icmj/report/{name}.py" for name in ("statements", "experiment", "findings")),
    "icmj/fits/page.py",
    *sorted(str(path.relative_to(ROOT)) for path in (ROOT / "icmj/study/kinds").glob("*.py")),
    *(
        f"icmj/fits/{name}.py"
        for name in ("choice", "groups", "posterior", "calibration", "prediction_check", "family")
    ),
]
PRECISE = re.compile(
    r"10[⁰¹²³⁴-⁹⁻]|10\^|\de[-−+]?\d|%|×|\btimes\b|\bwithin\b|\bdigits?\b|\baccura|\bexact|\bcoincide|(?<![\d.])\d{1,3}\.\d{2,}"
    r"|\d (?:ms|µs|s|MB|GB|kB|min|minutes?|seconds?|hours?|core-hours)\b|\bof \d+\b"
)
AGREEMENT = re.compile(r"\b(?:agree(?:s|d|ment)?|identical|same bits|equals?)\b|bit for bit|last bit|byte for byte")


def plain(text: str) -> str:
    """Text on one line."""
    return " ".join(text.split())


def sentences(text: str) -> Iterator[str]:
    """Sentences and list items of a Markdown page, each on one line, without code and formulae; a table is one."""
    text = re.sub(r"\A---\n.*?\n---\n", "", text, flags=re.S)
    text = re.sub(r"^( *)(```|~~~).*?^\1\2+ *$", "", text, flags=re.S | re.M)
    text = re.sub(r"^\$\$.*?^\$\$", "", text, flags=re.S | re.M)
    parts: list[list[str]] = [[]]
    for line in text.split("\n"):
        stripped = line.strip()
        row, before = stripped.startswith("|"), parts[-1][-1:] != [] and parts[-1][-1].startswith("|")
        if line.startswith("    ") and not before and not parts[-1]:
            continue  # code
        begins = stripped.startswith(("#", ":::")) or re.match(r"[-*] |\d\. ", stripped) is not None
        if not stripped or begins or row != before or (parts[-1][:1] and parts[-1][0].startswith("#")):
            parts.append([])
        if stripped and not stripped.startswith(":::"):
            parts[-1].append(stripped)
    for part in parts:
        said = plain(" ".join(part))
        if said.startswith("|"):
            yield said
        else:
            yield from re.split(r"(?<=[.!?:])[*_)]*\s+(?=[*_(]*[A-ZΔ`$\[(])", said)


def strip_markup(template: str) -> str:
    """What a template prints as it stands, with dots where it prints a value."""
    text = re.sub(r"\{%.*?%\}|\{#.*?#\}", " ", template, flags=re.S)
    return re.sub(r"<[^>]*>", "\n\n", re.sub(r"\{\{.*?\}\}", "…", text, flags=re.S))


def printed(path: Path) -> Iterator[str]:
    """Sentences that a source of the report prints: text of a template, or strings that are no docstrings."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".j2":
        yield from sentences(strip_markup(text))
        return
    tree = ast.parse(text)
    documentation = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documentation:
            template = "{{" in node.value or "{%" in node.value
            yield from sentences(
                strip_markup(node.value) if template else node.value if " " in node.value.strip() else ""
            )


def states(sentence: str) -> bool:
    """Whether it states a number or an agreement."""
    return bool(re.search(r"\d", sentence) and PRECISE.search(sentence)) or bool(AGREEMENT.search(sentence))


def said(name: str) -> list[str]:
    """Sentences of a page or of a source of the report."""
    path = ROOT / name
    return list(sentences(path.read_text(encoding="utf-8")) if path.suffix == ".md" else printed(path))


def quoted(name: str) -> list[str]:
    """What the rows quote of it."""
    return [plain(words) for row in (*CLAIMS, *ALLOWED) if row["in"] == name for words in row["says"]]


def backless(every: list[str], quotes: list[str]) -> list[str]:
    """Those sentences that state something and that no row quotes."""
    return [one for one in every if states(one) and not any(quote in one for quote in quotes)]


@pytest.mark.parametrize("name", [*PAGES, *REPORT])
def test_every_sentence_with_a_number_or_an_agreement_names_what_backs_it(name: str) -> None:
    assert backless(said(name), quoted(name)) == []


def test_sentences_that_state_something_are_found() -> None:
    page = "It is so.\nBoth agree to 10⁻⁹. Half of it.\n\n- a step of 2 ms\n\n| a | 90 % |\n| --- | --- |\n| b | 3 |\n"
    found = backless(list(sentences(page)), [])
    assert found == ["Both agree to 10⁻⁹.", "- a step of 2 ms", "| a | 90 % | | --- | --- | | b | 3 |"]
    assert backless(list(sentences(page)), ["agree to 10⁻⁹", "a step of 2", "b | 3"]) == []


def test_what_a_row_quotes_stands_in_its_file() -> None:
    for row in (*CLAIMS, *ALLOWED):
        every = said(row["in"])
        for words in row["says"]:
            assert any(plain(words) in one for one in every), f"{row['in']}: {words!r} does not stand there any more"


def test_rows_are_whole_and_only_what_states_no_result_is_allowed() -> None:
    assert {row["in"] for row in (*CLAIMS, *ALLOWED)} <= {*PAGES, *REPORT}
    for row in CLAIMS:
        assert set(row) <= {"in", "says", "by", "once", "reads"}, row
        assert row["says"]
        assert row.get("by") or row.get("once"), row
    for row in ALLOWED:
        assert set(row) == {"in", "says", "why"}, row
        assert row["why"] in WHY, row
        assert row["says"]


@cache
def functions(name: str) -> frozenset[str]:
    """Names of the functions that a module of the tests defines."""
    tree = ast.parse((ROOT / name).read_text(encoding="utf-8"))
    return frozenset(node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))


def exists(backing: str) -> bool:
    """Whether there is such a test, command, module, example or script."""
    from benchmarks.__main__ import GROUPS

    first, _, rest = backing.partition(" ")
    if first.startswith("tests/"):
        name, _, function = first.partition("::")
        return (ROOT / name).exists() and (not function or function in functions(name))
    if first == "icmj":
        return rest.split()[0] in COMMANDS.names
    if backing.startswith("python -m benchmarks --only "):
        return backing.rpartition(" ")[2] in GROUPS
    if backing.startswith("python -m "):
        return (ROOT / (rest.split()[1].replace(".", "/") + ".py")).exists()
    if first == "python":
        return (ROOT / rest.split()[0]).exists()
    return (ROOT / first).exists()


def test_what_backs_a_sentence_exists() -> None:
    missing = {backing for row in CLAIMS for backing in row.get("by", ()) if not exists(backing)}
    assert not missing


# how numbers are read back: names in the expressions of ``reads``


@cache
def prepare(name: str, changes: tuple[tuple[str, Any], ...] = ()) -> Case:
    """A shipped case, with some values of its run file replaced."""
    return icmj.prepare(icmj.load_run(name).with_(**dict(changes)))


@cache
def ran(name: str, plant: str) -> Result:
    """A run of a shipped case."""
    return icmj.run_case(icmj.load_run(name), plant, study=True)  # type: ignore[arg-type]


@cache
def followed(name: str, parameter: str, to: float, plant: str = "mujoco", limit: float = 3.0) -> Branch:
    """A branch of cycles of a shipped case."""
    run = icmj.load_run(name).with_(**{"simulation.limit": limit})
    return icmj.follow(run, parameter, to, plant=plant)  # type: ignore[arg-type]


def special(branch: Branch, kind: str, n: int = 0) -> float:
    """Where the n-th special point of a kind lies."""
    return [one.value for one in branch.specials if one.kind == kind][n]


def interval(name: str, changes: tuple[tuple[str, Any], ...] = ()) -> float:
    """Open-loop interval of the exact cycle in MuJoCo."""
    case = prepare(name, (("simulation.limit", 3.0), *changes))
    return float(icmj.find_cycle(case, "mujoco").intervals[0])


def departure(name: str, q_t: float) -> float:
    """Relative departure of that interval from the predicted one at a threshold, as a magnitude."""
    changes = (("controller.q_t", q_t),)
    predicted = prepare(name, changes).prediction.delta_crit
    assert predicted is not None
    return abs(interval(name, changes) / predicted - 1)


@cache
def records(path: Path) -> dict[tuple[str, str], Any]:
    """Records of a study, by case and plant."""
    found = json.loads(path.read_text(encoding="utf-8"))
    return {(record["case"], record["plant"]): record for record in found}


@cache
def young() -> dict[str, tuple[float, float]]:
    """Mean and deviation of the measures of young people, from the shipped file."""
    with (ROOT / "examples/young_people.csv").open(encoding="utf-8") as file:
        rows = csv.reader((line for line in file if not line.startswith("#")), delimiter=";")
        return {row[0]: (float(row[2]), float(row[3])) for row in list(rows)[1:] if not row[1]}


READERS: dict[str, Any] = {
    "icmj": icmj, "np": np, "math": math, "prepare": prepare, "ran": ran, "followed": followed, "special": special,
    "interval": interval, "departure": departure, "young": young, "stats": stats, "root": ROOT,
}  # fmt: skip


def number_of(text: str) -> tuple[float, float]:
    """A printed number, and half a unit of its last digit; for a bound (``< …``) zero and the bound."""
    text = text.replace("−", "-").replace("≈", "").strip()
    bound = text.startswith(("<", "at most"))
    text = text.removeprefix("<").removeprefix("at most").strip()
    digits = {ord(raised): str(i) for i, raised in enumerate("⁰¹²³⁴⁵⁶⁷⁸⁹")} | {ord("⁻"): "-"}
    found = re.fullmatch(r"([+-]?\d+(?:\.\d+)?)?(?: ?[·*] ?)?(?:10([⁻⁰¹²³⁴-⁹]+))?( %)?", text)
    assert found, text
    mantissa, power, percent = found[1] or "1", found[2], found[3]
    scale = 10.0 ** int(power.translate(digits)) if power else 1.0
    scale *= 0.01 if percent else 1.0
    value = float(mantissa) * scale
    unit = 10.0 ** -len(mantissa.partition(".")[2]) * scale
    return (0.0, abs(value)) if bound else (value, 0.5 * unit * (1 + 1e-9))


@pytest.mark.parametrize(("text", "value", "allowed"), [
    ("0.7594", 0.7594, 5e-5), ("−4.5 · 10⁻⁶", -4.5e-6, 5e-8), ("< 10⁻¹²", 0.0, 1e-12), ("44 %", 0.44, 0.005),
    ("2 · 10⁻⁸", 2e-8, 5e-9), ("at most 2.5 %", 0.0, 0.025),
])  # fmt: skip
def test_a_printed_number_is_read(text: str, value: float, allowed: float) -> None:
    assert number_of(text) == pytest.approx((value, allowed), rel=1e-6)


READ = [(f"{row['in']}: {text}", text, expression) for row in CLAIMS for text, expression in row.get("reads", ())]
SIMULATES = re.compile(r"\b(?:ran|followed|interval|departure|error|icmj\.(?:find_cycle|follow|branch_off|modality))\(")


@pytest.mark.parametrize(
    ("text", "expression"),
    [pytest.param(*one, id=name, marks=[pytest.mark.slow] if SIMULATES.search(one[1]) else []) for name, *one in READ],
)
def test_a_number_is_what_is_computed(text: str, expression: str, request: pytest.FixtureRequest) -> None:
    def error(name: str, plant: str) -> float:
        """Relative error of the interval, of the study whose folder the tests were given, or of a run."""
        folder = request.config.getoption("--study")
        if folder is None:
            return icmj.compare(ran(name, plant)).relative_error.interval or math.nan
        return float(records(folder / "summary.json")[name, plant]["relative_error"]["interval"])

    value = float(eval(expression, {**READERS, "error": error}))  # of a file of the repository
    expected, allowed = number_of(text)
    assert abs(value - expected) <= allowed, f"{text} is {value!r}"


def spelt(text: str) -> str:
    """Formulae of a page as its tables spell them: ``2 · 10⁻⁸``."""
    raised = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    text = re.sub(r"\s*\\cdot\s*", " · ", text)
    return re.sub(r"\^\{?(-?\d+)\}?", lambda power: power[1].translate(raised), text)


def test_a_number_that_is_read_back_stands_in_what_its_row_quotes() -> None:
    for row in CLAIMS:
        every = [one for one in said(row["in"]) if any(plain(words) in one for words in row["says"])]
        for text, _ in row.get("reads", ()):
            assert text.removeprefix("at most ") in spelt(" ".join(every)), f"{row['in']}: {text}"
