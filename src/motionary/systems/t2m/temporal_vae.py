"""The temporal VAE over snippet codes: prior, posterior and generator, word by word attended (thesis 4.2.3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from motionary.nn.gaussian import Gaussian, gaussian
from motionary.nn.layers import TextEncoder, initialize, length_mask, positional_encoding
from motionary.nn.precision import widened
from motionary.nn.unrolled import StepCell, StepLinear, unrolling

SLOPE = 0.2  # of every leaky rectifier


def time_to_arrival(length: Tensor, steps: int, dim: int) -> Tensor:
    """PE of T - t (Eq. 4.5) for t = 1 .. steps and lengths T (B,) -> (B, steps, dim); 0 at and beyond arrival."""
    left = length[:, None] - torch.arange(1, steps + 1, device=length.device)
    return positional_encoding(left.clamp(min=0), dim)


@dataclass(frozen=True)
class Words:
    """A sentence prepared for attention: keys and values (B, N, a), bias (B, N) of -inf at padding."""

    keys: Tensor
    values: Tensor
    bias: Tensor

    def attend(self, query: Tensor) -> Tensor:
        """Queries (R, a) of the first R sentences -> attended words (R, a), Eq. 4.4."""
        rows = len(query)
        scores = torch.baddbmm(self.bias[:rows, :, None], self.keys[:rows], query[:, :, None])
        return torch.bmm(torch.softmax(widened(scores), dim=1).transpose(1, 2), self.values[:rows])[:, 0]


class Branch(nn.Module):
    """What prior, posterior and generator share (Fig. 4.3): an MLP, the time to arrival added, a GRU."""

    def __init__(self, inputs: int, width: int, outputs: int):
        super().__init__()
        self.input = StepLinear(inputs, width)
        self.norm = nn.LayerNorm(width)
        self.cell = StepCell(width, width)
        self.head = StepLinear(width, outputs)

    def forward(self, parts: list[Tensor], arrival: Tensor | None, hidden: Tensor) -> Tensor:
        """One step: inputs to concatenate (B, d_i), time to arrival (B, h) or None, hidden (B, h) -> hidden (B, h)."""
        x = F.leaky_relu(self.norm(self.input(torch.cat(parts, dim=1))), SLOPE)
        return self.cell(x if arrival is None else x + arrival, hidden)


class Unroll(NamedTuple):
    """What training needs of all steps: codes (B, S, c) and the two distributions of z, (B, S, z) each."""

    codes: Tensor
    posterior: Gaussian
    prior: Gaussian


class TemporalVAE(nn.Module):
    """Codes one by one, each from the one before, the attended words, a latent draw and the time left.

    What does not depend on the recurrence stands outside the loop: keys and values of the words, and the heads of
    prior and generator.

    Args:
        words: size of the vocabulary; `word_dim` and `text_width` (per direction) of the text encoder.
        code: dimensions of a code.
        width: of the three GRUs.
        attention: dimensions of the attended words; 0 is without local word attention (Table 4.4): the sentence then
            acts through the initial states alone.
        latent: dimensions of z.
        tags: read word classes in addition to words.
        positions: add the time to arrival.
        dropout: on word features and on the codes that are read.
    """

    def __init__(
        self, words: int, word_dim: int, text_width: int, code: int, width: int, attention: int, latent: int,
        tags: bool, positions: bool, dropout: float,
    ):  # fmt: skip
        super().__init__()
        self.width, self.latent, self.positions = width, latent, positions
        self.text = TextEncoder(words, word_dim, text_width, tags, dropout)
        memory = self.text.width
        self.attention = attention
        if attention:
            self.query = StepLinear(width, attention)
            self.key, self.value = nn.Linear(memory, attention, bias=False), nn.Linear(memory, attention)
        self.start_hidden = nn.Linear(memory, 3 * width)
        self.prior = Branch(code + attention, width, 2 * latent)
        self.posterior = Branch(2 * code + attention, width, 2 * latent)
        self.generator = Branch(code + attention + latent, width, width)
        self.out = nn.Sequential(nn.LayerNorm(width), nn.LeakyReLU(SLOPE), nn.Linear(width, code))
        self.dropout = nn.Dropout(dropout)
        initialize(self)

    def start(self, words: Tensor, tags: Tensor | None, count: Tensor) -> tuple[Words | None, list[Tensor]]:
        """Sentences (B, N) with tags (B, N) and lengths (B,) -> words for attention, and the initial hidden states
        (B, h) of prior, posterior and generator."""
        memory, sentence = self.text(words, tags, count)
        hidden = list(self.start_hidden(sentence).chunk(3, dim=1))
        if not self.attention:
            return None, hidden
        memory = self.dropout(memory)
        bias = torch.zeros(words.shape, dtype=memory.dtype, device=words.device)
        bias = bias.masked_fill(~length_mask(count, words.shape[1]), -torch.inf)
        return Words(self.key(memory) * self.attention**-0.5, self.value(memory), bias), hidden

    def decode(self, hidden: Tensor) -> Tensor:
        """Hidden states (..., h) of the generator -> codes (..., c)."""
        return widened(self.out(self.generator.head(hidden)))

    def unroll(
        self, words: Words | None, hidden: list[Tensor], targets: Tensor, first: Tensor, length: Tensor,
        forced: Tensor, noise: Tensor,
    ) -> Unroll:  # fmt: skip
        """Reconstruct targets (B, S, c) from latents of the posterior.

        Args:
            words, hidden: from `start`.
            targets: true codes; what stands beyond an item's length has no influence on its valid steps.
            first: (c,) the code that is read at the first step.
            length: (B,) codes of each whole motion: the time of arrival.
            forced: (B,) bool, rows that read the true codes; the others read their own, without gradient.
            noise: (B, S, z) standard normal.
        """
        of_prior, of_posterior, of_generator = hidden
        read, forced = first.expand(len(targets), -1), forced[:, None]
        states: list[tuple[Tensor, Tensor, Tensor]] = []
        with unrolling(self):
            for step, (true, draw, arrival) in enumerate(self._steps(targets, length, noise)):
                parts = [self.dropout(read)]
                if words is not None:
                    parts.append(words.attend(self.query(of_generator)))
                of_prior = self.prior(parts, arrival, of_prior)
                of_posterior = self.posterior([true, *parts], arrival, of_posterior)
                parameters = self.posterior.head(of_posterior)
                of_generator = self.generator([*parts, gaussian(parameters).sample(draw)], arrival, of_generator)
                states.append((of_prior, parameters, of_generator))
                if step + 1 < targets.shape[1]:
                    read = self._next(true, of_generator, forced)
        priors, posteriors, generated = (torch.stack(part, dim=1) for part in zip(*states, strict=True))
        return Unroll(self.decode(generated), gaussian(posteriors), gaussian(self.prior.head(priors)))

    @torch.no_grad()
    def generate(
        self, words: Words | None, hidden: list[Tensor], first: Tensor, length: Tensor, noise: Tensor,
        temperature: float = 1.0,
    ) -> Tensor:  # fmt: skip
        """Codes (B, S, c) from latents of the prior, zero beyond each length (B,), which must not increase.

        Args:
            words, hidden: from `start`; first: (c,), as in `unroll`.
            length: longest first, so that finished rows fall off the end of the batch.
            noise: (B, S, z) standard normal, S the longest length.
            temperature: factor on the prior's standard deviation; 0 takes its mean.
        """
        of_prior, _, of_generator = hidden
        read, steps = first.expand(len(length), -1), noise.shape[1]
        codes = noise.new_zeros(len(length), steps, len(first))
        arrivals = time_to_arrival(length, steps, self.width).unbind(1) if self.positions else [None] * steps
        for step, arrival in enumerate(arrivals):
            rows = int((length > step).sum())
            read, of_prior, of_generator = read[:rows], of_prior[:rows], of_generator[:rows]
            arrival = None if arrival is None else arrival[:rows]
            parts = [read] if words is None else [read, words.attend(self.query(of_generator))]
            of_prior = self.prior(parts, arrival, of_prior)
            latent = gaussian(self.prior.head(of_prior)).sample(temperature * noise[:rows, step])
            of_generator = self.generator([*parts, latent], arrival, of_generator)
            read = codes[:rows, step] = self.decode(of_generator)
        return codes

    def _steps(self, targets: Tensor, length: Tensor, noise: Tensor):
        steps = targets.shape[1]
        arrivals = time_to_arrival(length, steps, self.width).unbind(1) if self.positions else [None] * steps
        return zip(targets.unbind(1), noise.unbind(1), arrivals, strict=True)

    @torch.no_grad()
    def _next(self, true: Tensor, hidden: Tensor, forced: Tensor) -> Tensor:
        """What is read next: the true code where forced, else the generated one."""
        return true if bool(forced.all()) else torch.where(forced, true, self.decode(hidden))
