"""The attentive GRU that writes motion tokens while reading a sentence (TM2T 3.3, Eq. 5-6, Table 3)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from motionary.nn.layers import TextEncoder, length_mask, positional_encoding
from motionary.nn.precision import widened
from motionary.nn.unrolled import Shared, StepCell, StepLinear, unrolling


@dataclass(frozen=True)
class GRUState:
    """Hidden state (R, h) and what a whole sequence shares: the words, prepared for attention, and the token table.

    keys (R, N, h) and bias (R, N) already hold the query's weights: score = keys . h + bias, -inf at padding;
    values (R, N, e) and table (K + 3, e) already hold the weights of the layer that mixes both.
    """

    hidden: Tensor
    keys: Tensor
    bias: Tensor
    values: Tensor
    table: Tensor
    position: int = 0


class StraightThrough(torch.autograd.Function):
    """The one-hot of the largest entry, with the gradient of the relaxed distribution (Jang et al., 2017)."""

    @staticmethod
    def forward(ctx, soft):  # type: ignore[override]
        """(..., K) distribution -> (..., K) one-hot."""
        return torch.zeros_like(soft).scatter_(-1, soft.argmax(-1, keepdim=True), 1.0)

    @staticmethod
    def backward(ctx, grad):  # type: ignore[override]
        """The gradient as it comes."""
        return grad


class TokenGRU(nn.Module):
    """Bidirectional GRU over words, GRU over tokens with attention on its previous hidden state.

    What does not depend on the recurrence stands outside it: keys and values of the words (with the weights that would
    follow them at every step multiplied in once), the token embeddings' share of the mixing layer, and the output
    projection. The loop holds one attention and one GRU cell.

    Args:
        codes: motion codes K; tokens K, K + 1 and K + 2 are start, end and padding.
        words: size of the vocabulary; `word_dim` and `text_width` (per direction) of the text encoder.
        width: of the token GRU.
        tags: read word classes in addition to words.
        positions: add sinusoids of the time step to the token embeddings.
        dropout: on word features, token embeddings and outputs.
    """

    def __init__(
        self, codes: int, words: int, word_dim: int, text_width: int, width: int, tags: bool, positions: bool,
        dropout: float,
    ):  # fmt: skip
        super().__init__()
        self.codes, self.positions = codes, positions
        self.text = TextEncoder(words, word_dim, text_width, tags, dropout)
        memory = self.text.width
        self.embedding = nn.Embedding(codes + 3, width)
        nn.init.normal_(self.embedding.weight, std=1.0)
        self.start_hidden = nn.Linear(memory, width)
        self.query, self.key = nn.Linear(width, width), nn.Linear(memory, width, bias=False)
        self.value = nn.Linear(memory, width)
        self.mix = nn.Linear(2 * width, width)  # of (attention, token), Table 3's att_linear
        self.norm = nn.LayerNorm(width)
        self.cell = StepCell(width, width)
        self.out = StepLinear(width, codes + 3, bias=False)
        self.dropout = nn.Dropout(dropout)

    def start(self, words: Tensor, tags: Tensor | None, count: Tensor) -> GRUState:
        """Sentences (B, N) with tags (B, N) and lengths (B,) -> the state before the first token."""
        memory, sentence = self.text(words, tags, count)
        memory, width = self.dropout(memory), self.cell.hidden_size
        keys = self.key(memory) * width**-0.5
        bias = (keys @ self.query.bias).masked_fill(~length_mask(count, words.shape[1]), -torch.inf)
        to_attention, to_token = self.mix.weight.split(width, dim=1)
        table = F.linear(self.embedding.weight, to_token, self.mix.bias)
        values = F.linear(self.value(memory), to_attention)
        return GRUState(self.start_hidden(sentence), keys @ self.query.weight, bias, values, table)

    def logits(self, hidden: Tensor) -> Tensor:
        """(..., h) -> logits (..., K + 3) of the next token."""
        return widened(self.out(self.dropout(hidden)))

    def unroll(
        self, state: GRUState, tokens: Tensor, free: Tensor | None = None, generator: torch.Generator | None = None
    ) -> Tensor:
        """Hidden states (B, S, h) after reading tokens (B, S).

        Rows `free` (indices) read only the first token and then their own draws, through which no gradient flows.
        """
        embedded = self.dropout(self._embed(state, tokens))
        hidden, states = state.hidden, []
        with unrolling(self):
            for step, token in enumerate(embedded.unbind(1)):
                if step and free is not None and len(free):
                    own = self._embed(state, self._draw(hidden[free], generator)[:, None], step)[:, 0]
                    token = token.index_copy(0, free, self.dropout(own))
                hidden = self._advance(state, hidden, token)
                states.append(hidden)
        return torch.stack(states, dim=1)

    def gumbel(
        self, state: GRUState, start: Tensor, steps: int, end: int, temperature: float, generator: torch.Generator
    ) -> Tensor:
        """Sample with gradients: one-hot tokens (B, S, K + 3) by straight-through Gumbel-softmax, S <= steps.

        Start and padding are never drawn, and the end never as the first token. Sampling stops once every row has
        ended; what a row holds after its own end is meaningless, so mask it.
        """
        token = self._embed(state, start[:, None])[:, 0]
        hidden, samples = state.hidden, []
        ended = torch.zeros_like(start, dtype=torch.bool)
        never = torch.zeros(self.codes + 3, device=start.device)
        embed = Shared(state.table.t(), None)  # one-hot tokens (R, K + 3) -> (R, e)
        never[[self.codes, self.codes + 2]] = -torch.inf
        with unrolling(self):
            for step in range(steps):
                hidden = self._advance(state, hidden, token)
                logits = self.logits(hidden) + never
                if step == 0:
                    logits = logits.index_fill(1, torch.tensor([end], device=logits.device), -torch.inf)
                draw = torch.empty_like(logits).exponential_(generator=generator)
                sample = StraightThrough.apply(torch.softmax((logits - draw.log()) / temperature, dim=-1))
                samples.append(sample)
                ended |= sample[:, end] > 0
                if bool(ended.all()):
                    break
                token = embed(sample) + self._position(state, step + 1)
        return torch.stack(samples, dim=1)

    def step(self, state: GRUState, tokens: Tensor) -> tuple[Tensor, GRUState]:
        """See :class:`motionary.nn.decoding.Decoder`."""
        token = self._embed(state, tokens[:, None], state.position)[:, 0]
        hidden = self._advance(state, state.hidden, token)
        return self.logits(hidden), replace(state, hidden=hidden, position=state.position + 1)

    def reorder(self, state: GRUState, index: Tensor) -> GRUState:
        """See :class:`motionary.nn.decoding.Decoder`."""
        return replace(
            state, hidden=state.hidden[index], keys=state.keys[index], bias=state.bias[index],
            values=state.values[index],
        )  # fmt: skip

    def _advance(self, state: GRUState, hidden: Tensor, token: Tensor) -> Tensor:
        """One step: Eq. 5-6 on the previous hidden state, mixed with the token (R, e), into the GRU cell."""
        scores = torch.baddbmm(state.bias[..., None], state.keys, hidden[..., None])
        attended = torch.bmm(torch.softmax(widened(scores), dim=1).transpose(1, 2), state.values)[:, 0]
        return self.cell(F.leaky_relu(self.norm(attended + token), 0.2), hidden)

    def _embed(self, state: GRUState, tokens: Tensor, first: int = 0) -> Tensor:
        """Tokens (R, S) -> their share (R, S, e) of the mixing layer, positions counted from `first`."""
        embedded = F.embedding(tokens, state.table)
        return embedded + self._position(state, first, tokens.shape[1])

    def _position(self, state: GRUState, first: int, steps: int = 1) -> Tensor | float:
        if not self.positions:
            return 0.0
        positions = torch.arange(first, first + steps, device=state.table.device)
        return positional_encoding(positions, state.table.shape[1])

    @torch.no_grad()
    def _draw(self, hidden: Tensor, generator: torch.Generator | None) -> Tensor:
        # Codes only: what follows an end was never trained.
        shares = torch.softmax(widened(self.out(hidden)[:, : self.codes]), -1)
        return torch.multinomial(shares, 1, generator=generator)[:, 0]
