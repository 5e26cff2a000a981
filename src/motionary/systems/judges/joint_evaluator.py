"""The second judge: joints and sentences in one space, by convolutions and attention, apart from all of T2M.

Training is TMR's (Petrovich, Black, Varol, ICCV 2023), without its decoder: symmetric InfoNCE, in which texts that the
frozen language model finds alike are no negatives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from motionary.corpus.batch import JointBatch
from motionary.corpus.context import Context
from motionary.errors import DEEPEST, HEAVIEST, WIDEST, InputError, check_range, check_share, check_values
from motionary.features import UNIT
from motionary.language import STATE_DIM
from motionary.nn.convolutions import Down, ResBlock, coarser, keep
from motionary.nn.layers import length_mask
from motionary.nn.precision import full_precision, widened
from motionary.nn.transformer import EncoderLayer
from motionary.systems.judges.contrastive import first_share, infonce_loss
from motionary.systems.judges.skeletal import View, channels
from motionary.systems.trainable import Loss, Trainable


@dataclass(frozen=True)
class JointEvaluatorConfig:
    """Settings of the second judge; conf/joint_evaluator.yaml explains each."""

    width: int = 192
    num_layers: int = 2
    num_heads: int = 4
    dim: int = 256
    rate: float = 10.0
    dropout: float = 0.2
    temperature: float = 0.1
    alike: float = 0.8
    tempo: float = 0.15
    bones: float = 0.1
    radius: float = 10.0

    def __post_init__(self) -> None:
        name = "joint_evaluator"
        check_range(name, self, ("width", "num_heads", "dim"), 1, WIDEST)
        check_range(name, self, ("num_layers",), 1, DEEPEST)
        check_share(name, self, ("dropout", "tempo", "bones"))
        check_range(name, self, ("alike",), 0, 1)
        scales = ("temperature", "radius", "rate")
        check_values(name, self, scales, lambda v: 0 < v <= HEAVIEST, f"must be above 0, at most {HEAVIEST}")
        if self.width % self.num_heads:
            raise InputError(f"{name}.width", self.width, f"must be divisible by num_heads={self.num_heads}")


class JointEvaluator(Trainable):
    """Text and motion to vectors that are near where they match.

    embed_states(states (B, N, d), count (B,)) -> (B, dim); embed_joints(joints (B, T, J, 3), frames (B,)) -> (B, dim);
    embed_motion(raw (B, T, D), frames (B,)) decodes the corpus's features first. None depends on padding or on the rest
    of the batch; nothing depends on where a motion starts, which way it faces then, or how large the body is.
    """

    reads_states = True

    def __init__(self, config: JointEvaluatorConfig, context: Context):
        super().__init__()
        self.config, self.context = config, context
        self.view = View(context.skeleton, context.fps, config.rate)
        width = config.width
        self.downs = nn.ModuleList([Down(channels(len(context.skeleton)), width), Down(width, width)])
        self.blocks = nn.ModuleList([ResBlock(width), ResBlock(width, dilation=2)])
        self.motion = _Branch(config)
        self.words = nn.Linear(STATE_DIM, width)
        self.text = _Branch(config)
        self.dropout = nn.Dropout(config.dropout)

    def embed_states(self, states: Tensor, count: Tensor) -> Tensor:
        """Features of sentences as token states."""
        return self._place(self.text(self.words(self.dropout(states)), length_mask(count, states.shape[1])))

    def embed_motion(self, raw: Tensor, frames: Tensor) -> Tensor:
        """Features of motions in the corpus's features."""
        codec, device = self.context.make_codec(), raw.device
        joints = raw.new_zeros(*raw.shape[:2], len(self.context.skeleton), 3)
        for item, (features, count) in enumerate(zip(raw.cpu().numpy(), frames.tolist(), strict=True)):
            decoded = codec.decode(features[:count], fps=self.context.fps).positions
            joints[item, :count] = torch.from_numpy(decoded).to(device)
        return self.embed_joints(joints, frames)

    def embed_joints(self, joints: Tensor, frames: Tensor, tempo: Tensor | None = None) -> Tensor:
        """Features of motions of at least 4 frames as joints in metres; shorter ones are an InputError."""
        if int(frames.min()) < UNIT:
            raise InputError("frames", int(frames.min()), f"a motion needs at least {UNIT} frames")
        with full_precision(joints):  # positions, to the millimetre
            x, steps = self.view(joints, frames, tempo)
        x = F.pad(x, (0, 0, 0, -x.shape[1] % 4)).transpose(1, 2)  # (B, C, S), S a multiple of 4: halved twice
        mask = length_mask(steps, x.shape[-1])[:, None].to(x.dtype)
        for down, block in zip(self.downs, self.blocks, strict=True):
            mask = cast(Tensor, coarser(mask))
            x = block(down(self.dropout(x), mask), mask)
        return self._place(self.motion(x.transpose(1, 2), mask[:, 0] > 0))

    def loss(self, batch: JointBatch, progress: float, generator: torch.Generator) -> Loss:
        """InfoNCE; in training each motion is read at a tempo and on a body of its own."""
        joints, tempo = batch.joints, None
        if self.training:
            draw = torch.rand(len(joints), generator=generator, device=joints.device)
            tempo = 1 + self.config.tempo * (2 * draw - 1)
            with full_precision(joints):
                joints = self.view.other_bones(joints, self.config.bones, generator)
        motion = self.embed_joints(joints, batch.frames, tempo)
        text = self.embed_states(batch.states, batch.state_count)
        same = batch.text_key[:, None] == batch.text_key[None]  # (B, B)
        no_negative = same | (similarity(batch.states, batch.state_count) > self.config.alike)
        loss = infonce_loss(text, motion, no_negative, self.config.temperature)
        return loss, {"top1": first_share(text, motion, same)}

    def _place(self, x: Tensor) -> Tensor:
        return self.config.radius * F.normalize(widened(x), dim=-1)


def similarity(states: Tensor, count: Tensor) -> Tensor:
    """(B, B) cosines of the sentence embeddings (means over tokens) of states (B, N, d), count (B,)."""
    sentence = F.normalize(states.float().sum(1) / count[:, None], dim=-1)
    with full_precision(sentence):
        return sentence @ sentence.t()


class _Branch(nn.Module):
    """Attention over steps x (B, N, width) with their mask (B, N), pooled by mean and maximum, then a head."""

    def __init__(self, config: JointEvaluatorConfig):
        super().__init__()
        width = config.width
        self.layers = nn.ModuleList(
            EncoderLayer(width, config.num_heads, 2 * width, config.dropout) for _ in range(config.num_layers)
        )
        self.norm = nn.LayerNorm(2 * width)
        self.head = nn.Sequential(
            nn.Linear(2 * width, width), nn.GELU(), nn.Dropout(config.dropout), nn.Linear(width, config.dim)
        )

    def forward(self, x: Tensor, mask: Tensor) -> Tensor:
        """(B, dim)."""
        for layer in self.layers:
            x = layer(x, mask[:, None, None])
        kept = keep(x, mask[..., None].to(x.dtype))
        mean = kept.sum(1) / mask.sum(1, keepdim=True)
        most = x.masked_fill(~mask[..., None], -torch.inf).amax(1)
        return self.head(self.norm(torch.cat([mean, most], -1)))
