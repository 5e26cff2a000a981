"""Gated recurrent units (Cho et al., 2014) over sequences of different lengths, fast on CPUs.

The recurrence of `torch.nn.GRU` on a CPU multiplies the weight gradient at every step; here one product over all steps
does. Only valid steps are computed, so nothing depends on padding.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.autograd.function import once_differentiable
from torch.nn.utils.rnn import PackedSequence, pack_padded_sequence, pad_packed_sequence


class _Scan(torch.autograd.Function):
    """The recurrence over packed steps: gates (N, 3h) already hold the input's share; rows are sorted by length."""

    @staticmethod
    def forward(ctx, gates, weight, bias, start, counts, reverse):  # type: ignore[override]
        """Outputs (N, h) in packed order and last states (B, h), from start states (B, h)."""
        width = start.shape[1]
        steps = _steps(counts, reverse)
        state = start.clone()
        out = torch.empty(gates.shape[0], width, dtype=gates.dtype, device=gates.device)
        before = torch.empty_like(out)
        hidden_new = torch.empty_like(out)
        reset_update = torch.empty(gates.shape[0], 2 * width, dtype=gates.dtype, device=gates.device)
        new = torch.empty_like(out)
        transposed = weight.t()
        for first, count in steps:
            rows = slice(first, first + count)
            past = state[:count]
            before[rows] = past
            hidden = torch.addmm(bias, past, transposed)
            gate = torch.sigmoid(gates[rows, : 2 * width] + hidden[:, : 2 * width])
            candidate = torch.addcmul(gates[rows, 2 * width :], gate[:, :width], hidden[:, 2 * width :]).tanh_()
            out[rows] = torch.lerp(candidate, past, gate[:, width:])  # (1 - z) n + z h
            state[:count] = out[rows]
            reset_update[rows], new[rows], hidden_new[rows] = gate, candidate, hidden[:, 2 * width :]
        ctx.steps = steps
        ctx.set_materialize_grads(False)  # where only the last state is used, no zeros are made and added
        ctx.save_for_backward(weight, before, reset_update, new, hidden_new)
        return out, state

    @staticmethod
    @once_differentiable
    def backward(ctx, grad_out, grad_state):  # type: ignore[override]
        """Gradients of gates, weight, bias and start; either incoming one may be None."""
        weight, before, reset_update, new, hidden_new = ctx.saved_tensors
        width = new.shape[1]
        reset, update = reset_update[:, :width], reset_update[:, width:]
        # d(pre-activation) = factor * d(state): every factor is known before the loop runs backwards.
        to_new = (1 - update) * (1 - new * new)
        factors = torch.empty(len(new), 3, width, dtype=new.dtype, device=new.device)
        torch.mul(to_new, reset, out=factors[:, 2])
        torch.mul(factors[:, 2] * (1 - reset), hidden_new, out=factors[:, 0])
        torch.mul((before - new) * update, 1 - update, out=factors[:, 1])
        grad_hidden = torch.empty_like(factors)
        flow = torch.empty_like(new)
        grad = new.new_zeros(max(count for _, count in ctx.steps), width) if grad_state is None else grad_state.clone()
        for first, count in reversed(ctx.steps):
            rows = slice(first, first + count)
            step = grad[:count]
            if grad_out is not None:
                step = step + grad_out[rows]
            flow[rows] = step
            torch.mul(factors[rows], step[:, None], out=grad_hidden[rows])
            grad[:count] = torch.addmm(step * update[rows], grad_hidden[rows].flatten(1), weight)
        flat = grad_hidden.flatten(1)
        grad_weight = flat.t() @ before
        grad_bias = flat.sum(0)
        # Of the input's share only the new gate's gradient differs from the hidden one's: it takes its place.
        torch.mul(to_new, flow, out=grad_hidden[:, 2])
        return flat, grad_weight, grad_bias, grad, None, None


def _steps(counts: list[int], reverse: bool) -> list[tuple[int, int]]:
    """(first packed row, active rows) of each step, in the order in which they run."""
    steps, first = [], 0
    for count in counts:
        steps.append((first, count))
        first += count
    return steps[::-1] if reverse else steps


def gru_scan(packed: PackedSequence, unit: nn.GRU, suffix: str = "l0") -> tuple[Tensor, Tensor]:
    """One direction of one layer of `unit` over a packed sequence, from a zero state.

    Returns the packed outputs (N, h) and the last state (B, h) in the packed (sorted) order. `suffix` is "l0" or
    "l0_reverse"; the reverse direction starts at each sequence's own last valid step.
    """
    weight_in, weight = getattr(unit, f"weight_ih_{suffix}"), getattr(unit, f"weight_hh_{suffix}")
    bias_in, bias = getattr(unit, f"bias_ih_{suffix}"), getattr(unit, f"bias_hh_{suffix}")
    counts = packed.batch_sizes.tolist()
    start = packed.data.new_zeros(counts[0], unit.hidden_size)
    gates = torch.addmm(bias_in, packed.data, weight_in.t())
    return _Scan.apply(gates, weight, bias, start, counts, suffix.endswith("_reverse"))  # type: ignore[return-value]


class BiGRU(nn.Module):
    """A bidirectional GRU of one layer over padded sequences of different lengths."""

    def __init__(self, inputs: int, hidden: int):
        super().__init__()
        self.unit = nn.GRU(inputs, hidden, batch_first=True, bidirectional=True)

    def forward(self, x: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
        """x (B, T, D), lengths (B,) -> outputs (B, T, 2h), zero at padding, and last states (B, 2h): forward's after
        the last valid step, backward's after the first. Every length must be at least 1. Padding changes nothing."""
        packed = _pack(x, lengths)
        if x.is_cuda:  # cuDNN's own kernels are faster there
            out, last = self.unit(packed)
            padded, _ = pad_packed_sequence(out, batch_first=True, total_length=x.shape[1])
            return padded, torch.cat((last[0], last[1]), dim=-1)
        (forward, forward_last), (backward, backward_last) = self._scan(packed)
        both = PackedSequence(
            torch.cat((forward, backward), -1), packed.batch_sizes, packed.sorted_indices, packed.unsorted_indices
        )
        padded, _ = pad_packed_sequence(both, batch_first=True, total_length=x.shape[1])
        last = torch.cat((forward_last, backward_last), dim=-1)
        return padded, last[packed.unsorted_indices]

    def last(self, x: Tensor, lengths: Tensor) -> Tensor:
        """The last states (B, 2h) of :meth:`forward` alone, without the copies that its outputs take."""
        if x.is_cuda:
            return self(x, lengths)[1]
        packed = _pack(x, lengths)
        (_, forward), (_, backward) = self._scan(packed)
        return torch.cat((forward, backward), dim=-1)[packed.unsorted_indices]

    def _scan(self, packed: PackedSequence):
        return gru_scan(packed, self.unit), gru_scan(packed, self.unit, "l0_reverse")


def _pack(x: Tensor, lengths: Tensor) -> PackedSequence:
    return pack_padded_sequence(x, lengths.cpu(), batch_first=True, enforce_sorted=False)
