"""Motion to text: a Transformer that translates motion tokens into words (TM2T 3.2, Eq. 4)."""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from motionary.corpus.batch import CaptionBatch, SourcedBatch
from motionary.corpus.context import Context
from motionary.errors import DEEPEST, WIDEST, InputError, check_range, check_share
from motionary.language import PAD
from motionary.nn.layers import Normalizer, length_mask
from motionary.nn.transformer import Cache, TokenTransformer
from motionary.systems.trainable import Trainable

WORDINGS = ("normalized", "written")


@dataclass(frozen=True)
class Motion2TextConfig:
    """Settings of the captioner, here the paper's (appendix B); conf/motion2text.yaml explains each.

    Attributes:
        codebook_size: of the tokenizer (the stage takes it from there).
        sources: of captions, each with a tag that says whose words follow; captions get the first one's (the stage
            takes them from the corpus). None: no tags.
    """

    codebook_size: int
    tokenizer: str = "tokenizer"
    tokens: bool = True
    token_layers: int = 1
    pose_frames: int = 1
    width: int = 512
    num_layers: int = 4
    dim_feedforward: int = 2048
    num_heads: int = 8
    dropout: float = 0.1
    label_smoothing: float = 0.0
    token_dropout: float = 0.0
    start_from_codebook: bool = False
    offsets: int = 1
    ensemble: int = 1
    max_words: int = 30
    wording: str = "normalized"
    source: str = "none"
    sources: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.wording not in WORDINGS:
            raise InputError("motion2text.wording", self.wording, f"must be one of {', '.join(WORDINGS)}")
        object.__setattr__(self, "sources", tuple(self.sources))  # JSON knows lists alone
        sizes, stacks = ("width", "dim_feedforward", "num_heads"), ("num_layers", "pose_frames", "offsets", "ensemble")
        stacks += ("token_layers",)
        check_range("motion2text", self, sizes, 1, WIDEST)
        check_range("motion2text", self, stacks, 1, DEEPEST)
        check_range("motion2text", self, ("max_words",), 1, 1000)
        check_share("motion2text", self, ("dropout", "label_smoothing", "token_dropout"))
        if self.width % self.num_heads:
            raise InputError("motion2text.width", self.width, f"must be divisible by num_heads={self.num_heads}")


class Motion2Text(Trainable):
    """p(words | motion tokens). Tokens K, K + 1 and K + 2 are start, end and padding of a motion; where tokens have
    L layers that are read, the codes of layer l are K l, ..., and K L takes the place of K.

    Word embedding and output projection share their weights.
    """

    def __init__(self, config: Motion2TextConfig, context: Context):
        super().__init__()
        if not 1 <= config.offsets <= context.unit:
            raise InputError("motion2text.offsets", config.offsets, f"must lie in 1..{context.unit}")
        self.config, self.context = config, context
        self.codes = config.codebook_size * config.token_layers
        self.start_token, self.end_token, self.pad_token = self.codes, self.codes + 1, self.codes + 2
        words = len(context.vocabulary)
        if config.tokens:
            self.source = nn.Embedding(self.codes + 3, config.width, padding_idx=self.pad_token)
            nn.init.normal_(self.source.weight, std=1.0)
        else:
            self.normalizer = Normalizer(context.mean, context.std)
            if context.unit % config.pose_frames:
                raise InputError(
                    "motion2text.pose_frames", config.pose_frames, f"must divide the unit of {context.unit}"
                )
            self.source = nn.Linear(config.pose_frames * len(context.mean), config.width)
        self.words = nn.Embedding(words, config.width, padding_idx=PAD)
        nn.init.normal_(self.words.weight, std=config.width**-0.5)
        self.body = TokenTransformer(
            config.width, config.num_heads, config.dim_feedforward, config.num_layers, config.num_layers, config.dropout
        )
        self.tags = nn.Embedding(len(config.sources), config.width) if config.sources else None

    # The source -----------------------------------------------------------------------------------------------------

    def token_source(self, tokens: Tensor, count: Tensor) -> tuple[Tensor, Tensor]:
        """Motion codes (B, S), valid counts (B,) -> ids (B, S + 2) with start, end and padding, and their mask.

        Of tokens in layers (B, S, L) the first `token_layers` are read; more than one give ids (B, S + 2, layers).
        """
        layers = self.config.token_layers
        if tokens.dim() == 3 and layers > 1:
            shift = self.config.codebook_size * torch.arange(layers, device=tokens.device)
            each = [self._framed(codes, count) for codes in (tokens[..., :layers] + shift).unbind(-1)]
            return torch.stack([ids for ids, _ in each], -1), each[0][1]
        return self._framed(tokens[..., 0] if tokens.dim() == 3 else tokens, count)

    def _framed(self, tokens: Tensor, count: Tensor) -> tuple[Tensor, Tensor]:
        """Codes (B, S) -> ids (B, S + 2) between start and end, and their mask."""
        ids = F.pad(tokens, (1, 1), value=self.pad_token)
        ids[:, 0] = self.start_token
        mask = length_mask(count + 2, ids.shape[1])
        ids = ids.masked_fill(~mask, self.pad_token).scatter(1, count[:, None] + 1, self.end_token)
        return ids, mask

    def embed(self, source: Tensor) -> Tensor:
        """Token ids (B, S), or distributions over the K + 3 tokens (B, S, K + 3), to embeddings (B, S, width); those
        of ids in layers (B, S, L) are summed."""
        if source.is_floating_point():
            return source @ self.source.weight
        embedded = self.source(source)
        return embedded.sum(2) if source.dim() == 3 else embedded

    def embed_tokens(self, tokens: Tensor, count: Tensor) -> tuple[Tensor, Tensor]:
        """Motion codes (B, S), valid counts (B,) -> their embeddings (B, S + 2, width), mask."""
        ids, mask = self.token_source(tokens, count)
        return self.embed(ids), mask

    def embed_motion(self, motion: Tensor, frames: Tensor) -> tuple[Tensor, Tensor]:
        """Raw features (B, T, D), T a multiple of p = pose_frames -> their embeddings (B, T / p, width), mask."""
        size = self.config.pose_frames
        mask = length_mask(frames, motion.shape[1])
        motion = self.normalizer(motion) * mask[..., None]
        positions = (frames + size - 1) // size
        return self.source(motion.unflatten(1, (-1, size)).flatten(2)), length_mask(positions, motion.shape[1] // size)

    def source_of(self, batch: CaptionBatch) -> tuple[Tensor, Tensor]:
        """Embedded source and its mask, from a batch's tokens or features, behind the tags of its captions' sources."""
        if not self.config.tokens:
            return self.tagged(*self.embed_motion(batch.motion, batch.frames), batch)
        ids, mask = self.token_source(batch.tokens, batch.token_count)
        if self.training and self.config.token_dropout:
            hidden = torch.rand(mask.shape, device=ids.device) < self.config.token_dropout
            hidden = hidden[..., None] if ids.dim() == 3 else hidden
            ids = ids.masked_fill(hidden & (ids < self.codes), self.pad_token)
        return self.tagged(self.embed(ids), mask, batch)

    def tagged(
        self, source: Tensor, mask: Tensor, of: SourcedBatch | int, rows: Tensor | slice = slice(None)
    ) -> tuple[Tensor, Tensor]:
        """An embedded source (B, S, width) and its mask, with a tag before it: of each caption's source, those of these
        rows of a batch, or all of one number; as they are where the model knows no sources. (The paper trains on one
        source at a time.)
        """
        if self.tags is None:
            return source, mask
        one = isinstance(of, int)
        ids = torch.full_like(mask[:, 0], of, dtype=torch.long) if one else of.source[rows]
        return torch.cat((self.tags(ids)[:, None], source), dim=1), F.pad(mask, (1, 0), value=True)

    @torch.no_grad()
    def start_from(self, codebook: Tensor) -> None:
        """Token embeddings become a random projection of the codebook (K, d) at unit scale; in layers, of the codebooks
        (K L, d), so that their sum is that of the summed entries."""
        centred = codebook - codebook.mean(0)
        projected = centred @ torch.randn(codebook.shape[1], self.config.width)
        self.source.weight[: len(codebook)] = projected / projected.std()

    # Training -------------------------------------------------------------------------------------------------------

    def logits(self, source: Tensor, mask: Tensor, words: Tensor) -> Tensor:
        """Embedded source (B, S, width), its mask, words (B, N) -> logits (B, N, V) of each next word."""
        memory = self.body.encode(source, mask)
        return F.linear(self.body.decode(self._embed_words(words), memory, mask), self.words.weight)

    def nll(self, source: Tensor, mask: Tensor, words: Tensor, smoothing: float = 0.0) -> tuple[Tensor, Tensor]:
        """Eq. 4: negative log-likelihood per predicted word (B, N - 1), zero at padding, and the mask of those."""
        targets = words[:, 1:]  # (B, N - 1)
        logits = self.logits(source, mask, words[:, :-1])  # (B, N - 1, V)
        losses = F.cross_entropy(
            logits.transpose(1, 2), targets, ignore_index=PAD, reduction="none", label_smoothing=smoothing
        )
        return losses, targets != PAD

    def loss(
        self, batch: CaptionBatch, progress: float, generator: torch.Generator
    ) -> tuple[Tensor, dict[str, Tensor]]:
        """Mean of Eq. 4 over all words of the batch."""
        losses, valid = self.nll(*self.source_of(batch), batch.words, self.config.label_smoothing)
        # Over words and not over captions: each word counts alike, in a long caption as in a short one.
        loss = losses.sum() / valid.sum()
        return loss, {"caption_nll": loss.detach()}

    def validate(self, batch: CaptionBatch) -> dict[str, Tensor]:
        """The unsmoothed loss per word."""
        losses, valid = self.nll(*self.source_of(batch), batch.words)
        return {"loss": losses.sum() / valid.sum()}

    # Decoding -------------------------------------------------------------------------------------------------------

    def start(self, source: Tensor, mask: Tensor) -> Cache:
        """The decoding state before the first word."""
        return self.body.start(self.body.encode(source, mask), mask)

    def step(self, state: Cache, tokens: Tensor) -> tuple[Tensor, Cache]:
        """See :class:`motionary.nn.decoding.Decoder`."""
        hidden, state = self.body.step(self._embed_words(tokens), state)
        return F.linear(hidden, self.words.weight), state

    def reorder(self, state: Cache, index: Tensor) -> Cache:
        """See :class:`motionary.nn.decoding.Decoder`."""
        return state.reorder(index)

    def _embed_words(self, words: Tensor) -> Tensor:
        return self.words(words) * self.config.width**0.5


def member_name(number: int) -> str:
    """Folder of a member below `models/motion2text`, which holds the first one itself."""
    return f"member_{number + 1}" if number else ""


def member_seeds(seed: int, members: int) -> list[int]:
    """Seeds of the members, first that of the run; runs of neighboring seeds share none."""
    if members < 1:
        raise InputError("motion2text.ensemble", members, "must be at least 1")
    return [seed + 1009 * number for number in range(members)]
