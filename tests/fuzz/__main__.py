"""``python -m fuzz``: as many mutations as one likes, and every one that breaks the contract (see `make fuzz`)."""

from __future__ import annotations

import argparse
import sys

from fuzz.contract import fuzz
from tqdm import tqdm


def main() -> int:
    """Exit code 1 where a mutation broke the contract."""
    add = argparse.ArgumentParser("fuzz", description=__doc__)
    add.add_argument("-n", type=int, default=3000, help="mutations (3000)")
    add.add_argument("--seconds", type=float, default=float("inf"), help="stop after these")
    add.add_argument("--first", type=int, default=0, help="the first seed (0)")
    options = add.parse_args()
    broken = 0
    with tqdm(total=options.n, unit="mutation") as bar:
        for tried, faults in fuzz(options.first, options.n, options.seconds):
            for seed, found in sorted(faults.items()):
                bar.write(f"seed {seed}: {'; '.join(found)}")
            broken += len(faults)
            bar.update(tried)
    print(f"{bar.n} mutations, {broken} broke the contract")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
