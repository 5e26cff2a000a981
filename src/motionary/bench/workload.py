"""What a case is, and what several cases need."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import torch

from motionary.bench.shapes import Shapes

PRODUCTS, COPIES = "GFLOP", "GB"  # units of the yardsticks, see measure.Yardsticks


@dataclass(frozen=True)
class Work:
    """Prepared work.

    Attributes:
        run: is timed.
        note: is called with the seconds afterwards and says what else is worth it.
        gflop: operations of `run` in products and convolutions, where they are known.
    """

    run: Callable[[], Any]
    note: Callable[[float], str] = field(default=lambda seconds: "")
    gflop: float = 0.0


@dataclass(frozen=True)
class Bound:
    """What work may cost: as much time as a yardstick of the same run takes for `amount` of its `unit`."""

    amount: float
    unit: str = PRODUCTS


@dataclass(frozen=True)
class Case:
    """One row of the table, with or without a bound."""

    name: str
    title: str
    prepare: Callable[[Shapes], Work]
    bound: Bound | None = None


def training_step(
    shapes: Shapes, model: torch.nn.Module, loss: Callable[[], torch.Tensor], clip: float = 0.0
) -> Callable[[], None]:
    """A whole training step: loss in the precision of `shapes`, gradients, clipping, Adam."""
    parameters = [p for p in model.parameters() if p.requires_grad]
    optimizer = torch.optim.AdamW(parameters, lr=1e-4, fused=True)
    model.train()

    def run() -> None:
        """One step."""
        with torch.autocast("cpu", torch.bfloat16, enabled=shapes.precision == "bf16-mixed"):
            value = loss()
        value.backward()
        if clip:
            torch.nn.utils.clip_grad_norm_(parameters, clip)
        optimizer.step()
        optimizer.zero_grad(set_to_none=True)

    return run


def noise() -> torch.Generator:
    """A generator of random numbers, the same every time."""
    return torch.Generator().manual_seed(0)


def clock(seconds: float) -> str:
    """Seconds as a reader wants them: 4.2 ms, 0.85 s, 14.7 s."""
    if seconds < 0.1:
        return f"{1000 * seconds:.1f} ms"
    return f"{seconds:.2f} s" if seconds < 10 else f"{seconds:.1f} s"
