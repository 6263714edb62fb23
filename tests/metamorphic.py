"""``python -m tests.metamorphic --minutes 60`` from the checkout: random runs against the rules of all runs.

``--seed 7 --runs 1 --rule order`` carries one out again.
"""

import argparse
import random
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from metamorphic_cases import RULES, Tally, hunt


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--runs", type=int, default=10**9, help="random run files at most; each is put to every rule")
    parser.add_argument("--seed", type=int, default=random.randrange(10**8), help="of the first run file")
    parser.add_argument("--rule", choices=RULES, action="append", help="all by default")
    given = parser.parse_args()
    print(f"seeds from {given.seed} on", flush=True)
    tally = Tally()
    try:
        hunt(range(given.seed, given.seed + given.runs), 60 * given.minutes, given.rule or tuple(RULES), tally)
    except KeyboardInterrupt:
        print("interrupted")
    print(tally)
    for words in tally.failures:
        print(f"  {words}")
    return 1 if tally.failures else 0


if __name__ == "__main__":
    sys.exit(main())
