"""One line of the benchmark table."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from time import perf_counter


@dataclass(frozen=True)
class Row:
    """A measured number.

    Attributes:
        group, name: what was measured.
        value, unit: the number; ``None`` where it was skipped, and ``note`` says why.
        note: how, or in comparison with what.
        bound: what it must not exceed (``at_most``) or fall below, or ``None``.
        at_most: sense of the bound.
    """

    group: str
    name: str
    value: float | None
    unit: str
    note: str = ""
    bound: float | None = None
    at_most: bool = True

    @property
    def met(self) -> bool | None:
        """Whether the bound is met; ``None`` without a bound or a value."""
        if self.bound is None or self.value is None:
            return None
        return self.value <= self.bound if self.at_most else self.value >= self.bound


def least(run: Callable[[], object], repeats: int) -> float:
    """Least time of ``run`` [s] in so many repeats: the one that was disturbed least."""
    times = []
    for _ in range(repeats):
        start = perf_counter()
        run()
        times.append(perf_counter() - start)
    return min(times)


def interleaved(runs: dict[str, Callable[[], object]], repeats: int) -> dict[str, list[float]]:
    """Times [s] of several functions called in turn, so that a slow spell of the machine meets them all."""
    times: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(repeats):
        for name, run in runs.items():
            start = perf_counter()
            run()
            times[name].append(perf_counter() - start)
    return times


def median(values: Iterable[float]) -> float:
    """The median."""
    ordered = sorted(values)
    middle = len(ordered) // 2
    return ordered[middle] if len(ordered) % 2 else (ordered[middle - 1] + ordered[middle]) / 2
