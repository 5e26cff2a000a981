"""The codebook (TM2T Eq. 1 and 3; van den Oord et al., 2017): nearest code, straight-through gradient.

It learns in one of two ways. `gradient` is the paper's: it follows the second term of Eq. 3. `ema` moves each code to
the running mean of the latents that chose it (van den Oord et al., appendix A.1) and restarts unused codes.
"""

from __future__ import annotations

import torch
from torch import Tensor, distributed, nn
from torch.nn import functional as F

from motionary.errors import InputError
from motionary.nn.layers import masked_mean
from motionary.nn.precision import full_precision, widened

KINDS = ("gradient", "ema")
_SMOOTHING = 1e-5


class Quantizer(nn.Module):
    """K codes of d dimensions."""

    codebook: Tensor
    counts: Tensor
    sums: Tensor
    started: Tensor

    def __init__(self, codes: int, dim: int, kind: str = "ema", decay: float = 0.99, dead: float = 0.1):
        super().__init__()
        if kind not in KINDS:
            raise InputError("tokenizer.quantizer", kind, f"must be one of {', '.join(KINDS)}")
        self.kind, self.decay, self.dead = kind, decay, dead
        table = torch.empty(codes, dim).uniform_(-1 / codes, 1 / codes)
        if kind == "gradient":
            self.codebook = nn.Parameter(table)
        else:
            self.register_buffer("codebook", table)
            self.register_buffer("counts", torch.ones(codes))
            self.register_buffer("sums", table.clone())
        self.register_buffer("started", torch.tensor(False))  # drawn from encoder outputs yet?
        self._recent: Tensor | None = None

    @property
    def count(self) -> int:
        """Number of codes."""
        return self.codebook.shape[0]

    def codebooks(self) -> Tensor:
        """(1, K, d) the entries, as those of a quantizer of one layer."""
        return self.codebook[None]

    def nearest(self, latents: Tensor) -> Tensor:
        """(..., d) -> (...) index of the nearest code (Eq. 1)."""
        return nearest_code(latents, self.codebook)

    def look_up(self, codes: Tensor) -> Tensor:
        """(...) codes -> (..., d)."""
        return F.embedding(codes, self.codebook)

    def forward(self, latents: Tensor, mask: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """latents (B, S, d), mask (B, S) -> quantized with straight-through gradient (B, S, d), codes (B, S) long,
        embedding loss, commitment loss (means over valid steps and dimensions; the embedding loss is zero for
        `ema`). All of it in 32 bits."""
        latents = widened(latents)
        with torch.no_grad():
            codes = self.nearest(latents)
        chosen = self.look_up(codes)
        commitment = masked_mean((latents - chosen.detach()).square(), mask)
        embedding = latents.new_zeros(())
        if self.kind == "gradient":
            embedding = masked_mean((latents.detach() - chosen).square(), mask)
        elif self.training:
            self._follow(latents.detach()[mask], codes[mask])
        quantized = latents + (chosen - latents).detach()
        return quantized, codes, embedding, commitment

    @torch.no_grad()
    def _follow(self, latents: Tensor, codes: Tensor) -> None:
        """One step of the running means: latents (N, d) that chose codes (N,)."""
        counts = torch.bincount(codes, minlength=self.count).to(latents.dtype)
        sums = torch.zeros_like(self.sums).index_add_(0, codes, latents)
        if distributed.is_available() and distributed.is_initialized():
            distributed.all_reduce(counts)
            distributed.all_reduce(sums)
        self.counts.lerp_(counts, 1 - self.decay)
        self.sums.lerp_(sums, 1 - self.decay)
        total = self.counts.sum()
        smooth = (self.counts + _SMOOTHING) / (total + self.count * _SMOOTHING) * total
        self.codebook.copy_(self.sums / smooth[:, None])
        self._recent = latents

    @torch.no_grad()
    def start(self, latents: Tensor, generator: torch.Generator, rounds: int = 10) -> None:
        """Draw the codebook from latents (N, d) and polish it with a few rounds of k-means.

        Fewer latents than codes are drawn with repetition and a little noise.
        """
        latents = widened(latents)
        self.codebook.data.copy_(self._draw(latents, self.count, generator))
        for _ in range(rounds):
            codes = self.nearest(latents)
            counts = torch.bincount(codes, minlength=self.count).to(latents.dtype)
            sums = torch.zeros_like(self.codebook).index_add_(0, codes, latents)
            used = counts > 0
            self.codebook.data[used] = sums[used] / counts[used, None]
        self._share(self.codebook.data)
        if self.kind == "ema":
            # As if each code had been chosen evenly so far: young codes move fast but are not yet dead.
            self.counts.fill_(latents.shape[0] / self.count)
            self.sums.copy_(self.codebook * self.counts[:, None])
        self.started.fill_(True)

    @torch.no_grad()
    def restart(self, generator: torch.Generator) -> int:
        """Move codes chosen less than `dead` times the mean to recent latents; returns how many (EMA only)."""
        if self.kind != "ema" or self._recent is None or not len(self._recent) or not bool(self.started):
            return 0
        even = self.counts.mean()
        dead = self.counts < self.dead * even
        number = int(dead.sum())
        if number:
            self.codebook[dead] = self._draw(self._recent, number, generator)
            self._share(self.codebook)
            self.counts[dead] = even  # time to find its place before it is judged again
            self.sums[dead] = self.codebook[dead] * even
        self._recent = None
        return number

    @staticmethod
    def _draw(latents: Tensor, number: int, generator: torch.Generator) -> Tensor:
        order = torch.randperm(latents.shape[0], generator=generator, device=latents.device)
        if number <= latents.shape[0]:
            return latents[order[:number]]
        rows = torch.randint(latents.shape[0], (number,), generator=generator, device=latents.device)
        noise = torch.randn(number, latents.shape[1], generator=generator, device=latents.device)
        return latents[rows] + 0.01 * latents.std() * noise

    @staticmethod
    def _share(table: Tensor) -> None:
        """Every process of a distributed run takes the first one's codes."""
        if distributed.is_available() and distributed.is_initialized():
            distributed.broadcast(table, 0)


def nearest_code(latents: Tensor, codebook: Tensor) -> Tensor:
    """(..., d), (K, d) -> (...) index of the nearest entry. Distances are computed in 32 bits: with fewer, one code in
    25 comes out different."""
    flat = widened(latents.reshape(-1, latents.shape[-1]))
    with full_precision(flat):
        distance = codebook.square().sum(1) - 2 * flat @ codebook.t()
    return distance.argmin(1).reshape(latents.shape[:-1])


def usage(codes: Tensor, count: int) -> tuple[Tensor, Tensor]:
    """(N,) codes -> the share of the codebook that they use, and the perplexity of their distribution."""
    share = torch.bincount(codes.reshape(-1), minlength=count).float()
    share = share / share.sum().clamp(min=1)
    entropy = -(share * share.clamp(min=1e-12).log()).sum()
    return (share > 0).float().mean(), entropy.exp()
