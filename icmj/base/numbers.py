"""Formats of numbers that people read, on pages, in cards and on the terminal.

Pages have the typography of a journal (:func:`number`, :func:`error`); cards, summaries and tables have plain decimals
with their unit (:func:`amount`, :func:`relative`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence

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


def lapse(seconds: float, figures: int = 3) -> str:
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
    return f"{mantissa}\N{NO-BREAK SPACE}×\N{NO-BREAK SPACE}10{str(int(exponent)).translate(_SUPERSCRIPT)}".replace(
        "-", "−"
    )


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
