"""``python -m tests.fuzz --minutes 60`` from the checkout: files of all kinds, mutated for as long as wanted.

``--mutants 10000`` puts so many of each kind; ``--kind "run file" --seed 7 --mutants 1`` makes one again.
"""

import argparse
import random
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from fuzz_cases import KINDS, hunt


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=3.0, help="for all kinds together")
    parser.add_argument("--mutants", type=int, default=10**9, help="of each kind at most")
    parser.add_argument("--seed", type=int, default=random.randrange(10**8), help="of the first mutant")
    parser.add_argument("--kind", choices=KINDS, action="append", help="all by default")
    given = parser.parse_args()
    kinds, failed = given.kind or KINDS, 0
    print(f"seeds from {given.seed} on")
    for kind in kinds:
        tally = hunt(kind, range(given.seed, given.seed + given.mutants), 60 * given.minutes / len(kinds))
        print(f"{kind}: {tally}", flush=True)
        for words in (*tally.failures, *tally.long):
            print(f"  {words}")
        failed += len(tally.failures)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
