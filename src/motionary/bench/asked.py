"""Whether motions do what sentences say, in the oracle's eyes: a dictionary is asked, seed by seed.

python -m motionary.bench.asked "a person waves with the left hand" "a person runs"
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from motionary.dictionary import Dictionary, load
from motionary.errors import InputError, exit_code
from motionary.oracle.claims import expected
from motionary.oracle.prompts import confirm
from motionary.report.table import Table


def asked(dictionary: Dictionary, texts: Sequence[str], seeds: int, system: str | None = None) -> Table:
    """A row for each text: in how many of the seeds 0, 1, ... its motion shows all that the text claims.

    Raises:
        InputError: a text that claims nothing that the oracle can read, and whatever `Dictionary.generate` refuses.
    """
    if unread := [text for text in texts if not expected(text)]:
        raise InputError("text", unread[0], "says nothing of side, direction, gait or count that the oracle can read")
    rows = []
    for text in texts:
        found = [confirm(dictionary.generate(text, seed=seed, system=system)[0], text) for seed in range(seeds)]
        rows.append([text, f"{sum(map(bool, found))} of {seeds}"])
    return Table("What motions show", ["sentence", "seeds"], rows)


def main(arguments: Sequence[str]) -> int:
    """Prints the table; exit code 2 on bad input."""
    parser = argparse.ArgumentParser(prog="python -m motionary.bench.asked", description=__doc__)
    parser.add_argument("texts", nargs="+", metavar="TEXT")
    parser.add_argument("--models", default="models", help="folder of trained models (default: %(default)s)")
    parser.add_argument("--system", help="the generator that is asked (default: the usual one)")
    parser.add_argument("--seeds", type=int, default=6, help="variants of each text (default: %(default)s)")
    options = parser.parse_args(arguments)

    def run() -> None:
        """The table of what was asked for."""
        if options.seeds < 1:
            raise InputError("--seeds", options.seeds, "must be at least 1")
        print(asked(load(options.models), options.texts, options.seeds, options.system).markdown(), end="")

    return exit_code(run)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
