"""How often one person's sentence about a motion finds another person's among 32: what a judge could be asked for.

python -m motionary.bench.agreement data/corpus
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import numpy as np

from motionary.corpus.store import SPLITS, Corpus
from motionary.errors import InputError, exit_code
from motionary.language import sentence_embeddings
from motionary.metrics import r_precision
from motionary.metrics.intervals import interval
from motionary.report.table import Table

_POOL, _REPETITIONS = 32, 20


def agreement(corpus: Corpus, source: str | None = None) -> Table:
    """A row for each split: R-precision, in pools of 32, of two sentences about each window, drawn anew 20 times, by
    the frozen sentence model.

    Args:
        source: whose sentences count; None takes all that people wrote.

    Raises:
        InputError: no split has 32 windows with two different ones each.
    """
    rows = []
    for split in SPLITS:
        windows = [_sentences(corpus, row, source) for row in corpus.rows(split, True) if not corpus.added[row]]
        windows = [texts for texts in windows if len(texts) > 1]
        if len(windows) < _POOL:
            continue
        texts = sorted({text for window in windows for text in window})
        at = {text: place for place, text in enumerate(texts)}
        vectors = sentence_embeddings(texts)
        rng, found = np.random.default_rng(0), []
        for _ in range(_REPETITIONS):
            order = rng.permutation(len(windows))
            pairs = np.array([[at[text] for text in rng.choice(windows[i], 2, replace=False)] for i in order])
            found.append(r_precision(vectors[pairs[:, 0]], vectors[pairs[:, 1]], 3, _POOL))
        rows.append([split, str(len(windows)), *(str(interval(shares)) for shares in np.transpose(found))])
    if not rows:
        raise InputError(corpus.folder, "too few sentences", f"needs {_POOL} windows of a split with two each")
    return Table("Sentences by sentences", ["part", "windows", "R@1", "R@2", "R@3"], rows)


def _sentences(corpus: Corpus, row: int, source: str | None) -> list[str]:
    """The different ones that count of a window."""
    captions, at = corpus.captions, slice(corpus.caption_start[row], corpus.caption_start[row + 1])
    counts = captions.human[at] if source is None else captions.source[at] == source
    return list(dict.fromkeys(str(text) for text in captions.text[at][counts]))


def main(arguments: Sequence[str]) -> int:
    """Prints the table; exit code 2 on bad input."""
    parser = argparse.ArgumentParser(prog="python -m motionary.bench.agreement", description=__doc__)
    parser.add_argument("corpus", help="what preprocess wrote, such as data/corpus")
    parser.add_argument("--source", help="whose sentences count, such as humanml3d (default: all that people wrote)")
    options = parser.parse_args(arguments)

    def run() -> None:
        """The table of what was asked for."""
        print(agreement(Corpus.open(options.corpus), options.source).markdown(), end="")

    return exit_code(run)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
