"""Weights in fewer bytes come back within what their bits can tell."""

from __future__ import annotations

import torch

from motionary.systems.packing import compact, unpacked

GENERATOR = torch.Generator().manual_seed(0)


def test_six_bits_are_wrong_by_half_a_step_at_most():
    weights = torch.randn(97, 131, generator=GENERATOR) * 0.02
    small = compact({"w": weights, "b": weights[0], "n": torch.arange(5)}, 6)
    assert sum(value.numel() * value.element_size() for value in small.values()) < 0.8 * weights.numel() + 400
    again = unpacked(small)
    assert again.keys() == {"w", "b", "n"}
    assert torch.equal(again["n"], torch.arange(5))
    flat = torch.nn.functional.pad(weights.flatten(), (0, -weights.numel() % 64)).view(-1, 64)
    step = (flat.abs().amax(1, keepdim=True) / 31).expand(-1, 64).flatten()[: weights.numel()].view(97, 131)
    assert bool(((again["w"] - weights).abs() <= 0.502 * step + 1e-6).all())
    assert again["w"].shape == weights.shape


def test_what_float16_cannot_hold_stays():
    tensors = {"large": torch.tensor([1e6, 1.0]), "usual": torch.tensor([0.1, -3.0])}
    small = compact(tensors)
    assert small["large"].dtype == torch.float32
    assert small["usual"].dtype == torch.float16
    assert torch.equal(unpacked(small)["large"], tensors["large"])
    assert not unpacked(compact({"zero": torch.zeros(4096)}, 6))["zero"].any()
