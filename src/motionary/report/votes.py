"""What people answered on the page of blinded comparisons: a share with its interval (TEMOS Fig. 3, appendix C).

python -m motionary.report.votes answers/*.json
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motionary.errors import InputError, exit_code

Z = 1.959964  # of a 95% interval


@dataclass(frozen=True)
class Verdict:
    """How often `a` was preferred to `b`.

    Attributes:
        question: that was asked.
        a, b: what was compared.
        share: of the texts for which most raters chose `a`; a tie is half.
        low, high: Wilson's 95% interval of it over texts.
        texts: compared.
        raters: whose answers count, and `rejected`, who failed a catch trial.
    """

    question: str
    a: str
    b: str
    share: float
    low: float
    high: float
    texts: int
    raters: int
    rejected: int

    def __str__(self) -> str:
        return (
            f"{self.question} {self.a} rather than {self.b}: {100 * self.share:.1f}% "
            f"({100 * self.low:.1f} to {100 * self.high:.1f}%), {self.texts} texts, {self.raters} raters"
            + (f", {self.rejected} rejected by catch trials" if self.rejected else "")
        )


def read_votes(paths: Sequence[str | Path]) -> Verdict:
    """The verdict of several visits to one page.

    Warm-ups do not count, and neither do the answers of a rater who failed a catch trial. Each text counts for the side
    that most raters chose.

    Raises:
        InputError: a file that the page did not save, files of different pages, nobody who passed.
    """
    visits = [_read(Path(path)) for path in paths]
    if not visits:
        raise InputError("answers", "none", "must be at least one file that the page saved")
    heads = {(visit["question"], visit["a"], visit["b"]) for visit in visits}
    if len(heads) > 1:
        raise InputError("answers", f"{len(heads)} pages", "must be of one page: the same question and systems")
    kept = [visit for visit in visits if _passed(visit)]
    votes: dict[int, list[bool]] = {}
    for visit in kept:
        for given in visit["answers"]:
            if given["kind"] == "pair":
                votes.setdefault(given["id"], []).append(given["chosen"] == "a")
    if not votes:
        raise InputError("answers", f"{len(visits)} visits", "must hold one that passed its catch trials")
    shares = [sum(found) / len(found) for found in votes.values()]
    share = sum(0.5 if part == 0.5 else float(part > 0.5) for part in shares) / len(shares)
    question, a, b = heads.pop()
    return Verdict(question, a, b, share, *wilson(share, len(shares)), len(shares), len(kept), len(visits) - len(kept))


def wilson(share: float, count: int) -> tuple[float, float]:
    """Wilson's 95% interval of a share of `count` things (Wilson 1927): within 0..1 for any share."""
    extra = Z * Z / count
    middle = (share + extra / 2) / (1 + extra)
    half = Z / (1 + extra) * math.sqrt(share * (1 - share) / count + extra / (4 * count))
    return middle - half, middle + half


def _passed(visit: Mapping[str, Any]) -> bool:
    return all(given["chosen"] == "a" for given in visit["answers"] if given["kind"] == "catch")


def _read(path: Path) -> dict[str, Any]:
    try:
        visit = json.loads(path.read_text(encoding="utf-8"))
        parts = [(given["id"], given["kind"], given["chosen"]) for given in visit["answers"]]
        if not all(isinstance(visit[key], str) for key in ("question", "a", "b")) or not parts:
            raise ValueError("no answers")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(path, error, "must be a file that the page of comparisons saved") from None
    return visit


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints the verdict; exit code 2 and one line on bad input."""
    parser = argparse.ArgumentParser(prog="python -m motionary.report.votes", description=__doc__)
    parser.add_argument("files", nargs="+", help="what visitors saved")
    files = parser.parse_args(arguments).files
    return exit_code(lambda: print(read_votes(files)))


if __name__ == "__main__":
    sys.exit(main())
