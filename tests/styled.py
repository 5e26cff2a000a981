"""A corpus of made-up features whose style and action can be told, and stylizers that tell the truth about it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

STYLES, ACTIONS = ("calm", "big", "slow", "rare"), ("bow", "walk", "wave", "none")


def styled_corpus(context, copies: int = 6, bare: int = 4, labels: bool = True, seed: int = 0):
    """Four styles by four actions, `copies` windows each ("rare": one), and `bare` windows without labels.

    An action is an oscillation of some features, a style a shift of others.
    """
    rng = np.random.default_rng(seed)
    context = replace(context, styles=STYLES if labels else (), actions=ACTIONS if labels else ())
    shifts, waves = rng.normal(size=(4, context.dim)), rng.normal(size=(4, context.dim))
    cells = [(s, a) for s in range(4) for a in range(4) for _ in range(1 if s == 3 else copies)] if labels else []
    cells += [(-1, -1)] * bare
    windows = []
    for number, (s, a) in enumerate(cells):
        steps = np.arange(rng.integers(8, 14) * 4)
        wave = np.sin(2 * np.pi * steps / 16 + rng.uniform(0, 6))[:, None] * (waves[a] if a >= 0 else waves[number % 4])
        x = 2 * wave + (shifts[s] if s >= 0 else 0) + 0.1 * rng.normal(size=(len(steps), context.dim))
        windows.append((context.mean + 0.4 * context.std * x).astype(np.float32))
    lengths = np.array([len(w) for w in windows])
    style, action = (np.array([cell[i] for cell in cells]) for i in (0, 1))
    split = np.array([("train", "train", "test", "val")[i % 4] for i in range(len(cells))])
    offset = np.cumsum(lengths) - lengths
    clips = SimpleNamespace(
        length=lengths,
        offset=offset,
        mirrored=np.zeros(len(cells), bool),
        split=split,
        origin=np.array([f"clip{i}" for i in range(len(cells))]),
        style=np.array([STYLES[s] if s >= 0 else "" for s in style]),
        action=np.array([ACTIONS[a] if a >= 0 else "" for a in action]),
    )
    return SimpleNamespace(
        context=context,
        clips=clips,
        frames=np.concatenate(windows),
        style_ids=style,
        action_ids=action,
        hash="made",
        features=lambda i: windows[i],
        folder="made",
    )


class Copier:
    """Gives every content back unchanged."""

    receptive = 8

    def stylize(self, contents, *, seeds, **asked):
        return [np.array(c) for c in contents]

    def style_codes(self, motions, *, setting, labels=None):
        return np.stack([m.mean(0)[:8] for m in motions])


class Perfect(Copier):
    """Returns a real motion of the wanted style and of the content's own action, cut or repeated to its length.

    It reads the content's action and, where only a reference is given, its style, off the corpus.
    """

    def __init__(self, corpus):
        self.corpus, self.asked = corpus, []

    def _row(self, features):
        lengths = np.flatnonzero(self.corpus.clips.length == len(features))
        return next(i for i in lengths if np.array_equal(self.corpus.features(i), features))

    def stylize(self, contents, *, seeds, setting, labels=None, references=None, predict_root=True):
        self.asked.append((setting, labels is not None, references is not None, predict_root))
        rows, out = [self._row(c) for c in contents], []
        for i, row in enumerate(rows):
            style = self.corpus.style_ids[row]
            if labels is not None:
                style = labels[i]
            elif references is not None:
                style = self.corpus.style_ids[self._row(references[i])]
            action = self.corpus.action_ids[row]
            cell = np.flatnonzero((self.corpus.style_ids == style) & (self.corpus.action_ids == action))
            chosen = self.corpus.features(cell[seeds[i] % len(cell)])
            out.append(np.resize(chosen, (len(contents[i]), chosen.shape[1])))
        return out
