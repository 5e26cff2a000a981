"""CPU time beside yardsticks of the machine, peak memory, and the operations that convolutions take."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn

from motionary.bench.workload import COPIES, PRODUCTS


def cpu_time() -> float:
    """Seconds of CPU that this process, all its threads and its ended children have used."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


@dataclass(frozen=True)
class Timed:
    """Shortest CPU times of work and of the yardsticks that took turns with it.

    Attributes:
        seconds: of the work.
        runs: how often it ran.
        rates: what each yardstick did in a second, by its unit: "GFLOP" of matrix products, "GB" of copied memory.
    """

    seconds: float
    runs: int
    rates: dict[str, float]


class Yardsticks:
    """Two pieces of work that stand for the machine: a product of float32 matrices, and a copy of memory.

    Args:
        rows: of the two square matrices.
        megabytes: that are copied (of 2**20 bytes), more than caches hold.
    """

    def __init__(self, rows: int, megabytes: int = 64):
        # All of them written to, so that the process holds their memory from here on.
        a, b, out = (torch.ones(rows, rows) for _ in range(3))
        full, other = (torch.ones(megabytes, 1 << 18) for _ in range(2))
        self.bytes = sum(x.numel() * x.element_size() for x in (a, b, out, full, other))
        self.amounts = {PRODUCTS: 2 * rows**3 / 1e9, COPIES: megabytes * 2**20 / 1e9}
        self._run: dict[str, Callable[[], object]] = {
            PRODUCTS: lambda: torch.mm(a, b, out=out),
            COPIES: lambda: other.copy_(full),
        }

    def beside(self, run: Callable[[], object], repeats: int = 5, brief: float = 0.1) -> Timed:
        """Times `run` and the yardsticks in turns, so that what slows the machine down slows all of them.

        Args:
            run: the work; its first runs, which also warm up (the third is the first that asks for no new memory),
                count like any other.
            repeats: turns, at least 1.
            brief: work that takes less seconds runs ten times a turn.
        """
        seconds, runs, best = float("inf"), 0, dict.fromkeys(self.amounts, float("inf"))
        for _ in range(repeats):
            least, more = least_time(run, 1, brief)
            seconds, runs = min(seconds, least), runs + more
            for unit, yardstick in self._run.items():
                best[unit] = min(best[unit], least_time(yardstick, 1, 0.0)[0])
        return Timed(seconds, runs, {unit: self.amounts[unit] / best[unit] for unit in best})


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
