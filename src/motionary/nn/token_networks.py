"""The convolutions around a codebook: four frames to a latent and back (TM2T 3.1, Table 3)."""

from __future__ import annotations

from typing import Protocol

from torch import Tensor, nn

from motionary.nn.convolutions import Down, ResBlock, Up, coarser, finer, keep, step_mask
from motionary.nn.precision import widened


class TokenSizes(Protocol):
    """What the two networks read of a tokenizer's settings, where each is explained."""

    @property
    def code_dim(self) -> int: ...
    @property
    def width(self) -> int: ...
    @property
    def fine_width(self) -> int: ...
    @property
    def encoder_blocks(self) -> int: ...
    @property
    def decoder_blocks(self) -> int: ...
    @property
    def fine_blocks(self) -> int: ...
    @property
    def dilation(self) -> int: ...


class TokenEncoder(nn.Module):
    """E of TM2T's Eq. 2."""

    def __init__(self, sizes: TokenSizes, features: int):
        super().__init__()
        fine = sizes.fine_width or sizes.width
        self.first = Down(features, fine)
        self.fine = _stack(fine, sizes.fine_blocks, sizes.dilation)
        self.second = Down(fine, sizes.width)
        self.coarse = _stack(sizes.width, sizes.encoder_blocks, sizes.dilation)
        self.output = nn.Conv1d(sizes.width, sizes.code_dim, 1) if sizes.code_dim != sizes.width else nn.Identity()

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """x (B, C, T) normalized, mask -> latents (B, T/4, d)."""
        half = coarser(mask)
        quarter = coarser(half)
        x = self.first(x, half)
        for block in self.fine:
            x = block(x, half)
        x = self.second(x, quarter)
        for block in self.coarse:
            x = block(x, quarter)
        return widened(keep(self.output(x), quarter).transpose(1, 2))


class TokenDecoder(nn.Module):
    """D of TM2T's Eq. 2."""

    def __init__(self, sizes: TokenSizes, features: int):
        super().__init__()
        fine = sizes.fine_width or sizes.width
        self.input = nn.Conv1d(sizes.code_dim, sizes.width, 1) if sizes.code_dim != sizes.width else nn.Identity()
        # Widest blocks first: the context of the whole sentence of tokens, then local detail.
        self.coarse = _stack(sizes.width, sizes.decoder_blocks, sizes.dilation)[::-1]
        self.first = Up(sizes.width, fine)
        self.second = Up(fine, features)
        self.output = nn.Conv1d(features, features, 3, padding=1)

    def forward(self, entries: Tensor, count: Tensor | None = None) -> Tensor:
        """entries of the codebook, or sums of them (B, S, d), count (B,) | None -> normalized features (B, 4S, D)."""
        x = entries.transpose(1, 2)
        quarter = step_mask(count, x)
        half = finer(quarter)
        full = finer(half)
        x = keep(self.input(keep(x, quarter)), quarter)
        for block in self.coarse:
            x = block(x, quarter)
        x = self.second(self.first(x, half), full)
        return widened(keep(self.output(x), full).transpose(1, 2))


def _stack(width: int, blocks: int, dilation: int) -> nn.ModuleList:
    return nn.ModuleList(ResBlock(width, dilation**n) for n in range(blocks))
