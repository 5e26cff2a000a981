"""Motion to text: a Transformer that translates motion tokens into words (TM2T 3.2, Eq. 4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from motionary.decoding import Averaged, Sampling, beam_search, sample, uniform_noise
from motionary.errors import InputError
from motionary.language import END, PAD, START, UNKNOWN
from motionary.models.consensus import consensus as agree
from motionary.models.io import load_sibling, read_record
from motionary.models.layers import Normalizer, length_mask
from motionary.models.token_transformer import Cache, TokenTransformer
from motionary.models.tokenizer import Tokenizer

if TYPE_CHECKING:
    from motionary.corpus.context import Context


@dataclass(frozen=True)
class Motion2TextConfig:
    """Settings of the captioner; the defaults are the paper's (appendix B).

    Attributes:
        codes: size of the tokenizer's codebook (the stage takes it from there).
        tokens: read motion tokens; False is the ablation of Table 1, which reads the features themselves.
        pose_frames: without tokens, frames that one position of the source holds: 1 reads pose after pose, the
            corpus's unit of frames gives sources as short as those of tokens.
        width, layers, feed_forward, heads: of the Transformer, `layers` in encoder and decoder each.
        dropout: on embeddings and branches.
        label_smoothing: share of the target's probability spread over all words (0 in the paper).
        token_dropout: share of motion tokens hidden from the encoder while training (0 in the paper).
        start_from_codebook: token embeddings start as the tokenizer's codebook, codes of like motion alike (False in
            the paper: at random).
        shifts: starts, in frames, from which a motion is cut into units: training draws one, decoding averages what all
            of them predict (1 in the paper). Which frames share a unit is chance.
        most_words: longest caption.
    """

    codes: int
    tokens: bool = True
    pose_frames: int = 1
    width: int = 512
    layers: int = 4
    feed_forward: int = 2048
    heads: int = 8
    dropout: float = 0.1
    label_smoothing: float = 0.0
    token_dropout: float = 0.0
    start_from_codebook: bool = False
    shifts: int = 1
    most_words: int = 30


class Motion2Text(nn.Module):
    """p(words | motion tokens). Tokens K, K + 1 and K + 2 are start, end and padding of a motion.

    Word embedding and output projection share their weights.
    """

    def __init__(self, config: Motion2TextConfig, context: Context):
        super().__init__()
        if config.width % config.heads:
            raise InputError("motion2text.width", config.width, f"must be divisible by heads={config.heads}")
        if not 1 <= config.shifts <= context.unit:
            raise InputError("motion2text.shifts", config.shifts, f"must lie in 1..{context.unit}")
        self.config, self.context = config, context
        self.start_token, self.end_token, self.pad_token = config.codes, config.codes + 1, config.codes + 2
        words = len(context.vocabulary)
        if config.tokens:
            self.source = nn.Embedding(config.codes + 3, config.width, padding_idx=self.pad_token)
            nn.init.normal_(self.source.weight, std=1.0)
        else:
            self.normalizer = Normalizer(context.mean, context.std)
            if config.pose_frames < 1 or context.unit % config.pose_frames:
                raise InputError(
                    "motion2text.pose_frames", config.pose_frames, f"must divide the unit of {context.unit}"
                )
            self.source = nn.Linear(config.pose_frames * len(context.mean), config.width)
        self.words = nn.Embedding(words, config.width, padding_idx=PAD)
        nn.init.normal_(self.words.weight, std=config.width**-0.5)
        self.body = TokenTransformer(
            config.width, config.heads, config.feed_forward, config.layers, config.layers, config.dropout
        )

    # The source -----------------------------------------------------------------------------------------------------

    def token_source(self, tokens: Tensor, count: Tensor) -> tuple[Tensor, Tensor]:
        """Motion codes (B, S), valid counts (B,) -> ids (B, S + 2) with start, end and padding, and their mask."""
        ids = F.pad(tokens, (1, 1), value=self.pad_token)
        ids[:, 0] = self.start_token
        mask = length_mask(count + 2, ids.shape[1])
        ids = ids.masked_fill(~mask, self.pad_token).scatter(1, count[:, None] + 1, self.end_token)
        return ids, mask

    def embed(self, source: Tensor) -> Tensor:
        """Token ids (B, S), or distributions over the K + 3 tokens (B, S, K + 3), to embeddings (B, S, width)."""
        if source.is_floating_point():
            return source @ self.source.weight
        return self.source(source)

    def embed_motion(self, motion: Tensor, frames: Tensor) -> tuple[Tensor, Tensor]:
        """Raw features (B, T, D), T a multiple of p = pose_frames -> their embeddings (B, T / p, width), mask."""
        size = self.config.pose_frames
        mask = length_mask(frames, motion.shape[1])
        motion = self.normalizer(motion) * mask[..., None]
        positions = (frames + size - 1) // size
        return self.source(motion.unflatten(1, (-1, size)).flatten(2)), length_mask(positions, motion.shape[1] // size)

    def source_of(self, batch: Any) -> tuple[Tensor, Tensor]:
        """Embedded source and its mask, from a batch's tokens or features."""
        if not self.config.tokens:
            return self.embed_motion(batch.motion, batch.frames)
        ids, mask = self.token_source(batch.tokens, batch.token_count)
        if self.training and self.config.token_dropout:
            hidden = torch.rand(ids.shape, device=ids.device) < self.config.token_dropout
            ids = ids.masked_fill(hidden & (ids < self.config.codes), self.pad_token)
        return self.embed(ids), mask

    # Training -------------------------------------------------------------------------------------------------------

    def logits(self, source: Tensor, mask: Tensor, words: Tensor) -> Tensor:
        """Embedded source (B, S, width), its mask, words (B, N) -> logits (B, N, V) of each next word."""
        memory = self.body.encode(source, mask)
        return F.linear(self.body.decode(self._embed_words(words), memory, mask), self.words.weight)

    def nll(self, source: Tensor, mask: Tensor, words: Tensor, smoothing: float = 0.0) -> tuple[Tensor, Tensor]:
        """Eq. 4: negative log-likelihood per predicted word (B, N - 1), zero at padding, and the mask of those."""
        targets = words[:, 1:]
        logits = self.logits(source, mask, words[:, :-1])
        losses = F.cross_entropy(
            logits.transpose(1, 2), targets, ignore_index=PAD, reduction="none", label_smoothing=smoothing
        )
        return losses, targets != PAD

    def loss(self, batch: Any, progress: float, generator: torch.Generator) -> tuple[Tensor, dict[str, Tensor]]:
        """Mean of Eq. 4 over all words of the batch."""
        losses, valid = self.nll(*self.source_of(batch), batch.words, self.config.label_smoothing)
        loss = losses.sum() / valid.sum()
        return loss, {"caption_nll": loss.detach()}

    def validate(self, batch: Any) -> dict[str, Tensor]:
        """The unsmoothed loss per word."""
        losses, valid = self.nll(*self.source_of(batch), batch.words)
        return {"loss": losses.sum() / valid.sum()}

    # Decoding -------------------------------------------------------------------------------------------------------

    def start(self, source: Tensor, mask: Tensor) -> Cache:
        """The decoding state before the first word."""
        return self.body.start(self.body.encode(source, mask), mask)

    def step(self, state: Cache, tokens: Tensor) -> tuple[Tensor, Cache]:
        """See :class:`motionary.decoding.Decoder`."""
        hidden, state = self.body.step(self._embed_words(tokens), state)
        return F.linear(hidden, self.words.weight), state

    def reorder(self, state: Cache, index: Tensor) -> Cache:
        """See :class:`motionary.decoding.Decoder`."""
        return state.reorder(index)

    def _embed_words(self, words: Tensor) -> Tensor:
        return self.words(words) * self.config.width**0.5


MODEL, CONFIG = Motion2Text, Motion2TextConfig


def build(settings: Mapping[str, Any], context: Context, models: Path) -> Motion2Text:
    """A fresh model for the tokenizer in `models/tokenizer`; `settings` are the remaining keys of the config."""
    codes = read_record(models / "tokenizer")["config"]["codes"]
    model = Motion2Text(Motion2TextConfig(codes=codes, **settings), context)
    if model.config.tokens and model.config.start_from_codebook:
        tokenizer = cast(Tokenizer, load_sibling(models, "tokenizer"))
        _start_from(model.source.weight, tokenizer.quantizer.codebook)
    return model


@torch.no_grad()
def _start_from(embedding: Tensor, codebook: Tensor) -> None:
    """The first K of the embeddings (K + 3, width) become a random projection of the codebook (K, d), at unit scale."""
    centred = codebook - codebook.mean(0)
    projected = centred @ torch.randn(codebook.shape[1], embedding.shape[1])
    embedding[: len(codebook)] = projected / projected.std()


class Captioner:
    """Captions motions with a trained :class:`Motion2Text`. Results never depend on the other motions of the call."""

    draws = True  # can choose a caption by consensus of draws

    def __init__(self, model: Motion2Text, tokenizer: Tokenizer | None, chunk: int = 64):
        self.model, self.tokenizer, self.chunk = model.eval(), tokenizer, chunk
        self.context = model.context

    @torch.no_grad()
    def caption(
        self,
        features: Sequence[np.ndarray],
        beams: int = 2,
        n: int = 1,
        seeds: Sequence[int] | None = None,
        temperature: float | None = None,
        consensus: int = 0,
    ) -> list[list[str]]:
        """n captions for each motion.

        Args:
            features: raw features (T, D) of each motion.
            beams: of beam search, which is used unless `temperature` is given (TM2T 4.3: 2).
            n: captions per motion, best first.
            seeds: one per motion, of whatever is drawn for it (0 where not given).
            temperature: draw the captions at this temperature instead.
            consensus: draws of which that one is the caption which agrees best with all (minimum Bayes risk); 0 is beam
                search alone (the paper's).

        Where the model was trained with several `shifts`, a beam search averages over them; draws take turns.

        Returns:
            for each motion, its captions: normalized words joined by spaces.
        """
        for number, array in enumerate(features):
            if array.ndim != 2 or array.shape[1] != len(self.context.mean) or len(array) < 1:
                raise InputError(
                    f"features[{number}]", array.shape, f"must be (T, {len(self.context.mean)}) with at least one frame"
                )
        if n < 1:
            raise InputError("n", n, "must be at least 1")
        seeds = [0] * len(features) if seeds is None else seeds
        # Similar lengths share a chunk, so little is padded.
        order = np.argsort([len(array) for array in features], kind="stable")
        draws = n if temperature is not None else consensus
        chunk = max(1, min(self.chunk // self.model.config.shifts, 4 * self.chunk // max(1, draws)))
        results: list[list[str]] = [[] for _ in features]
        for first in range(0, len(order), chunk):
            chosen = order[first : first + chunk]
            source, mask = self._source([reading for i in chosen for reading in self._readings(features[i])])
            state, own = self.model.start(source, mask), [seeds[i] for i in chosen]
            if temperature is not None:
                captions = self._sample(state, own, n, temperature)
            else:
                captions = self._search(state, len(chosen), beams, n if not consensus else max(beams, n))
            if consensus and temperature is None:
                drawn = self._sample(state, own, consensus, 1.0)
                captions = [agree([*best, *more], more)[:n] for best, more in zip(captions, drawn, strict=True)]
            for i, caption in zip(chosen, captions, strict=True):
                results[i] = caption
        return results

    def _source(self, features: list[np.ndarray]) -> tuple[Tensor, Tensor]:
        model, unit = self.model, self.context.unit
        device = model.words.weight.device
        longest = -(-max(len(array) for array in features) // unit) * unit
        motion = torch.zeros(len(features), longest, features[0].shape[1])
        for row, array in zip(motion, features, strict=True):
            row[: len(array)] = torch.tensor(array)  # a copy: the corpus is a read-only map
            # A motion shorter than one unit holds its last frame.
            row[len(array) : unit] = row[len(array) - 1]
        frames = torch.tensor([max(unit, len(array) // unit * unit) for array in features])
        motion, frames = motion.to(device), frames.to(device)
        if self.tokenizer is None:
            return model.embed_motion(motion, frames)
        ids, mask = model.token_source(self.tokenizer.encode(motion, frames), frames // unit)
        return model.embed(ids), mask

    def _readings(self, motion: np.ndarray) -> list[np.ndarray]:
        """A motion (T, D) from each of its starts, none of which cuts into a last unit."""
        latest = max(0, len(motion) - self.context.unit)
        return [motion[min(start, latest) :] for start in range(self.model.config.shifts)]

    def _search(self, state: Cache, items: int, beams: int, n: int) -> list[list[str]]:
        """The n likeliest captions of each item, averaged over its readings."""
        model, ways = self.model, self.model.config.shifts
        start = torch.full((items,), START, device=state.item.device)
        decoder = Averaged(model, ways) if ways > 1 else model
        found = beam_search(decoder, state, start, END, beams, n, model.config.most_words, banned=_NEVER)
        return [[self._text(hypothesis.tokens) for hypothesis in item] for item in found]

    def _sample(self, state: Cache, seeds: list[int], n: int, temperature: float) -> list[list[str]]:
        """n captions for each seed; the readings of an item take turns.

        The tail of each distribution that label smoothing spread over all words is left out: of ten words one would
        come from it.
        """
        model, steps = self.model, self.model.config.most_words
        readings = state.item.view(len(seeds), -1)
        turns = torch.arange(n, device=readings.device) % readings.shape[1]
        noise = uniform_noise(seeds, n * steps).view(len(seeds) * n, steps)
        state = model.reorder(state, readings[:, turns].flatten())
        start = torch.full((len(noise),), START, device=readings.device)
        sampling = Sampling(temperature, top_p=1 - model.config.label_smoothing)
        words, count = sample(model, state, start, END, noise, steps, sampling, _NEVER)
        texts = [self._text(row[:c].tolist()) for row, c in zip(words, count, strict=True)]
        return [texts[i * n : (i + 1) * n] for i in range(len(seeds))]

    def _text(self, words: list[int]) -> str:
        return self.context.vocabulary.decode(np.array(words, dtype=np.int64))


_NEVER = (PAD, START, UNKNOWN)


def open_captioner(models: str | Path, device: str | torch.device = "cpu") -> Captioner:
    """The captioner of a trained pipeline: `models/motion2text` and, where it reads tokens, `models/tokenizer`."""
    model = cast(Motion2Text, load_sibling(models, "motion2text", device))
    if not model.config.tokens:
        return Captioner(model, None)
    return Captioner(model, cast(Tokenizer, load_sibling(models, "tokenizer", device)))
