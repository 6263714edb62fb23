"""``python -m tests.spread`` from the checkout: the predicted spread of intervals under noise, against runs.

Of each shipped case, and of random loops of the catalogue, the first orbit that attracts has small noise on every
reading. What runs show may be off by 3 % of the standard deviation of the intervals, and by 0.02 of the correlation of
successive ones; where a few runs show more, or too little, many are made. Of what is refused the sentence is printed.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from catalogue import Loop, random_loop

from icmj import Controller, Gaussian, Settings, load_run, prepare
from icmj.controller.hold import system_matched
from icmj.errors import AnalysisError, IcmjError
from icmj.linear.run import simulate
from icmj.theory import SmallNoise, predict_spread
from icmj.theory.orbit import Orbit

OFF = np.array([0.03, 0.02])  # of the deviation, relative; of the correlation
KNOWN = 1 / 3  # of these: standard errors of what runs show
EVENTS, SETTLING = 12_000, 500  # of a run, and those of them that are left out
FEWEST, MOST = 4, 48  # runs at first, and where these do not tell
GRID = 150  # values of the noise in an interval
SHARE = 1e-6  # of the largest output: noise that is small for any orbit
SMALL = 0.001  # of the threshold: the error of the event function that the noise is made to have


def run(loop: Loop, orbit: Orbit, drawn: tuple[Gaussian, ...]) -> np.ndarray:
    """The intervals of a run under noise that begins on the orbit."""
    system = loop.system
    law = Controller(system.design, system.hold or system_matched(system.design), loop.rule, system.delay)
    settings = Settings(duration=EVENTS * orbit.delta, record_interval=1e5, limit=1e6, disturbance=drawn)
    x, x_o, x_h = system.start(orbit.x_bar)
    return np.diff(simulate(system.actual, law, settings, x0=x, x_o0=x_o, x_h0=x_h).events.t)[SETTLING:]


def judge(loop: Loop, orbit: Orbit) -> dict[str, object]:
    """How far deviation and correlation of runs are off what is predicted, and whether that is little.

    Raises:
        AnalysisError: if no spread is predicted.
    """
    outputs, interval = loop.system.actual.outputs, orbit.delta / GRID
    none, size = np.zeros(loop.system.n), SHARE * float(np.max(orbit.y_peak))
    for _ in range(2):  # first to learn which size is small enough
        noise = [SmallNoise(none, size * reading, interval) for reading in np.eye(len(outputs))]
        spread = predict_spread(loop.system, loop.rule, orbit, noise)
        used, size = size, size * SMALL / spread.epsilon
    kept: list[np.ndarray] = []
    for runs in (FEWEST, MOST):
        while len(kept) < runs:
            first = len(kept) * len(outputs)
            drawn = (
                Gaussian(output=name, size=used, interval=interval, seed=first + i) for i, name in enumerate(outputs, 1)
            )
            kept.append(run(loop, orbit, tuple(drawn)))
        mean = np.concatenate(kept).mean()
        moments = np.array([[np.mean(v * v), np.mean(v[1:] * v[:-1])] for v in (each - mean for each in kept)])
        square, both = moments.mean(axis=0)
        off = np.array([np.sqrt(square) / spread.deviation - 1, both / square - spread.correlation[0]])
        # of each run, by how much it moves either
        moved = np.column_stack([moments[:, 0] / square / 2, (moments[:, 1] - both / square * moments[:, 0]) / square])
        error = moved.std(axis=0, ddof=1) / np.sqrt(len(kept))
        if (np.abs(off) < OFF).all() and (error < KNOWN * OFF).all():
            break
    how = "differs" if (np.abs(off) > OFF).any() else "unclear" if (error > KNOWN * OFF).any() else "agrees"
    return {"judged": how, "epsilon": spread.epsilon, "off": off.tolist(), "error": error.tolist(), "runs": len(kept)}


def draw(seed: int, loops: int) -> Iterator[tuple[str, Loop, Orbit | None]]:
    """Each shipped case, and so many random loops with an orbit that attracts."""
    for path in sorted((Path(__file__).parents[1] / "runs").glob("*.toml")):
        theory = prepare(load_run(path)).theory
        if theory is not None:
            yield path.stem, Loop(theory.system, theory.rule, "shipped"), theory.prediction.orbit
    number = 0
    while loops:
        number += 1
        with suppress(IcmjError):
            loop = random_loop(seed, number)
            for one in [one for one in loop.predict().orbits if one.verdict == "attracting"][:1]:
                yield str(number), loop, one.orbit
                loops -= 1


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--loops", type=int, default=50, help="random loops with an orbit that attracts")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    warnings.filterwarnings("ignore", "(overflow|invalid value) encountered", RuntimeWarning)
    counted: Counter[str] = Counter()
    for name, loop, orbit in draw(given.seed, given.loops):
        try:
            if orbit is None:
                raise AnalysisError("no spread is predicted without an orbit; simulate")
            row = judge(loop, orbit)
        except AnalysisError as error:
            row = {"judged": "refused", "words": str(error)}
        counted[f"{'shipped' if loop.kind == 'shipped' else 'random'}: {row['judged']}"] += 1
        print(json.dumps({"loop": name, **row}, ensure_ascii=False), flush=True)
    print(json.dumps(counted, indent=1))
    return int(any(key.endswith("differs") for key in counted))


if __name__ == "__main__":
    sys.exit(main())
