"""Two steps of every system in mixed precision; as a script, in several processes, each with a batch of its own."""

from __future__ import annotations

import sys
from pathlib import Path

import torch

from motionary.training.devices import make_fabric
from motionary.training.loop import fit
from motionary.training.settings import TrainSettings


class Same:
    """An epoch of one batch, always the same."""

    def __init__(self, batch):
        self.batch = batch

    def __len__(self) -> int:
        return 1

    def epoch(self, epoch, start=0):
        yield from [self.batch][start:]


def steps_of(steps: int) -> TrainSettings:
    return TrainSettings(steps, 6, 1e-3, max_grad_norm=0.5, validate_every=1, log_every=1)


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))
    from every_system import batch_for, build_all, labeled
    from made_batches import make_context
    from safetensors.torch import save_file

    torch.set_num_threads(1)
    fabric, folder = make_fabric("cpu", "bf16-mixed"), Path(sys.argv[1])
    rank = fabric.global_rank
    context = labeled(make_context())
    for name, model in build_all(context, folder / f"built{rank}"):
        same = Same(batch_for(context, model, seed=rank))
        history = fit(model, same, same, steps_of(2), fabric)
        assert len(history.train) == 2, name
        save_file(dict(model.state_dict()), folder / f"{name}{rank}.safetensors")
