"""The convolutions around a codebook: four frames to a latent and back (TM2T 3.1, Table 3)."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor, nn

from motionary.errors import DEEPEST, HEAVIEST, WIDEST, check_range, check_share
from motionary.nn.convolutions import Down, ResBlock, Up, coarser, finer, keep, step_mask
from motionary.nn.precision import widened


@dataclass(frozen=True)
class TokenSettings:
    """Settings that all tokenizers made of these networks share; the conf file of each explains the keys."""

    codebook_size: int = 512
    code_dim: int = 128
    width: int = 384
    fine_width: int = 192
    encoder_blocks: int = 2
    decoder_blocks: int = 3
    fine_blocks: int = 1
    dilation: int = 2
    commitment_weight: float = 0.25
    codebook_decay: float = 0.99
    restart_below: float = 0.1
    restart_until: float = 0.7
    codebook_start: float = 0.05
    hide_contacts: bool = True
    position_weight: float = 1.0

    def check(self, name: str) -> None:
        """InputError for a value out of range; `name` is that of the system."""
        check_range(name, self, ("codebook_size",), 2, WIDEST)
        check_range(name, self, ("code_dim", "width"), 1, WIDEST)
        check_range(name, self, ("fine_width",), 0, WIDEST)
        check_range(name, self, ("encoder_blocks", "decoder_blocks", "fine_blocks"), 0, DEEPEST)
        check_range(name, self, ("dilation",), 1, DEEPEST)
        check_share(name, self, ("codebook_decay", "restart_below"))
        check_range(name, self, ("restart_until",), 0, 1)
        check_range(name, self, ("commitment_weight", "position_weight"), 0, HEAVIEST)


class TokenEncoder(nn.Module):
    """E of TM2T's Eq. 2."""

    def __init__(self, sizes: TokenSettings, features: int):
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

    def __init__(self, sizes: TokenSettings, features: int):
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
