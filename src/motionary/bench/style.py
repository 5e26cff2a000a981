"""Cases of stylization at the thesis's dimensions: a training step, and motions given another style."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import torch

from motionary.bench.made import make_batch, make_context
from motionary.bench.shapes import Shapes
from motionary.bench.workload import Work, noise, training_step

STYLES = tuple(f"style{i}" for i in range(16))  # as many as Aberman et al. recorded


def _stylizer(shapes: Shapes):
    from motionary.systems.stylization.stylizer import StylizationConfig, Stylizer

    config = StylizationConfig(
        labels=len(STYLES), width=shapes.style_width, content_dim=shapes.style_width, style_dim=shapes.style_width,
        latent_width=shapes.style_width, code_dim=shapes.style_width, window=shapes.style_window,
    )  # fmt: skip
    return Stylizer(config, replace(make_context(shapes), styles=STYLES))


def stylization(shapes: Shapes) -> Work:
    """A training step on a batch of triples."""
    model = _stylizer(shapes)
    batch = make_batch(3 * shapes.sequences, shapes.style_window)  # triples
    batch.style = torch.arange(len(batch)) % len(STYLES)
    return Work(training_step(shapes, model, lambda: model.loss(batch, 0.5, noise())[0]))


def stylize(motions: int | None = None) -> Callable[[Shapes], Work]:
    """Label-based, from features to features, with global motion prediction; None is a training batch of motions."""

    def prepare(shapes: Shapes) -> Work:
        """The stylizer, its contents and their labels."""
        from motionary.systems.stylization.global_motion import GlobalMotion, GlobalMotionConfig
        from motionary.systems.stylization.style_transfer import StyleTransfer

        model = _stylizer(shapes)
        root = GlobalMotion(GlobalMotionConfig(width=shapes.style_width // 4), model.context)
        transfer, count = StyleTransfer({"supervised": model}, root), motions or shapes.sequences
        contents = list(make_batch(count, shapes.style_window).motion.numpy())
        labels = [i % len(STYLES) for i in range(count)]
        asked = {"setting": "supervised", "labels": labels, "seeds": range(count)}
        return Work(lambda: transfer.stylize(contents, **asked))

    return prepare
