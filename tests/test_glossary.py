"""The glossary against the pages: a symbol that several of them use stands there once, with one meaning."""

import re
from collections import defaultdict
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1] / "docs"
ACCENTS = "bar|tilde"  # another symbol; a hat is that of the assumed plant, a dot the rate of the same
NAMES = (
    "alpha|beta|gamma|Gamma|Delta|delta|epsilon|varepsilon|zeta|eta|theta|lambda|mu|xi|Xi|Pi|pi|rho|sigma|Sigma|tau"
    "|varphi|phi|chi|Psi|psi|omega|nabla"
)
LETTER = rf"(?:\\(?:{NAMES})(?![A-Za-z])|\\mathfrak\{{?[A-Z]\}}?|[A-Za-z])"
ACCENTED = rf"(?:\\(?:{ACCENTS})\s*\{{?\s*{LETTER}\s*\}}?|{LETTER})"
SYMBOL = re.compile(rf"({ACCENTED})(?:_(\{{[^}}]*\}}|\\[A-Za-z]+|[A-Za-z0-9]))?")
# what is no symbol: words, operators, environments, layout
LAYOUT = (
    "hat|dot|ddot|left|right|lVert|rVert|lvert|rvert|langle|rangle|exp|ln|log|det|max|min|tan|cos|sin|sum|prod|int|frac"
    "|tfrac|sqrt|cdot|dots|ldots|qquad|quad|partial|times|infty|top|ge|le|ne|approx|propto|mapsto|Rightarrow|pm|in"
)
NO_SYMBOL = re.compile(
    r"\\(?:operatorname|text|begin|end)\{[^}]*\}|\\mathrm\{d\}|\^\{?-?\\top\}?"
    rf"|\\(?:{LAYOUT})(?![A-Za-z])|\\[\\,;!|]"
)


def symbols_of(mathematics: str) -> set[str]:
    """The symbols of a formula: letters with their bar or tilde and their index."""
    plain = NO_SYMBOL.sub(" ", mathematics)
    unknown = set(re.findall(r"\\([A-Za-z]+)", plain)) - {*f"{NAMES}|{ACCENTS}|mathfrak".split("|")}
    assert not unknown, f"{unknown} of {mathematics}: neither a symbol nor among what is none"
    return {
        re.sub(r"[\s{}]", "", letter) + (f"_{re.sub(r'[{}]', '', index)}" if index else "")
        for letter, index in SYMBOL.findall(plain)
    }


def formulas_of(text: str) -> list[str]:
    """What stands between dollars on a page, outside code."""
    text = re.sub(r"```.*?```|`[^`\n]*`", "", text, flags=re.S)
    return [displayed or within for displayed, within in re.findall(r"\$\$(.*?)\$\$|\$([^$]+?)\$", text, flags=re.S)]


def listed() -> dict[str, set[str]]:
    """The symbols of each row of the glossary, by its meaning; forms of a symbol share a row."""
    rows = re.findall(r"^\| (\$.+?\$) \| (.+?) \|$", (DOCS / "glossary.md").read_text("utf-8"), flags=re.M)
    assert len({meaning for _, meaning in rows}) == len(rows)
    return {meaning: set().union(*map(symbols_of, formulas_of(row))) for row, meaning in rows}


def used() -> dict[str, set[str]]:
    """The pages that use each symbol; the table of measures is made of the definitions in the package."""
    texts = {path: path.stem for path in DOCS.glob("*.md") if path.stem != "glossary"}
    texts |= dict.fromkeys((DOCS.parent / "icmj" / "measurement" / "measures").glob("*.py"), "measures")
    pages = defaultdict(set)
    for path, page in texts.items():
        for formula in formulas_of(path.read_text(encoding="utf-8")):
            for symbol in symbols_of(formula):
                pages[symbol].add(page)
    return pages


def test_a_formula_is_taken_apart():
    assert symbols_of(r"\bar x = \varphi(\Delta)\,\hat k x_o + \mathfrak{T}_t e_{hp}^\top") == {
        *(r"\barx", r"\varphi", r"\Delta", "k", "x_o", r"\mathfrakT_t", "e_hp"),
    }  # fmt: skip
    assert symbols_of(r"\operatorname{Re}\mu \ge 0, \dot\theta_\Delta") == {r"\mu", r"\theta_\Delta"}


def test_a_symbol_has_one_row_and_a_meaning_of_its_own():
    symbols = [symbol for row in listed().values() for symbol in row]
    assert len(symbols) > 50
    assert sorted(symbols) == sorted(set(symbols))


def test_the_glossary_has_the_symbols_that_several_pages_use():
    """So that a page which takes up a symbol of another has its meaning; what one page alone uses is defined there."""
    pages, rows = used(), listed()
    known = set().union(*rows.values())
    assert known <= set(pages)
    assert {symbol for symbol, places in pages.items() if len(places) > 1} <= known
    alone = {meaning for meaning, row in rows.items() if len(set().union(*(pages[symbol] for symbol in row))) == 1}
    assert not alone
