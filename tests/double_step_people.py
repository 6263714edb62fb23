"""``python -m tests.double_step_people people.csv``: how often synthetic people are told rightly (docs/double_step.md).

A hundred people at each refractory duration and a hundred of continuous control follow 40 pairs of steps at each of
eight intervals, with noise; each has pairs and noise of their own. A person is a line of the file and costs some ten
seconds; lines that are there are not computed again, so that the same command goes on where it was interrupted.
"""

import argparse
import csv
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import double_step_cases as cases
import numpy as np

from icmj.controller.step_pairs import double_steps
from icmj.experiments.reconstruction import reconstruct_steps
from icmj.experiments.refractoriness import explain_reactions, refractoriness

DURATIONS = (0.25, 0.35, 0.55, 0.0)  # s; 0: continuous control
ISI = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0)
NUMBERS = ("value", "low", "high")
ESTIMATES = ("free", "fixed", "largest", "range")
FIELDS = (
    "person",
    "put in",
    "told",
    "discarded",
    *(f"{name} {of}" for name in ESTIMATES for of in ("value", "low", "high")),
)


def person(number: int, put_in: float) -> dict[str, object]:
    """What is found of one person, whose seed is their own."""
    seed = len(DURATIONS) * number + DURATIONS.index(put_in)
    pairs = double_steps(ISI, 20, recovery=(1.2, 1.7), seed=seed)
    of = cases.controller("event" if put_in else "continuous", pairs, delta=put_in or 1.0, q_t=0.4)
    seen = reconstruct_steps(cases.recorded(of, pairs, interval=0.02, noise=0.2, seed=seed), "joystick", pairs)
    told, found = explain_reactions(pairs.isi, seen.rt, 0.02), refractoriness(pairs.isi, seen.rt, seed=seed)
    estimates = {f"{name} {of}": getattr(getattr(found, name), of) for name in ESTIMATES for of in NUMBERS}
    return {"person": number, "put in": put_in, "told": told.kind, "discarded": found.discarded, **estimates}


def tally(rows: list[dict[str, str]]) -> None:
    """Print how often each duration came out, and what people were told to be."""
    for put_in in DURATIONS:
        of = [row for row in rows if float(row["put in"]) == put_in]
        kinds = {kind: sum(row["told"] == kind for row in of) for kind in sorted({row["told"] for row in of})}
        words = [f"{put_in:g} s: {len(of)} people, told {kinds}"]
        for name in ("free", "fixed"):
            low, high = (np.array([float(row[f"{name} {end}"]) for row in of]) for end in ("low", "high"))
            if put_in:
                inside = int(((low <= put_in) & (put_in <= high)).sum())
                words.append(f"{name}: inside in {inside}, width {np.median(high - low):.4f} s")
            else:
                words.append(f"{name}: above zero in {int((low > 0).sum())}")
        largest = np.array([float(row["largest value"]) for row in of])
        print("; ".join([*words, f"largest: not zero in {int((largest > 0).sum())}"]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path, help="CSV that people are added to")
    parser.add_argument("--people", type=int, default=100, help="of each kind")
    parser.add_argument("--first", type=int, default=1000, help="number of the first person")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    given = parser.parse_args()
    rows = list(csv.DictReader(given.file.open())) if given.file.exists() else []
    done = {(int(row["person"]), float(row["put in"])) for row in rows}
    every = [(number, put_in) for number in range(given.first, given.first + given.people) for put_in in DURATIONS]
    with given.file.open("a", newline="") as file, ProcessPoolExecutor(given.jobs) as workers:
        writer = csv.DictWriter(file, FIELDS)
        if not rows:
            writer.writeheader()
        for one in as_completed([workers.submit(person, *each) for each in every if each not in done]):
            writer.writerow(one.result())
            file.flush()
    wanted = set(every)
    tally([row for row in csv.DictReader(given.file.open()) if (int(row["person"]), float(row["put in"])) in wanted])


if __name__ == "__main__":
    main()
