"""Gated recurrent units (Cho et al., 2014) over sequences of different lengths."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.utils.rnn import PackedSequence, pack_padded_sequence, pad_packed_sequence

from motionary.nn.precision import full_precision, narrow_type, widened
from motionary.nn.unrolled import scan


class BiGRU(nn.Module):
    """A bidirectional GRU of one layer over padded sequences of different lengths. Padding changes nothing.

    This is torch's own recurrence, but for training on a CPU: there it makes the weight's gradient anew at each step.
    """

    def __init__(self, inputs: int, hidden: int):
        super().__init__()
        self.unit = nn.GRU(inputs, hidden, batch_first=True, bidirectional=True)

    def forward(self, x: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
        """x (B, T, D), lengths (B,) -> outputs (B, T, 2h), zero at padding, and last states (B, 2h): forward's after
        the last valid step, backward's after the first. Every length must be at least 1."""
        if _trains_on_cpu(x):
            return self._scanned(x, lengths)
        out, last = self._run(x, lengths)
        padded, _ = pad_packed_sequence(out, batch_first=True, total_length=x.shape[1])
        return padded, last

    def last(self, x: Tensor, lengths: Tensor) -> Tensor:
        """The last states (B, 2h) of :meth:`forward` alone."""
        return self._scanned(x, lengths)[1] if _trains_on_cpu(x) else self._run(x, lengths)[1]

    def _scanned(self, x: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
        forward, backward = (scan(self.unit, x, lengths, suffix) for suffix in ("", "_reverse"))
        valid = (torch.arange(x.shape[1]) < lengths[:, None])[..., None]
        out = torch.cat((forward, backward), dim=-1) * valid
        return out, torch.cat((forward[:, -1], backward[:, 0]), dim=-1)

    def _run(self, x: Tensor, lengths: Tensor) -> tuple[PackedSequence, Tensor]:
        packed = pack_padded_sequence(x, lengths.cpu(), batch_first=True, enforce_sorted=False)
        narrow = narrow_type(x)
        out, last = self.unit(packed) if narrow is None else self._narrowed(packed, narrow)
        return out, torch.cat((last[0], last[1]), dim=-1)

    def _narrowed(self, packed: PackedSequence, narrow: torch.dtype) -> tuple[PackedSequence, Tensor]:
        """The same recurrence wholly in `narrow`: autocast would mix types on a CPU, and take float16 with cuDNN."""
        inputs = packed.data.to(narrow)
        rows = int(packed.batch_sizes[0])
        start = inputs.new_zeros(2, rows, self.unit.hidden_size)
        weights = [weight.to(narrow) for weight in self.unit.all_weights[0] + self.unit.all_weights[1]]
        with full_precision(inputs):
            out, last = torch.gru(inputs, packed.batch_sizes, start, weights, True, 1, 0.0, self.training, True)
        assert packed.unsorted_indices is not None
        last = widened(last).index_select(1, packed.unsorted_indices)
        return packed._replace(data=widened(out)), last


def _trains_on_cpu(x: Tensor) -> bool:
    return x.device.type == "cpu" and torch.is_grad_enabled()
