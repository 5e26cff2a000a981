"""Texts and motions in TEMOS's joint space, and search of the corpus there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from motionary.corpus.ragged import Ragged
from motionary.corpus.refeatured import from_corpus
from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.files import atomic_file, save_array, written_by
from motionary.language import Sentence
from motionary.nn.neighbors import nearest
from motionary.nn.padding import by_length, pad
from motionary.systems.temos.temos import Temos
from motionary.systems.temos.temos_generator import TemosGenerator

INDEX = "index.npy"


class JointSpace:
    """The means of both encoders' distributions, which training brings together for matching texts and motions.

    Args:
        model: trained with a motion encoder.
        hash: names its weights.
        batch_size: items of a forward pass.
    """

    def __init__(self, model: Temos, hash: str, batch_size: int = 64):
        self.model, self.hash, self.batch_size = model.eval(), hash, batch_size
        self.context = model.context
        self._reader = TemosGenerator(model, lambda *_: (), batch_size)

    @torch.no_grad()
    def motions(self, features: Sequence[np.ndarray], progress: str | None = None) -> np.ndarray:
        """(N, latent) float32 of raw features (T, D) of the corpus's codec."""
        codec, fps = self.model.codec, self.model.config.fps
        return self.own([from_corpus(row, self.context, codec, fps) for row in features], progress)

    @torch.no_grad()
    def own(self, features: Sequence[np.ndarray] | Ragged, progress: str | None = None) -> np.ndarray:
        """The same of features of the model's own codec and rate."""
        rows = range(len(features))
        out = np.empty((len(rows), self.model.config.latent), np.float32)
        device = self.model.normalizer.mean.device
        for chosen in by_length([len(features[i]) for i in rows], self.batch_size, progress):
            batch, frames = pad([features[i] for i in chosen])
            out[chosen] = self.model.encode_motion(batch.to(device), frames.to(device)).mean.float().cpu().numpy()
        return out

    def sentences(self, sentences: Sequence[Sentence]) -> np.ndarray:
        """(N, latent) float32 of sentences."""
        return self._reader.latents(sentences).mean.float().cpu().numpy()


@dataclass(frozen=True)
class LatentIndex:
    """Means of every window of a corpus, (N, latent) float32."""

    motions: np.ndarray

    def save(self, folder: Path) -> None:
        """Beside the model's weights."""
        with atomic_file(folder / INDEX) as path:
            save_array(path, self.motions)

    @classmethod
    def load(cls, folder: Path, stage: str) -> LatentIndex:
        """What :meth:`save` wrote; a model without a motion encoder has none, which is an InputError."""
        with written_by(stage, folder / INDEX):
            return cls(np.load(folder / INDEX))


class JointSearch:
    """The windows of a corpus that lie nearest to a text in the joint space; a :class:`protocols.CorpusSearch`."""

    def __init__(self, corpus: Path, judge: JointSpace, index: LatentIndex):
        self.corpus, self.judge, self.index = Corpus.open(corpus), judge, index
        if len(index.motions) != len(self.corpus):
            raise InputError("index", len(index.motions), f"must have one row per window, {len(self.corpus)}")

    def search(self, sentences: Sequence[Sentence], k: int = 5) -> np.ndarray:
        """(N, k) rows of the corpus, without the mirrored copies that were added, nearest first."""
        rows = np.flatnonzero(~self.corpus.added)
        return rows[nearest(self.judge.sentences(sentences), self.index.motions[rows], k)]
