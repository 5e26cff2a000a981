"""How much of a test split stands in training already: captions word for word, motions within a hand's breadth."""

from __future__ import annotations

from typing import Any

import numpy as np

from motionary.corpus.store import Corpus

NEAR = 15.0  # mm, mean distance of the joints
POSES = 16  # that stand for a window
CANDIDATES = 8  # training windows whose distance is measured exactly
CHUNK = 1024  # windows at once
ROOT_PATH = ("root_angular", "root_linear")  # features of the path, which do not count


def copy_statistics(corpus: Corpus) -> dict[str, dict[str, Any]]:
    """What a system could score by copying, for all test windows and for those of each root.

    Returns:
        {part: {"captions": of test windows, "word_for_word": share of them that training has as normalized words,
        "windows", "near": share with a training window within 15 mm (:func:`nearest_training_window`), "nearest_mm":
        median distance to the nearest}}; {} without test or training windows.
    """
    rows = corpus.rows("test")
    rows, training = rows[~corpus.added[rows]], corpus.rows("train")
    if not len(rows) or not len(training):
        return {}
    distance = nearest_training_window(corpus, rows, training)
    captions, known = corpus.captions, np.isin(corpus.captions.clip, training)
    said = np.isin(captions.key, captions.key[known])
    groups = corpus.clips.group[rows]
    parts = {"all": np.ones(len(rows), bool)}
    if len(np.unique(groups)) > 1:
        parts |= {str(group): groups == group for group in np.unique(groups)}
    found: dict[str, dict[str, Any]] = {}
    for name, where in parts.items():
        asked = np.isin(captions.clip, rows[where])
        found[name] = {
            "captions": int(asked.sum()),
            **({"word_for_word": round(float(said[asked].mean()), 4)} if asked.any() else {}),
            "windows": int(where.sum()),
            "near": round(float((distance[where] <= NEAR).mean()), 4),
            "nearest_mm": round(float(np.median(distance[where])), 2),
        }
    return found


def nearest_training_window(corpus: Corpus, rows: np.ndarray, training: np.ndarray) -> np.ndarray:
    """(N,) mm from each window of `rows` to the nearest of `training`: the mean distance of the joints over 16 poses,
    evenly from the first frame to the last, with the root's path and heading removed.

    So lengths and places do not count, only what the body does. Among the eight nearest by the root of the mean square,
    which is a matrix product, the mean distance is measured.
    """
    wanted, known = (_poses(corpus, these) for these in (rows, training))
    squares, best = (known**2).sum(1), np.full(len(rows), np.inf)
    for start in range(0, len(rows), CHUNK):
        part = wanted[start : start + CHUNK]
        near = squares[None] - 2 * part @ known.T
        count = min(CANDIDATES, len(training))
        for column in np.argpartition(near, count - 1, axis=1)[:, :count].T:
            apart = (part - known[column]).reshape(len(part), -1, 3)
            mean = np.linalg.norm(apart, axis=-1).mean(1) * 1000
            best[start : start + CHUNK] = np.minimum(best[start : start + CHUNK], mean)
    return best


def _poses(corpus: Corpus, rows: np.ndarray) -> np.ndarray:
    """(N, POSES * J * 3) joints in metres, root at the origin of the floor and facing ahead."""
    codec, out = corpus.context.make_codec(), []
    for start in range(0, len(rows), CHUNK):
        chosen = rows[start : start + CHUNK]
        steps = np.linspace(0, 1, POSES)[None] * (corpus.clips.length[chosen] - 1)[:, None]
        frames = corpus.frames[(corpus.clips.offset[chosen][:, None] + steps.round().astype(np.int64)).reshape(-1)]
        frames[:, corpus.context.columns(*ROOT_PATH)] = 0
        positions = codec.decode(frames, fps=corpus.context.fps).positions
        out.append(positions.reshape(len(chosen), -1).astype(np.float32))
    return np.concatenate(out)
