"""Notices to the user: kind, severity, and a text that says what to do."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal, get_args

from icmj.errors import ModelError

Kind = Literal[
    "not at rest", "kink", "dry friction", "feedthrough", "coarse derivatives", "uncontrollable", "unobservable",
    "sensor bias", "outputs", "operating point", "dropped state", "keyframe", "saturation", "joint limit", "not linear",
    "large step", "not smooth", "paper", "slow noise", "set-point", "sampling delay",
]  # fmt: skip
KINDS: tuple[str, ...] = get_args(Kind)


@dataclass(frozen=True)
class Notice:
    """One notice.

    Attributes:
        kind: name by which a run file allows it.
        severity: ``error`` if it would make a prediction meaningless, otherwise ``warning``.
        words: one sentence: what is wrong, where, and what to do.
    """

    kind: Kind
    severity: Literal["warning", "error"]
    words: str

    def __str__(self) -> str:
        return f"{self.kind}: {self.words}"


def permitted(notices: Iterable[Notice], allow: Iterable[str], where: str) -> tuple[Notice, ...]:
    """The notices, with allowed errors turned into warnings; raises if one is an error that is not allowed.

    Raises:
        ModelError: the first error not allowed, with how to allow it; it begins with ``where``.
    """
    allowed, result = set(allow), []
    for notice in notices:
        if notice.severity == "error" and notice.kind not in allowed:
            raise ModelError(f'{where}: {notice} (or go on with [analysis] allow = ["{notice.kind}"])')
        result.append(replace(notice, severity="warning"))
    return tuple(dict.fromkeys(result))
