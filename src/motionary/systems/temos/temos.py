"""TEMOS: motion and text in one latent space, one decoder for both (TEMOS 3.2, 3.3; Eq. 1-3)."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from motionary.corpus.batch import ReadBatch
from motionary.corpus.context import Context
from motionary.errors import DEEPEST, HEAVIEST, MOST, WIDEST, InputError, check_range, check_share, check_values
from motionary.features import CODECS, codec
from motionary.nn.gaussian import Gaussian, divergence
from motionary.nn.layers import Normalizer, length_mask, masked_mean
from motionary.systems.temos.sequences import RecurrentDecoder, RecurrentEncoder, SequenceDecoder, SequenceEncoder
from motionary.systems.trainable import Loss, Trainable

ARCHITECTURES = ("transformer", "gru")


@dataclass(frozen=True)
class TemosConfig:
    """Settings of TEMOS, here the paper's (0.D) but for the heads; conf/temos.yaml explains each."""

    features: str = "rifke"
    fps: float = 12.5
    latent: int = 256
    num_layers: int = 6
    num_heads: int = 4
    dim_feedforward: int = 1024
    dropout: float = 0.1
    text_layers: int = 0
    text_heads: int = 0
    architecture: str = "transformer"
    deterministic: bool = False
    motion_encoder: bool = True
    cross_kl: bool = True
    prior_kl: bool = True
    kl_weight: float = 1e-5
    embedding_weight: float = 1e-5
    language_model: str = ""
    fine_tune: bool = False
    max_frames: int = 500
    most_captions: int = 0
    text_dim: int = 384  # of the language model's states; the stage takes it from there
    temperature: float = 1.0

    def __post_init__(self) -> None:
        for key, known in (("features", tuple(CODECS)), ("architecture", ARCHITECTURES)):
            check_values("temos", self, (key,), known.__contains__, f"must be one of {', '.join(known)}")
        check_range("temos", self, ("fps",), 1, 240)
        check_range("temos", self, ("latent", "dim_feedforward", "text_dim"), 1, WIDEST)
        check_range("temos", self, ("num_layers",), 1, DEEPEST)
        check_range("temos", self, ("text_layers",), 0, DEEPEST)
        check_range("temos", self, ("max_frames", "most_captions"), 0, MOST)
        check_range("temos", self, ("kl_weight", "embedding_weight", "temperature"), 0, HEAVIEST)
        check_share("temos", self, ("dropout",))
        check_values("temos", self, ("latent",), lambda v: v % 2 == 0, "must be even: sinusoids come in pairs")
        for key in ("num_heads", "text_heads"):
            heads = getattr(self, key) or (self.num_heads if key == "text_heads" else 0)
            if heads < 1 or self.latent % heads:
                raise InputError(f"temos.{key}", heads, f"must divide latent, {self.latent}")


class Temos(Trainable):
    """p(motion | text, duration) through one latent that text and motion share.

    encode_motion(raw (B, F, D), frames (B,)) and encode_text(text, count (B,)) -> distributions over (B, latent);
    decode(z (B, latent), frames (B,)) -> raw features (B, F, D), zero beyond. D is of the config's own codec.
    """

    def __init__(self, config: TemosConfig, context: Context):
        super().__init__()
        self.config, self.context = config, context
        self.codec = codec(config.features, context.skeleton)
        dim = self.codec.dim
        # Placeholders; `take_statistics` fills them, and saved weights hold them.
        mean, std = torch.zeros(dim), torch.ones(dim)
        self.normalizer = Normalizer(mean.numpy(), std.numpy())
        self.motion = self._encoder(dim, config.num_layers, config.num_heads) if config.motion_encoder else None
        layers, heads = config.text_layers or config.num_layers, config.text_heads or config.num_heads
        self.text = self._encoder(config.text_dim, layers, heads)
        shape = (dim, config.latent, config.num_layers)
        self.decoder: nn.Module = (
            RecurrentDecoder(*shape, config.dropout)
            if config.architecture == "gru"
            else SequenceDecoder(*shape, config.num_heads, config.dim_feedforward, config.dropout)
        )
        self.language = _language_model(config) if config.fine_tune else None

    def _encoder(self, inputs: int, layers: int, heads: int) -> nn.Module:
        config = self.config
        shape = (inputs, config.latent, layers)
        if config.architecture == "gru":
            return RecurrentEncoder(*shape, config.dropout, not config.deterministic)
        return SequenceEncoder(*shape, heads, config.dim_feedforward, config.dropout, not config.deterministic)

    @torch.no_grad()
    def take_statistics(self, mean: Tensor, std: Tensor) -> Temos:
        """The training features' mean and standard deviation (D,), by which they are standardized (0.B)."""
        self.normalizer.mean.copy_(mean)
        self.normalizer.std.copy_(std)
        return self

    def encode_motion(self, raw: Tensor, frames: Tensor) -> Gaussian:
        """phi^M of raw features; InputError where the model was trained without a motion encoder."""
        if self.motion is None:
            raise InputError("temos.motion_encoder", False, "this model was trained without one and reads no motion")
        return self.motion(self.normalizer(raw), frames)

    def encode_text(self, text: Tensor, count: Tensor) -> Gaussian:
        """phi^T of a language model's states (B, N, d), or of its token ids (B, N) where that model is trained too."""
        if self.language is not None:
            text = self.language(input_ids=text, attention_mask=length_mask(count, text.shape[1])).last_hidden_state
        return self.text(text.to(self.normalizer.mean.dtype), count)  # states are stored as float16

    def decode(self, z: Tensor, frames: Tensor) -> Tensor:
        """Raw features of latents."""
        valid = length_mask(frames, int(frames.max()))
        return self.normalizer.inverse(self.decoder(z, frames)) * valid[..., None]

    def loss(self, batch: ReadBatch, progress: float, generator: torch.Generator) -> Loss:
        """L_R + lambda_KL L_KL + lambda_E L_E (Eq. 1-3), over valid frames alone."""
        config = self.config
        target = self.normalizer(batch.motion)  # (B, F, D)
        valid = length_mask(batch.frames, target.shape[1])  # (B, F)
        text = self.encode_text(batch.states, batch.state_count)
        motion = None if self.motion is None else self.motion(target, batch.frames)
        latents = [self._draw(branch, generator) for branch in (text, motion) if branch is not None]
        # Both branches in one pass of the decoder: (2B, F, D).
        made = self.decoder(torch.cat(latents), batch.frames.repeat(len(latents))).chunk(len(latents))
        terms = {name: smooth_l1(part, target, valid) for name, part in zip(("text", "motion"), made, strict=False)}
        loss = torch.stack(list(terms.values())).sum()  # Eq. 1
        if not config.deterministic:
            terms["kl"] = kl_terms(text, motion, config.cross_kl, config.prior_kl)
            loss = loss + config.kl_weight * terms["kl"]
        if len(latents) == 2:
            terms["embedding"] = F.smooth_l1_loss(latents[0], latents[1])  # Eq. 3
            loss = loss + config.embedding_weight * terms["embedding"]
        return loss, {name: value.detach() for name, value in terms.items()}

    def _draw(self, branch: Gaussian, generator: torch.Generator) -> Tensor:
        """z by the reparametrization trick; where there is no variance, the latent itself."""
        if self.config.deterministic:
            return branch.mean
        return branch.sample(torch.randn(branch.mean.shape, generator=generator, device=branch.mean.device))


def smooth_l1(made: Tensor, target: Tensor, valid: Tensor) -> Tensor:
    """L_1 of Eq. 1: smooth L1 of (B, F, D), averaged over the frames that `valid` (B, F) keeps and their features."""
    return masked_mean(F.smooth_l1_loss(made, target, reduction="none"), valid)


def kl_terms(text: Gaussian, motion: Gaussian | None, cross: bool = True, prior: bool = True) -> Tensor:
    """Eq. 2, averaged over the batch: both divergences between text and motion (`cross`), and those of each from
    N(0, I) (`prior`). Without a motion encoder only the text's own is left."""
    normal = Gaussian(torch.zeros_like(text.mean), torch.zeros_like(text.mean))
    total = torch.zeros((), device=text.mean.device)
    if cross and motion is not None:
        total = total + (divergence(text, motion) + divergence(motion, text)).mean()
    if prior:
        total = total + sum(divergence(branch, normal).mean() for branch in (text, motion) if branch is not None)
    return total


def _language_model(config: TemosConfig) -> nn.Module:
    """A copy of the language model that may learn."""
    from motionary.language.frozen import load_encoder, model_path

    _, encoder = load_encoder(model_path(config.language_model or None))
    return copy.deepcopy(encoder).requires_grad_(True)
