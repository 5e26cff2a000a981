"""CPU time, peak memory, the machine's matrix-multiply rate, and the operations that convolutions take."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from pathlib import Path

import torch
from torch import Tensor, nn


def cpu_time() -> float:
    """Seconds of CPU that this process, all its threads and its ended children have used."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def least_time(run: Callable[[], object], repeats: int = 5, brief: float = 0.1) -> tuple[float, int]:
    """The shortest CPU time of `run` in seconds, and how often it ran.

    Args:
        run: the work; its first runs, which also warm up (the third is the first that asks for no new memory), count
            like any other.
        repeats: runs of long work.
        brief: work that takes less runs ten times as often.
    """
    best, runs = float("inf"), 0
    while runs < (repeats if best >= brief else 10 * repeats):
        started = cpu_time()
        run()
        best, runs = min(best, cpu_time() - started), runs + 1
    return best, runs


def peak_memory() -> int:
    """Largest resident memory of this process so far, in bytes.

    Read from /proc where there is one: the counter of getrusage also holds what the parent had before it forked.
    """
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def matmul_rate(rows: int, repeats: int = 5) -> float:
    """Operations per second of the best of `repeats` products of two square float32 matrices."""
    a, b = torch.randn(rows, rows), torch.randn(rows, rows)
    out = torch.empty(rows, rows)
    best, _ = least_time(lambda: torch.mm(a, b, out=out), repeats, brief=0.0)
    return 2 * rows**3 / best


def convolution_flops(model: nn.Module, forward: Callable[[], object]) -> int:
    """Operations of the 1-D convolutions that `forward` passes through, in a whole training step.

    A convolution takes 2 x outputs x inputs x width operations per item and output step, once forward, once for the
    gradient of its weights, and once more for that of its input where something before it learns.
    """
    total = 0

    def count(layer: nn.Module, inputs: tuple[Tensor, ...], output: Tensor) -> None:
        """Adds the operations of one convolution."""
        nonlocal total
        assert isinstance(layer, nn.Conv1d)
        once = 2 * output.numel() * (layer.in_channels // layer.groups) * layer.kernel_size[0]
        total += once * (3 if inputs[0].requires_grad else 2)

    hooks = [layer.register_forward_hook(count) for layer in model.modules() if isinstance(layer, nn.Conv1d)]
    try:
        forward()
    finally:
        for hook in hooks:
            hook.remove()
    return total
