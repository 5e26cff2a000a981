"""What waiting threads cost: training steps a second with every core, by how long a thread spins before it sleeps.

``python -m motionary.bench.threads --beside 3`` measures the same beside three busy processes.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Sequence

from motionary.errors import check_whole
from motionary.report.table import Table

# Environments of OpenMP: as it comes, as stages set it (stages/_project.py), and without any spinning.
POLICIES = {"default": {}, "GOMP_SPINCOUNT=1000": {"GOMP_SPINCOUNT": "1000"}, "passive": {"OMP_WAIT_POLICY": "passive"}}
_BUSY = "while True: pass"


def steps_per_second(threads: int, seconds: float) -> float:
    """Steps of a small convolutional network on 32 windows of 64 frames, in this process."""
    import torch
    from torch import nn

    torch.set_num_threads(threads)
    torch.manual_seed(0)
    layers = [nn.Conv1d(263, 256, 3, padding=1), nn.ReLU(), nn.Conv1d(256, 256, 3, padding=1), nn.ReLU()]
    net = nn.Sequential(*layers, nn.Conv1d(256, 263, 3, padding=1))
    optimizer = torch.optim.AdamW(net.parameters(), fused=True)
    x = torch.randn(32, 263, 64)

    def step() -> None:
        """One training step."""
        (net(x) - x).abs().mean().backward()
        optimizer.step()
        optimizer.zero_grad()

    for _ in range(5):
        step()
    count, start = 0, time.monotonic()
    while time.monotonic() - start < seconds:
        step()
        count += 1
    return count / (time.monotonic() - start)


def measure(beside: int, seconds: float, rounds: int) -> Table:
    """A row for each policy, and one for a single thread; the policies take turns, the best round counts."""
    cores = os.cpu_count() or 1
    busy = [subprocess.Popen([sys.executable, "-c", _BUSY]) for _ in range(beside)]
    found: dict[tuple[str, int], list[float]] = {}
    try:
        for _ in range(rounds):
            for name, environment in POLICIES.items():
                for threads in (cores, 1) if name == "default" else (cores,):
                    command = [sys.executable, "-m", "motionary.bench.threads", "--child", f"{threads},{seconds}"]
                    kept = {k: v for k, v in os.environ.items() if not k.startswith(("OMP_", "GOMP_"))}
                    done = subprocess.run(command, env=kept | environment, capture_output=True, text=True, check=True)
                    found.setdefault((name, threads), []).append(float(done.stdout))
    finally:
        for process in busy:
            process.kill()
            process.wait()
    rows = [[name, str(threads), f"{max(rates):.1f}"] for (name, threads), rates in found.items()]
    title = "Training steps a second" + (f" beside {beside} busy processes" if beside else "")
    return Table(title, ["waiting threads", "threads", "steps/s"], rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(prog="python -m motionary.bench.threads", description=__doc__)
    parser.add_argument("--beside", type=int, default=0, help="busy processes beside it (%(default)s)")
    parser.add_argument("--seconds", type=float, default=3.0, help="of each measurement (%(default)s)")
    parser.add_argument("--rounds", type=int, default=3, help="the best of so many counts (%(default)s)")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.child:
        threads, seconds = options.child.split(",")
        print(steps_per_second(int(threads), float(seconds)))
        return 0
    check_whole("--beside", options.beside, 0)
    check_whole("--rounds", options.rounds, 1)
    print(measure(options.beside, options.seconds, options.rounds).text(), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
