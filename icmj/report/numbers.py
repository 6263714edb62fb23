"""Numbers as a reader of a journal expects them: significant figures, powers of ten, true minus signs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

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
