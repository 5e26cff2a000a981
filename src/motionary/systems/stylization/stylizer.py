"""Generative motion stylization in latent space (thesis chapter 5)."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from motionary.corpus.batch import LabeledBatch
from motionary.corpus.context import Context
from motionary.errors import DEEPEST, HEAVIEST, WIDEST, InputError, check_range
from motionary.features import UNIT
from motionary.nn.convolutions import coarser, keep
from motionary.nn.layers import length_mask
from motionary.systems.stylization.latents import Latents, LatentsConfig
from motionary.systems.stylization.style_networks import ContentEncoder, Generator, StyleEncoder
from motionary.systems.trainable import Trainable

SETTINGS = ("supervised", "unsupervised")
STRIDE = 2 * UNIT  # frames of one step of content


@dataclass(frozen=True)
class StylizationConfig:
    """Settings of one stylizer; conf/stylization.yaml explains each.

    Attributes:
        labels: styles that the style encoder and the generator are told; 0 is the unsupervised scheme, which drops
            the label and nothing else.
        hsa, cycle, kl: lambda_hsa, lambda_cyc, lambda_kl of its scheme. Reconstructions are means over valid steps and
            features, divergences means over the style code's dimensions, in place of sums: so the weights mean the
            same at any size (with sums, those of the supervised setting leave nothing in the style code).
        variant, latent_width, code_dim: of the frozen autoencoder (the stage takes them from there).
    """

    labels: int = 0
    width: int = 512
    content_dim: int = 512
    style_dim: int = 512
    num_blocks: int = 1
    hsa: float = 1.0
    cycle: float = 0.1
    kl: float = 0.1
    latent_weight: float = 1.0
    variant: str = "V"
    latent_width: int = 512
    code_dim: int = 512
    window: int = 160

    def __post_init__(self) -> None:
        check_range("stylization", self, ("width", "content_dim", "style_dim"), 1, WIDEST)
        check_range("stylization", self, ("num_blocks",), 0, DEEPEST)
        check_range("stylization", self, ("labels", "hsa", "cycle", "kl", "latent_weight"), 0, HEAVIEST)


class Stylizer(Trainable):
    """Content encoder, style encoder and generator between the frozen encoder and decoder of motion codes.

    The autoencoder is part of the saved model and never trained: no gradient of its weights is computed.
    """

    def __init__(self, config: StylizationConfig, context: Context):
        super().__init__()
        self.config, self.context = config, context
        self.latents = Latents(LatentsConfig(config.variant, config.latent_width, config.code_dim), context)
        self.latents.requires_grad_(False)
        codes, width = self.latents.dim, config.width
        self.content_encoder = ContentEncoder(codes, width, config.content_dim, config.num_blocks)
        self.style_encoder = StyleEncoder(codes, width, config.style_dim, config.labels)
        self.generator = Generator(codes, width, config.content_dim, config.style_dim, config.num_blocks, config.labels)

    @property
    def receptive(self) -> int:
        """Frames that one step of the style encoder sees: the shortest motion that has a style."""
        around = 0 if self.config.variant == "none" else 2 * 3  # of the autoencoder's two convolutions
        return UNIT * StyleEncoder.RECEPTIVE + around

    def train(self, mode: bool = True) -> Stylizer:
        """The frozen autoencoder stays in evaluation mode."""
        super().train(mode)
        self.latents.eval()
        return self

    def label(self, style: Tensor) -> Tensor | None:
        """(B,) labels for the networks; None in the unsupervised scheme."""
        return style if self.config.labels else None

    def loss(
        self, batch: LabeledBatch, progress: float, generator: torch.Generator
    ) -> tuple[Tensor, dict[str, Tensor]]:
        """L_rec + lambda_hsa L_hsa + lambda_cyc L_cyc + lambda_kl L_kl (Eq. 5.1-5.4) of a batch of triples: all z1,
        then all z2 of the same clips, then all z3."""
        frames = batch.frames // STRIDE * STRIDE
        if int(frames.min()) < STRIDE:
            raise InputError("frames", int(batch.frames.min()), f"motions must have at least {STRIDE} frames")
        steps = int(frames.max())
        local = self.latents.local(batch.motion[:, :steps])  # (3 B, T, local_dim)
        with torch.no_grad():
            codes = self.latents.encode(local, frames)  # (3 B, D_z, S)
        count = frames // UNIT  # (3 B,) codes
        mask = length_mask(count, codes.shape[-1])[:, None].to(codes.dtype)  # (3 B, 1, S)
        label = self.label(batch.style)
        first, second, third = _thirds(len(batch.motion))

        content = self.content_encoder(codes, mask)  # (3 B, D_c, S/2)
        mean, log_variance = self.style_encoder(codes, label, mask)  # (3 B, D_s) both
        style = _draw(mean, log_variance, generator)

        # Autoencoding of z1 and z2, and the transfer of z3's style onto z2, in one pass.
        source = torch.cat([first, second, second])
        made = self._generate(content[source], style, label, mask[source])  # (3 B, D_z, S)
        transferred, transferred_mask = made[third], mask[second]  # (B, D_z, S), as long as its content z2
        made_mean, made_log_variance = self.style_encoder(transferred, _at(label, third), transferred_mask)
        made_style = _draw(made_mean, made_log_variance, generator)

        # The cycle: what was transferred gives z2 its content back, and z3 its style.
        back = torch.cat([self.content_encoder(transferred, transferred_mask), content[third]])
        targets = torch.cat([second, third])
        cycled = self._generate(  # (2 B, D_z, S)
            back, torch.cat([style[second], made_style]), _at(label, targets), torch.cat([mask[second], mask[third]])
        )
        known = torch.cat([first, second, targets])
        # Means over items, times the two that Eq. 5.1 and 5.3 sum: z1 and z2, and z2 and z3.
        errors = self._errors(torch.cat([made[: 2 * len(first)], cycled]), codes, local, count, known)
        terms = {
            "reconstruction": errors[: 2 * len(first)].mean() * 2,
            "cycle": errors[2 * len(first) :].mean() * 2,
            "hsa": divergence(mean[first], log_variance[first], mean[second], log_variance[second]).mean(),
            "kl": 3 * divergence(mean, log_variance).mean() + divergence(made_mean, made_log_variance).mean(),
        }
        c = self.config
        loss = terms["reconstruction"] + c.hsa * terms["hsa"] + c.cycle * terms["cycle"] + c.kl * terms["kl"]
        return loss, {name: value.detach() for name, value in terms.items()}

    def _generate(self, content: Tensor, style: Tensor, label: Tensor | None, mask: Tensor) -> Tensor:
        made = self.generator(content, self.generator.style(style, label), coarser(mask))
        return keep(made, mask)

    def _errors(self, made: Tensor, codes: Tensor, local: Tensor, count: Tensor, known: Tensor) -> Tensor:
        """(N,) of each made item: mean absolute error of its codes and of its motion against item `known`."""
        decoded = self.latents.decode(made, count[known])
        code_error = (made - codes[known]).abs().mean(1)  # (N, S)
        motion_error = (decoded - local[known]).abs().mean(-1)  # (N, T)
        steps = length_mask(count[known], made.shape[-1]).to(made.dtype)
        frames = length_mask(count[known] * UNIT, decoded.shape[1]).to(made.dtype)
        code_error = (code_error * steps).sum(-1) / steps.sum(-1)
        return self.config.latent_weight * code_error + (motion_error * frames).sum(-1) / frames.sum(-1)


def divergence(
    mean: Tensor, log_variance: Tensor, other_mean: Tensor | None = None, other_log_variance: Tensor | None = None
) -> Tensor:
    """(B,) KL divergence of N(mean, variance) from another diagonal normal, by default from N(0, I) (Eq. 5.2, 5.4), for
    each of the code's dimensions: their mean."""
    if other_mean is None or other_log_variance is None:
        other_mean, other_log_variance = torch.zeros_like(mean), torch.zeros_like(mean)
    ratio = log_variance - other_log_variance
    away = (mean - other_mean).square() * (-other_log_variance).exp()
    return 0.5 * (ratio.exp() + away - 1 - ratio).mean(-1)


def trainable(settings: Sequence[str], context: Context) -> list[str]:
    """The settings of the list that can be trained: a corpus without style labels leaves out "supervised", and says
    so on standard error. InputError for an unknown setting, or where nothing is left."""
    for setting in settings:
        if setting not in SETTINGS:
            raise InputError("stylization.settings", setting, f"must be among {', '.join(SETTINGS)}")
    kept = [setting for setting in settings if setting == "unsupervised" or context.styles]
    if "supervised" in settings and "supervised" not in kept:
        print("supervised stylization is left out: the corpus has no style labels in its clips.jsonl", file=sys.stderr)
    if not kept:
        raise InputError("stylization.settings", list(settings), "must name a setting that the corpus has labels for")
    return list(dict.fromkeys(kept))


def _thirds(items: int) -> tuple[Tensor, Tensor, Tensor]:
    if items % 3:
        raise InputError("batch", items, "must hold triples: all z1, all z2, all z3")
    first, second, third = torch.arange(items).chunk(3)
    return first, second, third


def _at(label: Tensor | None, rows: Tensor) -> Tensor | None:
    return None if label is None else label[rows]


def _draw(mean: Tensor, log_variance: Tensor, generator: torch.Generator) -> Tensor:
    noise = torch.randn(mean.shape, generator=generator, device=mean.device, dtype=mean.dtype)
    return mean + noise * (0.5 * log_variance).exp()
