"""Devices, precision and distributed training, through Lightning Fabric."""

from __future__ import annotations

import os
import sys
from typing import Any, cast

import torch
from lightning_fabric import Fabric
from lightning_fabric.strategies.ddp import DDPStrategy

from motionary.training.settings import check_precision


def set_threads(threads: int) -> None:
    """Threads of this process's computations; 0 leaves it to torch: every core, or as many as OMP_NUM_THREADS says.

    Whoever starts several processes sets that variable (joblib does): with every core for each, they wait for one
    another at every operation, many times slower.
    """
    if threads:
        torch.set_num_threads(threads)


def multiplies_bfloat16() -> bool:
    """Whether the processor has units for matrix products in bfloat16 (Intel's AMX). Others do them more slowly than
    those in 32 bits, or hardly faster."""
    return bool(getattr(torch.cpu, "_is_amx_tile_supported", bool)())


def knows_bfloat16() -> bool:
    """Whether the processor knows bfloat16 at all (AVX-512 BF16 or AMX). Without, products in it are put together from
    other instructions, and a training step takes many times as long as in 32 bits."""
    return multiplies_bfloat16() or bool(getattr(torch.cpu, "_is_avx512_bf16_supported", bool)())


def make_fabric(device: str = "auto", precision: str | int = "32") -> Fabric:
    """A Fabric for this process; under ``torchrun`` it joins the distributed job.

    Args:
        device: "auto", "cpu", "cuda" or "mps".
        precision: of the matrix products of a training step, one of `settings.PRECISIONS`. "bf16-mixed" computes them
            in bfloat16; weights, optimizer, reductions and validation stay in 32 bits. "auto" is that on CUDA and on
            processors with units for such products, else "32".

    "bf16-mixed" on a processor that does not know bfloat16 is done, and a line on stderr says what it costs.

    Where a GPU has TF32, the products that stay in 32 bits take it.
    """
    check_precision(precision)
    cuda = device in ("auto", "cuda") and torch.cuda.is_available()
    if cuda:
        torch.set_float32_matmul_precision("high")
        torch.backends.cudnn.allow_tf32 = True
    if precision == "auto":
        precision = "bf16-mixed" if cuda or (device in ("auto", "cpu") and multiplies_bfloat16()) else "32"
    if str(precision) == "bf16-mixed" and not cuda and device in ("auto", "cpu") and not knows_bfloat16():
        _warn_emulated()
    named = "32-true" if str(precision) == "32" else precision
    world = int(os.environ.get("WORLD_SIZE", "1"))
    accelerator = cast(Any, "cuda" if cuda else "cpu" if device == "auto" else device)
    if world == 1:
        return Fabric(accelerator=accelerator, devices=1, precision=cast(Any, named))
    strategy = DDPStrategy(find_unused_parameters=True, process_group_backend="nccl" if cuda else "gloo")
    local = int(os.environ.get("LOCAL_WORLD_SIZE", world))
    fabric = Fabric(
        accelerator=accelerator, devices=local, num_nodes=world // local, strategy=strategy, precision=cast(Any, named)
    )
    fabric.launch()
    return fabric


def _warn_emulated() -> None:
    if os.environ.get("RANK", "0") == "0":
        print(
            "warning: precision: bf16-mixed: this processor does not know bfloat16, so that steps take many times "
            "as long as in 32 bits; precision=auto takes what it is good at",
            file=sys.stderr,
        )
