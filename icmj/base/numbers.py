"""Numbers as people read them.

A fact is a number with a name, a unit and a meaning, said once for all who show it.

Pages have the typography of a journal (:func:`number`, :func:`error`); cards, summaries and tables have plain decimals
with their unit (:func:`amount`, :func:`relative`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from typing import Any, Literal

import numpy as np

from icmj.base.array import Array

MISSING = "–"
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: float | None, figures: int = 4) -> str:
    """``value`` with this number of significant figures; with powers of ten outside 1e-3 … 1e5; a dash if missing."""
    if value is None or np.isnan(value):
        return MISSING
    if np.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value == 0:
        return "0"
    mantissa, exponent = f"{value:.{figures - 1}e}".split("e")
    power = int(exponent)
    if -4 < power < 5:
        return f"{float(f'{value:.{figures - 1}e}'):.{max(figures - 1 - power, 0)}f}".replace("-", "−")
    return _power(mantissa, power)


def _power(mantissa: str, power: int) -> str:
    """Scientific notation: ``1.2 × 10⁻³``, without places to break a line."""
    return f"{mantissa}\N{NO-BREAK SPACE}×\N{NO-BREAK SPACE}10{str(power).translate(_SUPERSCRIPT)}".replace("-", "−")


def short(value: float, figures: int = 6) -> str:
    """``value`` to this number of significant figures without trailing zeros, for settings and matrix entries."""
    text = number(value, figures)
    head, times, power = text.partition("\N{NO-BREAK SPACE}×")
    return (head.rstrip("0").rstrip(".") if "." in head else head) + times + power


def amount(value: float | None, unit: str = "", figures: int = 6) -> str:
    """A number with its unit, angles also in degrees; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return MISSING
    value += 0.0  # not −0
    degrees = f" ({math.degrees(value):.4g}°)" if unit == "rad" else ""
    return (f"{value:.{figures}g} {unit}".rstrip() + degrees).replace("-", "−")


def readable(unit: str) -> tuple[float, str]:
    """The factor on a value in a unit of sway, and the unit that people read: mm of lengths, degrees of angles."""
    found = re.match(r"(m|cm|rad)(²?)(?=$|/)", unit)
    if found is None:
        return 1.0, unit
    factor, name = {"m": (1e3, "mm"), "cm": (10.0, "mm"), "rad": (180 / math.pi, "°")}[found[1]]
    return factor ** (2 if found[2] else 1), f"{name}{unit[len(found[1]) :]}"


def format_duration(seconds: float, figures: int = 3) -> str:
    """A length of time, from two minutes on in the unit of which there are two at least."""
    for unit, size in (("years", 365.25 * 86400), ("days", 86400.0), ("hours", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.{figures}g} {unit}"
    return f"{seconds:.0f} s" if seconds >= 10 else f"{seconds:.2g} s"


def amounts(values: Array | None, names: Sequence[str], units: Sequence[str], figures: int = 4) -> str:
    """Numbers with their names and units, one after another; without names where these are not known."""
    if values is None or len(values) == 0:
        return MISSING
    names = names if len(names) == len(values) else ("",) * len(values)
    units = units if len(units) == len(values) else ("",) * len(values)
    each = (f"{name} {amount(float(v), u, figures)}".strip() for v, name, u in zip(values, names, units, strict=True))
    return ", ".join(words.replace(" ", "\N{NO-BREAK SPACE}") for words in each)


ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth")


def ordinal(i: int) -> str:
    """``first`` for 0, and so on."""
    return ORDINALS[i] if i < len(ORDINALS) else f"{i + 1}th"


def count(number: int, what: str) -> str:
    """``1 state``, ``2 states``."""
    return f"{number} {what}" + ("" if number == 1 else "s")


def relative(value: float | None) -> str:
    """A relative error with its sign."""
    return MISSING if value is None or not math.isfinite(value) else f"{value:+.1e}".replace("-", "−")


def pairs(values: Iterable[complex], figures: int = 6) -> str:
    """Characteristic roots, each conjugate pair once."""
    each = (
        amount(root.real, "", figures) + (f" ± {amount(root.imag, '', figures)}j" if root.imag > 0 else "")
        for root in values
        if root.imag >= 0
    )
    return ", ".join(each)


def root(value: complex, figures: int = 4) -> str:
    """An eigenvalue or multiplier, real where its imaginary part is rounding."""
    if abs(value.imag) <= 1e-12 * max(1.0, abs(value)):
        return amount(value.real, "", figures)
    return f"{amount(value.real, '', figures)} {'+' if value.imag > 0 else '−'} {amount(abs(value.imag), '', figures)}j"


def error(value: float | None, *, signed: bool = True) -> str:
    """A relative error to two figures as a power of ten, with its sign or as a magnitude; rounding noise as such."""
    if value is None or not np.isfinite(value):
        return MISSING
    if abs(value) < 1e-14:
        return "< 10⁻¹⁴"
    mantissa, exponent = (f"{value:+.1e}" if signed else f"{abs(value):.1e}").split("e")
    return _power(mantissa, int(exponent))


def eigenvalue(value: complex | None) -> str:
    """λ on the unit circle: ``+1``, ``−1`` or a complex number."""
    if value is None:
        return MISSING
    if abs(value.imag) < 1e-9:
        return f"{value.real:+.4g}".replace("-", "−")
    return complex_number(value)


def complex_number(value: complex, figures: int = 4) -> str:
    """``a ± bj`` is written once for each pole of the pair: ``a + bj``."""
    if abs(value.imag) <= 1e-9 * abs(value):
        return number(value.real, figures)
    sign = "+" if value.imag > 0 else "−"
    return f"{number(value.real, figures)} {sign} {number(abs(value.imag), figures)}j"


def poles(values: Iterable[complex]) -> str:
    """A list of poles, each conjugate pair written once as ``a ± bj``."""
    shown = []
    for pole in values:
        if abs(pole.imag) <= 1e-9 * abs(pole):
            shown.append(number(pole.real))
        elif pole.imag > 0:
            shown.append(f"{number(pole.real)} ± {number(pole.imag)}j")
    return ", ".join(shown)


def mark(value: bool | None) -> str:
    """✓, ✗, or a dash if there is no verdict."""
    return MISSING if value is None else "✓" if value else "✗"


def setting(value: object) -> str:
    """A setting or fact of a run."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return short(value)
    if isinstance(value, Mapping):
        return ", ".join(f"{key} = {setting(item)}" for key, item in value.items()) or MISSING
    if isinstance(value, list | tuple):
        return "[" + ", ".join(setting(item) for item in value) + "]"
    return str(value)


Kind = Literal["number", "whole", "count", "truth", "text", "eigenvalue", "outputs"]
Place = Literal["record", "column", "logged"]


@dataclass(frozen=True)
class Fact:
    """One fact of a prediction or of a run.

    Attributes:
        name: what it is called in files, unless one of the last three says otherwise.
        label: what it is called in tables and cards.
        unit: "" if it has none; ``outputs`` have their own.
        meaning: in a phrase.
        of: reads it from that of which it is a fact; ``None`` where it does not exist.
        kind: of its value; ``outputs`` is a number for each output.
        figures: significant figures that are shown.
        answers: what is shown instead of true and false.
        only: the runs that have it: on ``mujoco``, or under ``noise``; "" for all.
        against: the fact of a prediction with which it is compared.
        record, column, logged: its key in ``summary.json``, its column in a sweep, and its property in a log; "" where
            it is not, the name if ``None``.
    """

    name: str
    label: str
    unit: str
    meaning: str
    of: Callable[[Any], Any]
    kind: Kind = "number"
    figures: int = 6
    answers: tuple[str, str] = ("yes", "no")
    only: str = ""
    against: str = ""
    record: str | None = None
    column: str | None = None
    logged: str | None = None

    def key(self, place: Place) -> str:
        """Its name in a place, "" where it is not."""
        given: str | None = getattr(self, place)
        return self.name if given is None else given

    def label_of(self, output: str) -> str:
        """Its label for one output."""
        return self.label.replace("each output", output)

    def value(self, thing: Any) -> Any:
        """Its value; ``None`` where it does not exist, or is a single number that is not finite."""
        found = self.of(thing)
        if found is None or self.kind == "text" or self.kind == "eigenvalue":
            return found
        if self.kind == "outputs":
            return np.asarray(found, float)
        if self.kind == "truth":
            return bool(found)
        return int(found) if self.kind != "number" else float(found) if math.isfinite(found) else None

    def shown(self, value: Any, names: Sequence[str] = (), units: Sequence[str] = ()) -> str:
        """A value of it for people; ``names`` and ``units`` are those of the outputs."""
        if value is None:
            return MISSING
        if self.kind == "outputs":
            return amounts(value, names, units, self.figures)
        if self.kind == "eigenvalue":
            return eigenvalue(value)
        if self.kind == "truth":
            return self.answers[0] if value else self.answers[1]
        return amount(value, self.unit, self.figures) if self.kind == "number" else str(value)


def collect_facts(facts: Iterable[Fact], thing: Any, place: Place, names: Sequence[str] = ()) -> dict[str, Any]:
    """Facts of a thing by their keys in a place.

    With ``names``, those of the outputs, what is one for each output has a key for each.
    """
    found: dict[str, Any] = {}
    for fact in facts:
        if key := fact.key(place):
            value = fact.value(thing)
            if fact.kind == "outputs" and names:
                each = () if value is None else zip(names, value, strict=False)
                found |= {f"{key}_{of}": float(v) if math.isfinite(v) else None for of, v in each}
            else:
                found[key] = value
    return found


def pick(thing: Any, *names: str) -> dict[str, Any]:
    """Attributes of ``thing`` by their names, as a record tells them."""
    return {name: getattr(thing, name) for name in names}


def plain(value: Any) -> Any:
    """``value`` as JSON can hold it."""
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, np.bool_ | np.integer):
        return value.item()
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, complex | np.complexfloating):
        return [plain(value.real), plain(value.imag)]
    if isinstance(value, np.ndarray):
        return [plain(entry) for entry in value]
    if is_dataclass(value) and not isinstance(value, type):
        return plain(vars(value))
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    return [plain(entry) for entry in value]
