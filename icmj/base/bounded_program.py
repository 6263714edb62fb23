"""A program in a process of its own, held to limits: a damaged file or a crashing model ends it, and not this one."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Mapping, Sequence


def run_bounded(
    command: Sequence[str],
    clock: float,
    *,
    processor: int | None = None,
    addresses: int | None = None,
    data: int | None = None,
    stack: int | None = None,
    environment: Mapping[str, str] | None = None,
) -> subprocess.CompletedProcess[str]:
    """Run a program without input and without a core dump; what it writes to standard error is kept.

    The shell sets the limits, because setting them in Python between fork and exec is not safe with threads. Those that
    the system does not have, or that lie above its own, are left out; the one on the clock always holds.

    Args:
        command: the program and its arguments.
        clock: longest time [s].
        processor: longest processor time [s].
        addresses, data, stack: most memory in all, of data, and of the stack [bytes].
        environment: variables beside those of this process.

    Raises:
        subprocess.TimeoutExpired: if it takes longer than ``clock``.
    """
    words = list(command)
    if os.name == "posix":
        sizes = {"v": addresses, "d": data, "s": stack}
        limits = {kind: size >> 10 for kind, size in sizes.items() if size is not None}
        limits |= {"c": 0} if processor is None else {"c": 0, "t": processor}
        shell = "; ".join(f"ulimit -{kind} {most} 2>/dev/null" for kind, most in limits.items())
        words = ["/bin/sh", "-c", f'{shell}; exec "$@"', "sh", *words]
    return subprocess.run(
        words,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        timeout=clock,
        check=False,
        env={**os.environ, **(environment or {})},
    )
