"""Cases of action2motion: a training step, and motions of actions."""

from __future__ import annotations

import torch

from motionary.bench.made import make_context
from motionary.bench.shapes import Shapes
from motionary.bench.workload import Work, noise, training_step
from motionary.corpus.batch import Batch


def _model(shapes: Shapes):
    from motionary.systems.action2motion.conditioned_vae import Action2Motion, Action2MotionConfig

    return Action2Motion(Action2MotionConfig(tuple(f"action{i}" for i in range(12))), make_context(shapes))


def action2motion(shapes: Shapes) -> Work:
    """A training step with the thesis's widths."""
    model, items, frames = _model(shapes), shapes.windows, shapes.acted_frames
    joints = torch.randn(items, frames, len(model.context.skeleton), 3, generator=torch.Generator().manual_seed(0))
    labels = torch.arange(items) % 12
    batch = Batch(torch.arange(items), joints=joints, frames=torch.full((items,), frames), action=labels, fine=labels)
    return Work(training_step(shapes, model, lambda: model.loss(batch, 0.5, noise())[0], clip=0.5))


def actions(shapes: Shapes) -> Work:
    """Motions of actions in one batch."""
    from motionary.systems.action2motion.actor import Actor

    actor, count = Actor({"glmi_m": _model(shapes)}), shapes.prompts
    plans = [[(f"action{i % 12}", shapes.acted_frames)] for i in range(count)]
    return Work(lambda: actor.act(plans, list(range(count))))
