"""A small regression problem for tests of the loop; as a script, a training that several processes can share."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import save_file
from torch import nn

from motionary.corpus.batches import Batch, Batches
from motionary.nn.quantizer import Quantizer
from motionary.systems.trainable import Trainable
from motionary.training.devices import make_fabric
from motionary.training.loop import fit
from motionary.training.settings import TrainSettings


class Numbers:
    """Vectors whose target is a fixed linear map of them, as a corpus dataset."""

    def __init__(self, count: int = 96, seed: int = 0):
        rng = np.random.default_rng(seed)
        self.x = rng.normal(size=(count, 6)).astype(np.float32)
        self.y = (self.x @ np.random.default_rng(99).normal(size=(6, 2))).astype(np.float32)
        self.lengths, self.weights = np.ones(count, dtype=int), None

    def __len__(self) -> int:
        return len(self.x)

    def collate(self, indices, rng) -> Batch:
        values = np.concatenate([self.x[indices], self.y[indices]], axis=1)
        return Batch(clip=torch.as_tensor(indices), motion=torch.from_numpy(values)[:, None])


class Regression(Trainable):
    """Two layers with dropout and noise from the loop's generator, so that resuming must restore both."""

    def __init__(self, dropout: float = 0.2, noise: float = 0.05):
        super().__init__()
        torch.manual_seed(3)
        self.net = nn.Sequential(nn.Linear(6, 16), nn.Tanh(), nn.Dropout(dropout), nn.Linear(16, 2))
        self.register_buffer("seen", torch.zeros(()))
        self.noise = noise

    def loss(self, batch, progress, generator):
        x, y = batch.motion[:, 0].split([6, 2], dim=1)
        x = x + self.noise * torch.randn(x.shape, generator=generator)
        loss = (self.net(x) - y).square().mean()
        return loss, {"progress": torch.tensor(progress)}

    def validate(self, batch):
        x, y = batch.motion[:, 0].split([6, 2], dim=1)
        return {"loss": (self.net(x) - y).square().mean()}

    def after_step(self, step, progress, generator):
        self.seen += 1


def settings(**changes) -> TrainSettings:
    values = dict(
        steps=40,
        batch_size=8,
        learning_rate=0.02,
        weight_decay=0.01,
        max_grad_norm=1.0,
        warmup_steps=5,
        validate_every=7,
    )
    return TrainSettings(**{**values, **changes})


def batches(config: TrainSettings, rank: int = 0, world: int = 1, seed: int = 0) -> Batches:
    return Batches(Numbers(), config.batch_size, seed, drop_last=True, rank=rank, world=world)


def restarted_codes(rank: int) -> dict[str, torch.Tensor]:
    """A codebook of which most codes are dead, a step and a restart later; each process sees latents of its own."""
    quantizer = Quantizer(16, 3, dead=0.5, decay=0.5).train()
    latents = torch.randn(1, 400, 3, generator=torch.Generator().manual_seed(rank))
    quantizer.start(torch.zeros(20, 3), torch.Generator().manual_seed(rank))  # all codes in one place
    mask = torch.ones(1, 400, dtype=torch.bool)
    found = {"used_before": len(quantizer(latents, mask)[1].unique())}
    found["restarted"] = quantizer.restart(torch.Generator().manual_seed(rank))
    found["used"] = len(quantizer.nearest(latents).unique())
    equal = {f"quantizer.{name}": value for name, value in quantizer.state_dict().items()}
    return {**equal, **{name: torch.tensor(value) for name, value in found.items()}}


if __name__ == "__main__":
    torch.set_num_threads(1)
    folder, fabric, config = Path(sys.argv[1]), make_fabric("cpu"), settings(batch_size=4)
    rank = fabric.global_rank
    own = batches(config, rank, fabric.world_size)
    # A folder for each process, as on machines that share none.
    cache = folder / f"cache{rank}" / "toy.safetensors"
    fit(plain := Regression(dropout=0.0, noise=0.0), own, None, config, fabric)
    fit(unbroken := Regression(), own, own, config, fabric)
    fit(Regression(), own, own, config, fabric, cache, stop_after=24)  # the last checkpoint is of step 21
    fit(resumed := Regression(), own, own, config, fabric, cache)
    for name, model in (("plain", plain), ("unbroken", unbroken), ("resumed", resumed)):
        save_file(model.state_dict(), folder / f"{name}{rank}.safetensors")
    save_file(restarted_codes(rank), folder / f"codes{rank}.safetensors")
