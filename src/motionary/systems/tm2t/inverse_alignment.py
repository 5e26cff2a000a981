"""Text to motion tokens trained through motion to text: inverse alignment (TM2T 3.3, Eq. 7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, cast

import torch
import torch.nn.functional as F
from torch import Tensor

from motionary.corpus.batch import AlignedBatch
from motionary.corpus.context import Context
from motionary.errors import HEAVIEST, InputError, check_range
from motionary.systems.tm2t.motion2text import Motion2Text
from motionary.systems.tm2t.text2token import Text2Token, Text2TokenConfig
from motionary.systems.tm2t.token_gru import TokenGRU
from motionary.systems.trainable import Loss


@dataclass(frozen=True)
class InverseAlignmentConfig(Text2TokenConfig):
    """Settings of text2token, which it starts from, and of the second term of Eq. 7; conf/inverse_alignment.yaml
    explains these."""

    section: ClassVar[str] = "inverse_alignment"

    alignment: bool = True
    caption_weight: float = 1.0
    gumbel_temperature: float = 1.0
    sampled_share: float = 1.0

    def __post_init__(self):
        super().__post_init__()
        if self.architecture != "gru":
            raise InputError("inverse_alignment", self.architecture, "needs text2token.architecture=gru (TM2T 3.3)")
        check_range("inverse_alignment", self, ("caption_weight",), 0, HEAVIEST)
        if not 0 < self.gumbel_temperature <= 1000:
            rule = "must be above 0, at most 1000"
            raise InputError("inverse_alignment.gumbel_temperature", self.gumbel_temperature, rule)
        if not 0 < self.sampled_share <= 1:
            raise InputError("inverse_alignment.sampled_share", self.sampled_share, "must be in (0, 1]")


class InverseAlignment(Text2Token):
    """A :class:`Text2Token` whose samples must be captioned with the words they were made from.

    `reader` is the frozen motion2text. It belongs to training only: it is no part of the saved weights, and its own
    weights take no gradient. Where it learned words as people write them it reads each caption's, while the normalized
    ones make the tokens; the paper has normalized words for both.
    """

    config: InverseAlignmentConfig

    def __init__(self, config: InverseAlignmentConfig, context: Context):
        super().__init__(config, context)
        self._reader: tuple[Motion2Text, ...] = ()  # a tuple, so that it is not registered as a submodule

    @property
    def reads(self) -> dict[str, Any]:
        """What the reader needs of captions beside their normalized words, as keywords of `Pairs`."""
        if not self._reader:
            return {}
        config, context = self._reader[0].config, self._reader[0].context
        return {"sources": config.sources, "said": context.vocabulary if config.wording == "written" else None}

    def learn_from(self, reader: Motion2Text) -> None:
        """Freeze `reader` and use it for the second term."""
        if reader.config.codebook_size != self.config.codebook_size or not reader.config.tokens:
            raise InputError("models/motion2text", reader.config, "must read the tokens of the same tokenizer")
        if reader.config.token_layers != 1:
            rule = "must be 1 to teach text2token, which writes the base of tokens in layers"
            raise InputError("motion2text.token_layers", reader.config.token_layers, rule)
        normalized = reader.config.wording == "normalized"
        if normalized and reader.context.vocabulary.words != self.context.vocabulary.words:
            raise InputError("models/motion2text", "vocabulary", "must be that of text2token")
        self._reader = (reader.eval().requires_grad_(False),)

    def loss(self, batch: AlignedBatch, progress: float, generator: torch.Generator) -> Loss:
        """Eq. 7: the tokens' loss plus the loss of the captions given the sampled tokens."""
        loss, logs = super().loss(batch, progress, generator)
        if not self.config.alignment:
            return loss, logs
        caption, length = self.caption_loss(batch, generator)
        total = loss + self.config.caption_weight * caption
        return total, {**logs, "caption_nll": caption.detach(), "sampled_tokens": length}

    def validate(self, batch: AlignedBatch) -> dict[str, Tensor]:
        """The tokens' loss and, with fixed noise, the captions'; "loss" is what is trained.

        The control is read too where there is a reader, so that both can be compared by the captions' loss.
        """
        values = super().validate(batch)
        if not self.config.alignment and not self._reader:
            return values
        generator = torch.Generator(batch.words.device).manual_seed(0)
        caption, _ = self.caption_loss(batch, generator)
        total = values["loss"] + self.config.caption_weight * caption if self.config.alignment else values["loss"]
        return {"loss": total, "token_nll": values["loss"], "caption_nll": caption}

    def caption_loss(self, batch: AlignedBatch, generator: torch.Generator) -> tuple[Tensor, Tensor]:
        """Mean loss per word of the captions, given tokens that this model samples for them; and their mean length.

        Gradients reach this model through the one-hot samples and, for the choice of the end, through the sequence
        mask: a token counts by the product of (1 - end) over the tokens before it, which is 1 up to the end.
        """
        if not self._reader:
            raise InputError("models/motion2text", "missing", "call learn_from(motion2text) before training")
        rows: Tensor | slice = slice(None)
        if self.config.sampled_share < 1:  # at random: batches are sorted by length
            rows = torch.randperm(len(batch.words), generator=generator, device=batch.words.device)
            rows = rows[: max(1, round(self.config.sampled_share * len(rows)))]
        words, count = batch.words[rows], batch.word_count[rows]
        tags = None if batch.tags is None else batch.tags[rows]
        net = cast(TokenGRU, self.net)
        start = torch.full((len(words),), self.start_token, device=words.device)
        # One step more than the longest motion: room for its end. (R, S, K + 3)
        samples = net.gumbel(
            net.start(words, tags, count), start, self.config.max_tokens + 1, self.end_token,
            self.config.gumbel_temperature, generator,
        )  # fmt: skip
        source, mask = self._as_source(samples, start)  # (R, S + 1, K + 3), (R, S + 1)
        reader = self._reader[0].to(words.device)
        said = words if reader.config.wording == "normalized" else batch.said[rows]
        losses, valid = reader.nll(*reader.tagged(reader.embed(source), mask, batch, rows), said)  # (R, N - 1) both
        return losses.sum() / valid.sum(), mask.sum(1).float().mean() - 2  # without start and end

    def _as_source(self, samples: Tensor, start: Tensor) -> tuple[Tensor, Tensor]:
        """One-hot samples (B, S, K + 3) -> motion2text's source with a start, each row masked behind its end.

        A row that never drew an end gets one in place of its last token.
        """
        ended = samples[..., self.end_token]
        last = F.one_hot(torch.full_like(start, self.end_token), samples.shape[-1]).to(samples.dtype)
        before = torch.cumprod(1 - ended[:, :-1], dim=1)
        alive = F.pad(before, (1, 0), value=1.0)
        # Sums of exact zeros and ones: comparing them is safe.
        open_ended = alive[:, -1:] * (1 - ended[:, -1:])
        tail = samples[:, -1] + open_ended.detach() * (last - samples[:, -1])
        samples = torch.cat((samples[:, :-1], tail[:, None]), dim=1) * alive[..., None]
        first = F.one_hot(start, samples.shape[-1]).to(samples.dtype)[:, None]
        mask = F.pad(alive.detach() > 0, (1, 0), value=True)
        return torch.cat((first, samples), dim=1), mask
