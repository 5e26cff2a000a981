"""What the oracle says of a test split: its cuts from the training clips, and the share of captions it confirms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from motionary.corpus.store import Corpus
from motionary.evaluation.items import Items
from motionary.language import Sentence
from motionary.oracle.calibration import fit_thresholds
from motionary.oracle.prompts import confirm
from motionary.oracle.thresholds import Thresholds


@lru_cache(maxsize=1)
def fitted_oracle(corpus: Corpus, most: int = 800) -> Thresholds:
    """The oracle's cuts, fixed on (at most `most`) unmirrored training windows and one caption of each."""
    rows = corpus.rows("train", captioned=True)
    rows = rows[~corpus.clips.mirrored[rows]]
    rows = np.sort(np.random.default_rng(0).permutation(rows)[:most])
    captions = [str(corpus.captions.text[corpus.caption_start[row]]) for row in rows]
    return fit_thresholds([corpus.motion(row) for row in rows], captions)


def confirmed(
    items: Items, sentences: Sequence[Sentence], features: Sequence[np.ndarray], parts: Mapping[str, np.ndarray]
) -> dict[str, Any]:
    """Share of motions that the oracle confirms, of the captions that claim something it can read.

    Args:
        items: the test items.
        sentences: one for each item.
        features: raw features (T, D) of the motion to check against each.
        parts: positions of the items in each part.

    Returns:
        {part: {"confirmed", "checked"}}.
    """
    thresholds, pairs = fitted_oracle(items.corpus), zip(items.motions(features), sentences, strict=True)
    verdicts = [confirm(motion, sentence.text, thresholds) for motion, sentence in pairs]
    known = np.array([v is not None for v in verdicts])
    right = np.array([bool(v) for v in verdicts])
    out = {}
    for name, where in parts.items():
        checked = where[known[where]]
        if len(checked):
            out[name] = {"confirmed": round(float(right[checked].mean()), 4), "checked": len(checked)}
    return out
