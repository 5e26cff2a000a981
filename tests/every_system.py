"""Every system of the registry that is trained, built small or as configured, and a batch that each can read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import torch
from made_batches import make_batch

from motionary.corpus.batches import Batch
from motionary.corpus.context import Context
from motionary.language import STATE_DIM
from motionary.nn.layers import seeded
from motionary.systems.io import Trained, build_model, save_model
from motionary.systems.masked.masked_autoregression import MaskedAutoregression
from motionary.systems.masked.masked_generator import MaskedGenerator
from motionary.systems.registry import SYSTEMS
from motionary.systems.temos.temos import Temos

NAMES = tuple(system.name for system in SYSTEMS if system.build)
SMALL = dict(
    width=16, fine_width=8, code_dim=12, codebook_size=16, text_width=8, motion_width=12, dim=12, word_dim=8,
    num_layers=1, dim_feedforward=32, num_heads=2, attention_width=8, latent=4, content_dim=8, style_dim=8,
    max_tokens=12, detail_layers=1, components=4, head_width=16, head_blocks=1,
)  # fmt: skip


def labeled(context: Context) -> Context:
    """The same with two styles and two actions."""
    return replace(context, styles=("old", "proud"), actions=("run", "walk"))


def build_all(context: Context, folder: Path, sections: Mapping[str, Mapping[str, Any]] | None = None) -> Iterator:
    """(name, model) of every trained system, each built on the ones before, which are saved below `folder`.

    `sections` are the model's keys of each system; without them all are small.
    """
    for system in SYSTEMS:
        if not system.build:
            continue
        if sections is None:
            known = {field.name for field in fields(system.load(system.config))}
            settings: dict[str, Any] = {key: value for key, value in SMALL.items() if key in known}
        else:
            settings = dict(sections[system.name])
        if system.name == "stylization":
            settings |= {"setting": "supervised", "window": 32}
        if system.name == "action2motion":
            settings["labels"] = ("run", "walk")
        if system.name == "action_evaluator":
            settings["coarse"] = ("run", "walk")
        if system.name == "inverse_alignment":
            settings = {} if sections is None else settings
        with seeded(0):
            model = build_model(system.name, settings, context, Trained(folder))
        save_model(folder / system.name, system.name, model, context)
        yield system.name, model


def batch_for(context: Context, model: torch.nn.Module, codes: int = 16, seed: int = 0) -> Batch:
    """Six items, 16 to 32 frames, with every field filled for a model; tokens are below `codes`."""
    batch = make_batch(context, [32, 24, 16, 28, 32, 20], seed)
    draws = torch.Generator().manual_seed(seed)
    batch.token_count = batch.frames // context.unit
    batch.tokens = torch.randint(codes, (6, 8), generator=draws)
    batch.tokens[torch.arange(8) >= batch.token_count[:, None]] = 0
    batch.caption = torch.arange(6)
    batch.states = torch.randn(6, 9, STATE_DIM, generator=draws)
    batch.state_count = batch.word_count
    batch.joints = torch.randn(6, 32, len(context.skeleton), 3, generator=draws).cumsum(1) * 0.1
    batch.style, batch.action = torch.tensor([0, 1] * 3), torch.tensor([0, 0, 1, 1, 0, 1])
    batch.fine = batch.style
    if isinstance(model, MaskedGenerator):
        batch.tokens = batch.tokens[..., None].repeat(1, 1, model.config.num_quantizers)
    if isinstance(model, MaskedAutoregression):
        valid = torch.arange(8)[:, None] < batch.token_count[:, None, None]
        batch.tokens = torch.randn(6, 8, model.config.told, generator=draws) * valid
    if isinstance(model, Temos):  # it reads features of its own
        valid = torch.arange(32)[:, None] < batch.frames[:, None, None]
        batch.motion = torch.randn(6, 32, model.codec.dim, generator=draws) * valid
    return batch
