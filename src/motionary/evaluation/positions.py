"""Position errors of a system that encodes motion and decodes it again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from motionary.corpus.store import Corpus
from motionary.metrics.position import mpjpe
from motionary.systems.codec import BatchedCodec
from motionary.systems.protocols import MotionCodec

KINDS = ("local", "root", "global")


def position_report(corpus: Corpus, rows: Sequence[int] | np.ndarray, decoded: Sequence[np.ndarray]) -> dict[str, Any]:
    """Mean per-joint position errors in millimetres, over all windows and by root of the data.

    Args:
        corpus: that holds the windows.
        rows: windows that were encoded.
        decoded: their decoded raw features, each (T, D) with T at most the window's length.

    Returns:
        {part: {"windows", "local_mm", "root_mm", "global_mm"}}: local has root and heading removed, root the root
        only, global nothing.
    """
    codec = corpus.context.make_codec()
    errors = []
    for row, features in zip(rows, decoded, strict=True):
        motion = codec.decode(features, fps=corpus.context.fps)
        real = codec.decode(corpus.features(row)[: len(features)], fps=corpus.context.fps)
        errors.append([mpjpe(motion, real, kind) for kind in KINDS])
    table, groups = np.asarray(errors), corpus.clips.group[np.asarray(rows)]
    parts = {"all": np.ones(len(table), bool)}
    if len(np.unique(groups)) > 1:
        parts |= {str(group): groups == group for group in np.unique(groups)}
    return {
        name: {
            "windows": int(where.sum()),
            **{f"{kind}_mm": round(float(v), 3) for kind, v in zip(KINDS, table[where].mean(0), strict=True)},
        }
        for name, where in parts.items()
    }


def test_positions(corpus: Corpus, model: MotionCodec) -> dict[str, Any]:
    """Position errors of the unmirrored test windows through `model`."""
    rows = unmirrored(corpus, "test")
    return position_report(corpus, rows, BatchedCodec(model).reconstruct([corpus.features(i) for i in rows]))


def unmirrored(corpus: Corpus, split: str) -> np.ndarray:
    """Rows of a split without the mirrored copies that preprocess added."""
    rows = corpus.rows(split)
    return rows[~corpus.added[rows]]
