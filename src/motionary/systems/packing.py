"""Weights in fewer bytes: as float16, or as 6-bit integers with a float16 scale for each 64 of them."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

BITS = (16, 6)
GROUP, LARGEST = 64, 31  # weights that share a scale; the largest integer
FEWEST = 4096  # a smaller tensor is not worth packing
_PACKED, _SCALES, _SHAPE = ".packed6", ".scales6", ".shape6"


def compact(tensors: Mapping[str, Tensor], bits: int = 16) -> dict[str, Tensor]:
    """Tensors in fewer bytes, which :func:`unpacked` makes float32 again.

    With 16 bits all are float16, but those that hold a number above 65504 in size. With 6 bits those of at least 4096
    numbers become round(31 w / m), m being the largest size among 64 neighbors: wrong by at most m / 62 each.
    """
    out: dict[str, Tensor] = {}
    for name, value in tensors.items():
        if bits < 16 and value.is_floating_point() and value.numel() >= FEWEST and bool(value.isfinite().all()):
            out |= _packed(name, value.float())
        else:
            half = value.half() if value.is_floating_point() else value
            out[name] = half if bool(half.isfinite().all()) else value
    return out


def unpacked(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """What :func:`compact` packed, as float32; every other tensor as it is."""
    out = {name: value for name, value in tensors.items() if not name.endswith((_PACKED, _SCALES, _SHAPE))}
    for name in (key.removesuffix(_PACKED) for key in tensors if key.endswith(_PACKED)):
        out[name] = _restored(*(tensors[name + part] for part in (_PACKED, _SCALES, _SHAPE)))
    return out


def _packed(name: str, value: Tensor) -> dict[str, Tensor]:
    flat = value.flatten()
    groups = torch.nn.functional.pad(flat, (0, -len(flat) % GROUP)).view(-1, GROUP)
    scales = (groups.abs().amax(1) / LARGEST).clamp(1e-7, 6e4).half()
    whole = (groups / scales.float()[:, None]).round().clamp(-LARGEST, LARGEST).to(torch.int32) + LARGEST
    a, b, c, d = whole.view(-1, 4).unbind(1)
    word = a | (b << 6) | (c << 12) | (d << 18)
    octets = torch.stack([word & 255, (word >> 8) & 255, (word >> 16) & 255], 1).to(torch.uint8)
    return {name + _PACKED: octets.flatten(), name + _SCALES: scales, name + _SHAPE: torch.tensor(value.shape)}


def _restored(octets: Tensor, scales: Tensor, shape: Tensor) -> Tensor:
    a, b, c = octets.view(-1, 3).to(torch.int32).unbind(1)
    word = a | (b << 8) | (c << 16)
    whole = torch.stack([(word >> (6 * place)) & 63 for place in range(4)], 1) - LARGEST
    values = whole.view(-1, GROUP).float() * scales.float()[:, None]
    return values.flatten()[: int(shape.prod())].view(*shape.tolist())
