"""Gated recurrent units (Cho et al., 2014) over sequences of different lengths."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.utils.rnn import PackedSequence, pack_padded_sequence, pad_packed_sequence


class BiGRU(nn.Module):
    """A bidirectional GRU of one layer over padded sequences of different lengths. Padding changes nothing.

    This is torch's own recurrence. One written by hand, with a single product for the weight's gradient, was 1.03 to
    1.15 times as fast for texts and 1.28 times for motions at `scale=small`: too little for its hundred lines.
    """

    def __init__(self, inputs: int, hidden: int):
        super().__init__()
        self.unit = nn.GRU(inputs, hidden, batch_first=True, bidirectional=True)

    def forward(self, x: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
        """x (B, T, D), lengths (B,) -> outputs (B, T, 2h), zero at padding, and last states (B, 2h): forward's after
        the last valid step, backward's after the first. Every length must be at least 1."""
        out, last = self._run(x, lengths)
        padded, _ = pad_packed_sequence(out, batch_first=True, total_length=x.shape[1])
        return padded, last

    def last(self, x: Tensor, lengths: Tensor) -> Tensor:
        """The last states (B, 2h) of :meth:`forward` alone."""
        return self._run(x, lengths)[1]

    def _run(self, x: Tensor, lengths: Tensor) -> tuple[PackedSequence, Tensor]:
        out, last = self.unit(pack_padded_sequence(x, lengths.cpu(), batch_first=True, enforce_sorted=False))
        return out, torch.cat((last[0], last[1]), dim=-1)
