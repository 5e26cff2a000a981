"""Action labels to motion: a temporal VAE whose prior is learned, conditioned on action and time (thesis 3.2.1)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from motionary.corpus.batch import ActedBatch
from motionary.corpus.context import Context
from motionary.errors import HEAVIEST, WIDEST, InputError, check_range, check_values
from motionary.nn.gaussian import Gaussian, divergence, gaussian
from motionary.nn.layers import initialize, length_mask, masked_mean
from motionary.nn.poses import to_poses
from motionary.systems.action2motion.pose_decoders import DECODERS
from motionary.systems.trainable import Loss, Trainable


@dataclass(frozen=True)
class Action2MotionConfig:
    """Settings of one model, here the thesis's (3.3); conf/action2motion.yaml explains each.

    Attributes:
        labels: names of the actions, coarse ("walk") or fine ("walk/old"); a label id is a position in them.
        fine: which of the two.
        decoder: plain, lie, glmi_m or glmi_r (Fig. 3.4).
        baseline: without latents: the deterministic CondGRU of 3.3, which needs a first pose to start from.
    """

    labels: tuple[str, ...]
    fine: bool = False
    decoder: str = "glmi_m"
    baseline: bool = False
    width: int = 128
    latent: int = 30
    upstream: int = 20
    generator_layers: int = 2
    kl_start: float = 0.001
    kl_end: float = 0.1
    align_weight: float = 10.0
    teacher_forcing: float = 0.6

    def __post_init__(self) -> None:
        object.__setattr__(self, "labels", tuple(self.labels))
        if not self.labels:
            raise InputError("action2motion.labels", "none", "the corpus must name at least one action")
        rule = f"must be one of {', '.join(DECODERS)}"
        check_values("action2motion", self, ("decoder",), lambda v: v in DECODERS, rule)
        check_range("action2motion", self, ("width", "latent", "upstream"), 1, WIDEST)
        check_range("action2motion", self, ("generator_layers",), 1, 8)
        check_range("action2motion", self, ("kl_start", "kl_end", "align_weight"), 0, HEAVIEST)
        check_range("action2motion", self, ("teacher_forcing",), 0, 1)


class Recurrent(nn.Module):
    """A linear encoder E_n, a GRU and, where asked for, a linear layer after it (Eq. 3.7, 3.8)."""

    def __init__(self, inputs: int, width: int, layers: int, outputs: int = 0):
        super().__init__()
        self.encoder = nn.Linear(inputs, width)
        self.unit = nn.GRU(width, width, layers, batch_first=True)
        self.out = nn.Linear(width, outputs) if outputs else nn.Identity()

    def forward(self, x: Tensor, state: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Inputs (B, S, d) -> outputs (B, S, o) and the state after the last step; None starts from zero."""
        hidden, last = self.unit(self.encoder(x), state)
        return self.out(hidden), last


class Action2Motion(Trainable):
    """p(poses | action, length): posterior, prior and generator (Eq. 3.6-3.8) over a pose decoder.

    A condition (B, S, A + 1) is the action's one-hot vector and the time t / T of each frame. Poses (B, S, 3 J) are
    those of :mod:`motionary.nn.poses`; p_0 is zero.
    """

    def __init__(self, config: Action2MotionConfig, context: Context):
        super().__init__()
        self.config, self.context = config, context
        pose, condition, z = 3 * len(context.skeleton), len(config.labels) + 1, self.latent
        read = pose + condition
        self.generator = Recurrent(read + z, config.width, config.generator_layers)
        self.decoder = DECODERS[config.decoder](config.width, context.skeleton, config.upstream)
        self.posterior = Recurrent(read, config.width, 1, 2 * z) if z else None
        self.prior = Recurrent(read, config.width, 1, 2 * z) if z else None
        initialize(self)

    @property
    def latent(self) -> int:
        """Dimensions of z; the baseline has none."""
        return 0 if self.config.baseline else self.config.latent

    def condition(self, labels: Tensor, length: Tensor) -> Tensor:
        """Conditions (B, S, A + 1) of label ids (B, S) and the whole lengths T (B,)."""
        time = torch.arange(1, labels.shape[1] + 1, device=labels.device) / length[:, None]
        one_hot = F.one_hot(labels, len(self.config.labels)).to(time.dtype)
        return torch.cat([one_hot, time.clamp(max=1)[..., None]], -1)

    def loss(self, batch: ActedBatch, progress: float, generator: torch.Generator) -> Loss:
        """Eq. 3.10 of the motions with a known label; its sums over time are means over valid frames.

        A coin is thrown for each sequence: it reads either true poses or its own. Its own are read without gradient, so
        they are generated first, and everything else is one pass over whole sequences.
        """
        labels = batch.fine if self.config.fine else batch.action
        known = labels >= 0
        joints, frames, labels = batch.joints[known], batch.frames[known], labels[known]
        poses = to_poses(joints, self.context.fps)  # (B, S, P)
        condition = self.condition(labels[:, None].expand(poses.shape[:2]), frames)
        draws = {"generator": generator, "device": poses.device}
        forced = torch.rand(len(poses), **draws) < self.config.teacher_forcing
        noise = torch.randn(*poses.shape[:2], self.latent, **draws)
        own = self.posterior_of(poses, condition)
        z = None if own is None else own.sample(noise)

        before = _before(poses)
        if not bool(forced.all()):
            free = ~forced
            latents = None if z is None else z[free].detach()
            made = self.unroll(condition[free], lambda step, _: None if latents is None else latents[:, step])
            before = before.index_put((free.nonzero()[:, 0],), _before(made).to(before.dtype))
        hidden, _ = self.generator(_joined(before, condition, z))
        found, _ = self.decoder(hidden, before, None)
        terms = self._terms(found, poses, forced, length_mask(frames, poses.shape[1]))
        if own is not None:
            weight = self.config.kl_start + progress * (self.config.kl_end - self.config.kl_start)
            gap = divergence(own, self.prior_of(before, condition))
            terms["kl"] = (weight, masked_mean(gap, length_mask(frames, poses.shape[1])))
        total = torch.stack([weight * value for weight, value in terms.values()]).sum()
        return total, {name: value.detach() for name, (_, value) in terms.items()}

    @torch.no_grad()
    def unroll(
        self, condition: Tensor, latent: Callable[[int, Tensor], Tensor | None], given: Tensor | None = None
    ) -> Tensor:
        """Poses (B, S, P), each made from the one before it.

        Args:
            condition: (B, S, A + 1).
            latent: (step, the pose before (B, 1, P)) -> z (B, z), None for the deterministic baseline.
            given: (B, K, P) poses that stand at the beginning and are read as they are.
        """
        read = condition.new_zeros(len(condition), 1, 3 * len(self.context.skeleton))
        state = memory = None
        poses = []
        for step in range(condition.shape[1]):
            z = latent(step, read)
            here = condition[:, step : step + 1]
            hidden, state = self.generator(_joined(read, here, None if z is None else z[:, None]), state)
            made, memory = self.decoder(hidden, read, memory)
            read = made if given is None or step >= given.shape[1] else given[:, step : step + 1]
            poses.append(read)
        return torch.cat(poses, 1)

    def posterior_of(self, poses: Tensor, condition: Tensor) -> Gaussian | None:
        """q(z_t | p_1:t) of Eq. 3.7."""
        return None if self.posterior is None else gaussian(self.posterior(_joined(poses, condition, None))[0])

    def prior_of(self, before: Tensor, condition: Tensor) -> Gaussian:
        """p(z_t | p_1:t-1) of Eq. 3.8."""
        assert self.prior is not None
        return gaussian(self.prior(_joined(before, condition, None))[0])

    def _terms(self, found: Tensor, poses: Tensor, forced: Tensor, valid: Tensor) -> dict[str, tuple[float, Tensor]]:
        """The reconstruction of Eq. 3.11, where the root goes on from the true place (`forced`) or its own; and, of
        the GLMI decoders, the alignment of Eq. 3.10, in metres a frame."""
        away = found - poses
        moved = away[..., [0, 2]] / self.context.fps  # (B, S, 2) metres a frame
        summed = (moved * valid[..., None]).cumsum(1)
        ground = torch.where(forced[:, None, None], moved, summed)
        root = torch.stack([ground[..., 0], away[..., 1], ground[..., 1]], -1)[..., None, :]
        errors = torch.cat([root, away[..., 3:].unflatten(-1, (-1, 3)) + root], -2)  # (B, S, J, 3)
        terms = {"joints": (1.0, masked_mean(_norm(errors).sum(-1), valid))}
        if self.decoder.aligns:
            velocity = torch.cat([moved, away[..., 1:2]], -1)  # the height stands for the vertical one
            terms["alignment"] = (self.config.align_weight, masked_mean(_norm(velocity), valid))
        return terms


def _before(poses: Tensor) -> Tensor:
    """What is read at each step: the pose before, zero at first."""
    return F.pad(poses[:, :-1], (0, 0, 1, 0))


def _joined(poses: Tensor, condition: Tensor, z: Tensor | None) -> Tensor:
    return torch.cat([part for part in (poses, condition, z) if part is not None], -1)


def _norm(vectors: Tensor) -> Tensor:
    """Lengths with a finite gradient at 0, where each is off by a hundredth of a millimetre."""
    return (vectors.square().sum(-1) + 1e-10).sqrt()
