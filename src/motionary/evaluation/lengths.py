"""How well lengths are predicted from text: hits, likelihood against the training histogram, densities (Fig. 4.9)."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap
from typing import Any

import numpy as np

from motionary.corpus.store import Corpus
from motionary.evaluation.items import Items, sentence_of
from motionary.systems.protocols import TextToLength


def length_histogram(corpus: Corpus) -> np.ndarray:
    """(T_max,) share of the captioned training windows of each length, in units; every length is counted once more,
    so that none is impossible."""
    context = corpus.context
    units = corpus.clips.length[corpus.rows("train", captioned=True)] // context.unit
    counts = 1.0 + np.bincount(np.clip(units, 1, context.max_tokens) - 1, minlength=context.max_tokens)
    return counts / counts.sum()


def score_lengths(lengths: TextToLength, corpus: Corpus, split: str = "test") -> dict[str, Any]:
    """Report over every caption of a split, for all of them and for each part.

    Returns:
        {part: {"items", "model": {...}, "histogram": {...}}} with the share of lengths within one and within three
        units of the likeliest, and the negative log-likelihood in nats. The histogram does not read the text.
    """
    items = Items(corpus, split)
    captions = np.concatenate(items.captions)
    items.rows = np.repeat(items.rows, [len(c) for c in items.captions])
    true = np.clip(corpus.clips.length[items.rows] // corpus.context.unit, 1, corpus.context.max_tokens) - 1
    found = predicted(lengths, corpus, captions)
    blind = np.broadcast_to(length_histogram(corpus), found.shape)
    where = {"all": np.arange(len(captions)), **items.parts(captions)}
    return {
        name: {"items": len(rows), "model": hits(found[rows], true[rows]), "histogram": hits(blind[rows], true[rows])}
        for name, rows in where.items()
    }


def predicted(
    lengths: TextToLength, corpus: Corpus, captions: Sequence[int] | np.ndarray, batch: int = 256
) -> np.ndarray:
    """(N, T_max) distributions for caption rows."""
    sentences = [sentence_of(corpus, caption) for caption in captions]
    parts = [lengths.distribution(sentences[i : i + batch]) for i in range(0, len(sentences), batch)]
    return np.concatenate(parts)


def hits(probabilities: np.ndarray, true: np.ndarray) -> dict[str, float]:
    """Scores of distributions (N, T_max) against true columns (N,)."""
    off = np.abs(probabilities.argmax(1) - true)
    likelihood = np.take_along_axis(probabilities, true[:, None], axis=1)
    return {
        "within_1": round(float((off <= 1).mean()), 4),
        "within_3": round(float((off <= 3).mean()), 4),
        "nll": round(float(-np.log(np.maximum(likelihood, 1e-30)).mean()), 4),
    }


def draw_densities(lengths: TextToLength, corpus: Corpus, split: str = "test", count: int = 6):
    """Distributions for a few texts with the lengths of all motions so described, as Fig. 4.9: a matplotlib figure."""
    from matplotlib.figure import Figure

    items = Items(corpus, split)
    captions = np.concatenate(items.captions)
    keys = corpus.captions.key[captions]
    _, first = np.unique(keys, return_index=True)
    chosen = captions[np.random.default_rng(0).permutation(first)[:count]]
    density = predicted(lengths, corpus, chosen)
    units = np.arange(1, density.shape[1] + 1)
    columns = 3
    figure = Figure(figsize=(3.6 * columns, 2.4 * -(-len(chosen) // columns)))
    for place, (caption, row) in enumerate(zip(chosen, density, strict=True)):
        same = captions[keys == corpus.captions.key[caption]]
        true = corpus.clips.length[corpus.captions.clip[same]] // corpus.context.unit
        axis = figure.add_subplot(-(-len(chosen) // columns), columns, place + 1)
        axis.bar(units, row, width=1.0, color=np.where(np.isin(units, true), "#08519c", "#9ecae1"))
        lines = wrap(str(corpus.captions.text[caption]), 50, max_lines=3, placeholder=" …")
        axis.set_title("\n".join(lines), fontsize=7)
        axis.tick_params(labelsize=6)
        axis.set_xlabel(f"units of {corpus.context.unit} frames (dark: true lengths)", fontsize=6)
    figure.tight_layout()
    return figure
