"""How long a motion lasts, given its text (thesis 4.2.2): a distribution over lengths in units of four frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from motionary.corpus.batch import TextBatch
from motionary.corpus.context import Context
from motionary.errors import WIDEST, InputError, check_range, check_share
from motionary.language import Sentence
from motionary.nn.decoding import Sampling
from motionary.nn.layers import TextEncoder, hide_words
from motionary.nn.precision import widened
from motionary.systems.requests import encode_sentences
from motionary.systems.trainable import Loss, Trainable

LENGTH_STREAM = 1  # beside a generation's own seed, so that drawing a length leaves the motion's noise alone


@dataclass(frozen=True)
class Text2LengthConfig:
    """Settings of the length distribution, here the released implementation's; conf/text2length.yaml explains each."""

    word_dim: int = 300
    text_width: int = 512
    tags: bool = True
    dropout: float = 0.0
    word_dropout: float = 0.0
    target_std: float = 0.0

    def __post_init__(self) -> None:
        check_range("text2length", self, ("word_dim", "text_width"), 1, WIDEST)
        check_share("text2length", self, ("dropout", "word_dropout"))
        check_range("text2length", self, ("target_std",), 0, 1000)


class Text2Length(Trainable):
    """p(T | sentence) over T = 1 .. T_max units; T_max is the longest window of the corpus."""

    def __init__(self, config: Text2LengthConfig, context: Context):
        super().__init__()
        self.config, self.context = config, context
        self.text = TextEncoder(
            len(context.vocabulary), config.word_dim, config.text_width, config.tags, config.dropout
        )
        width = config.text_width
        self.head = nn.Sequential(
            nn.Dropout(config.dropout),
            nn.Linear(2 * width, width),
            nn.LayerNorm(width),
            nn.LeakyReLU(0.2),
            nn.Linear(width, context.max_tokens),
        )

    def forward(self, words: Tensor, tags: Tensor | None, count: Tensor) -> Tensor:
        """words (B, N), tags (B, N) | None, count (B,) -> logits (B, T_max), column k for k + 1 units."""
        return widened(self.head(self.text.sentence(words, tags, count)))

    def loss(self, batch: TextBatch, progress: float, generator: torch.Generator) -> Loss:
        """Cross-entropy with the true length, or with a bell around it (`target_std`)."""
        words = hide_words(batch.words, self.config.word_dropout, generator) if self.training else batch.words
        logits, target = self(words, batch.tags, batch.word_count), self._target(batch)  # (B, T_max), (B,)
        nll = F.cross_entropy(logits, target)
        if not self.config.target_std:
            return nll, {"nll": nll.detach()}
        units = torch.arange(logits.shape[1], device=logits.device)
        # A softmax and not the normal density: what lies beyond the shortest and longest length is shared out again.
        bell = torch.softmax(-0.5 * ((units - target[:, None]) / self.config.target_std).square(), dim=-1)  # (B, T_max)
        return F.cross_entropy(logits, bell), {"nll": nll.detach()}

    @torch.no_grad()
    def validate(self, batch: TextBatch) -> dict[str, Tensor]:
        """Negative log-likelihood in nats, and the share of lengths within one unit of the likeliest."""
        logits, target = self(batch.words, batch.tags, batch.word_count), self._target(batch)
        near = (logits.argmax(-1) - target).abs() <= 1
        return {"loss": F.cross_entropy(logits, target), "within_1": near.float().mean()}

    def _target(self, batch: TextBatch) -> Tensor:
        units = torch.div(batch.frames, self.context.unit, rounding_mode="floor")
        return units.clamp(1, self.context.max_tokens) - 1


class Lengths:
    """Lengths for sentences with a trained :class:`Text2Length`; none depends on the other sentences of the call."""

    def __init__(self, model: Text2Length):
        self.model, self.context = model.eval(), model.context

    @torch.no_grad()
    def distribution(self, sentences: Sequence[Sentence]) -> np.ndarray:
        """(B, T_max) probabilities, column k for k + 1 units."""
        device = next(self.model.parameters()).device
        logits = self.model(*encode_sentences(self.context, sentences, device))
        return torch.softmax(logits.double(), dim=-1).cpu().numpy()

    def sample(
        self, sentences: Sequence[Sentence], seeds: Sequence[int], likeliest: bool = False, temperature: float = 1.0
    ) -> list[int]:
        """Frames (a multiple of the unit) for each sentence, drawn from its distribution or the likeliest.

        Raises:
            InputError: not one seed per sentence, or a temperature that is not positive.
        """
        if len(seeds) != len(sentences):
            raise InputError("seeds", len(seeds), f"must be one per sentence, {len(sentences)}")
        if not sentences:
            return []
        probabilities = torch.from_numpy(self.distribution(sentences))
        if likeliest:
            units = probabilities.argmax(-1)
        else:
            noise = [np.random.default_rng([int(seed), LENGTH_STREAM]).random() for seed in seeds]
            draw = Sampling(temperature).draw
            units = draw(probabilities.log(), torch.tensor(noise, dtype=torch.float64))
        return [(int(k) + 1) * self.context.unit for k in units]
