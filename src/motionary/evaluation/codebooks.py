"""Motion tokens: of shifted windows, how often each is used, what each looks like (TM2T Fig. 3 and 9)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from motionary.corpus.store import Corpus
from motionary.corpus.token_store import TokenStore
from motionary.systems.codec import BatchedCodec
from motionary.systems.protocols import MotionCodec


def shifted_tokens(corpus: Corpus, tokens: TokenStore, tokenizer: MotionCodec, shifts: int) -> list[TokenStore]:
    """The tokens of training windows from their first, second, ... frame on, for `Pairs`.

    A token stands for four frames; which four is chance, and one clip read from four starts gives four sentences.

    Args:
        tokens: of the windows from their first frame on.
        tokenizer: that wrote them.
        shifts: starts, at least 1.

    Returns:
        `shifts` stores; beyond the first, windows of other splits and those of less than two tokens are empty.
    """
    unit = corpus.context.unit
    rows = [row for row in corpus.rows("train") if corpus.clips.length[row] >= 2 * unit]
    reader, stores = BatchedCodec(tokenizer), [tokens]
    for shift in range(1, shifts):
        codes = [np.zeros(0, dtype=np.int64)] * len(corpus)
        windows = [corpus.features(row)[shift:] for row in rows]
        for row, sequence in zip(rows, reader.encode(windows, f"shift {shift}"), strict=True):
            codes[row] = sequence
        stores.append(TokenStore.collect(codes))
    return stores


def code_usage(codes: Sequence[np.ndarray], count: int) -> dict[str, float]:
    """Share of the codebook that the windows use, and the perplexity of the codes' frequencies.

    Args:
        codes: code sequences of all windows.
        count: entries of the codebook.
    """
    frequency = np.bincount(np.concatenate(codes), minlength=count)
    share = frequency[frequency > 0] / frequency.sum()
    return {
        "count": count,
        "used": round(float((frequency > 0).mean()), 4),
        "perplexity": round(float(np.exp(-(share * np.log(share)).sum())), 2),
    }


def draw_contexts(model: Any, codes: Sequence[np.ndarray], columns: int = 8, rows: int = 4):
    """The most frequent tokens, each decoded alone to its four frames: a matplotlib figure.

    Args:
        model: a trained tokenizer.
        codes: code sequences of all windows.
        columns, rows: of the grid.
    """
    from matplotlib.figure import Figure

    context = model.context
    frequency = np.bincount(np.concatenate(codes), minlength=model.config.codebook_size)
    chosen = np.argsort(-frequency, kind="stable")[: columns * rows]
    segments = model.token_contexts()[chosen].cpu().numpy()
    codec = context.make_codec()
    figure = Figure(figsize=(1.5 * columns, 1.7 * rows))
    for place, (code, features) in enumerate(zip(chosen, segments, strict=True)):
        axis = figure.add_subplot(rows, columns, place + 1)
        positions = codec.decode(features, fps=context.fps).positions
        for frame, pose in enumerate(positions):
            # A quarter view: forward runs to the right, the body's left comes towards the reader.
            across = 0.8 * pose[:, 2] + 0.6 * pose[:, 0] + 0.35 * frame
            for chain in context.skeleton.chains:
                axis.plot(across[list(chain)], pose[list(chain), 1], color=_SHADES[frame % 4], linewidth=1.2)
        axis.set_title(f"{code} ({frequency[code] / frequency.sum():.1%})", fontsize=7)
        axis.set_aspect("equal")
        axis.set_axis_off()
    figure.tight_layout()
    return figure


_SHADES = ("#9ecae1", "#6baed6", "#3182bd", "#08519c")
