"""Motions of action labels with trained models: actions, transitions, outpainting, interpolation (thesis 3.3.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import Tensor

from motionary.errors import InputError
from motionary.features.lie import check_scale, scaled
from motionary.motion import Motion
from motionary.nn.gaussian import gaussian
from motionary.nn.noise import normal_noise
from motionary.nn.poses import to_joints, to_poses
from motionary.systems.action2motion.conditioned_vae import Action2Motion

Plan = Sequence[tuple[str, int]]  # actions and their frames, one after another


class Actor:
    """Makes motions with the trained variants. No result depends on the others of a call.

    Args:
        models: by variant, the usual one first.
        chunk: motions made together.
    """

    def __init__(self, models: Mapping[str, Action2Motion], chunk: int = 256):
        self.models, self.chunk = {name: model.eval() for name, model in models.items()}, chunk
        self.variants = tuple(self.models)
        self.context = next(iter(self.models.values())).context
        self.actions = tuple(dict.fromkeys(name for model in self.models.values() for name in model.config.labels))

    def labels_of(self, variant: str) -> tuple[str, ...]:
        """The labels that a variant knows."""
        return self._model(variant, ()).config.labels

    def starts_from_pose(self, variant: str) -> bool:
        """Whether a variant needs at least a first pose, as the baseline does, which draws nothing."""
        return not self._model(variant, ()).latent

    def act(
        self,
        plans: Sequence[Plan],
        seeds: Sequence[int],
        *,
        starts: Sequence[np.ndarray] | None = None,
        variant: str | None = None,
        scale: float = 1.0,
    ) -> list[Motion]:
        """A motion for each plan.

        Args:
            plans: actions and their frames. The label switches where the next action begins (Fig. 3.13); the time
                counter goes on over the whole motion.
            seeds: one for each.
            starts: joints (K, J, 3) in metres that each motion begins with and continues (Fig. 3.14). They come before
                the plan's frames, and the latents of their frames are the posterior's.
            variant: which model; None takes the usual one that knows the actions.
            scale: of the body. Kinematics are linear in bone lengths, so that the whole motion is scaled.

        Raises:
            InputError: an unknown action (the known ones are listed) or variant, a plan without frames, a scale that is
                not above 0, or a variant that needs a first pose and has none.
        """
        check_scale(scale)
        for name, given in (("seeds", seeds), ("starts", starts)):
            if given is not None and len(given) != len(plans):
                raise InputError(name, len(given), f"must be one for each of {len(plans)} motions")
        found: list[Motion] = []
        for at in range(0, len(plans), self.chunk):
            part = slice(at, at + self.chunk)
            found += self._chunk(plans[part], seeds[part], None if starts is None else starts[part], variant, scale)
        return found

    def between(self, action: str, frames: int, seeds: tuple[int, int], steps: int, scale: float = 1.0) -> list[Motion]:
        """`steps` motions of an action whose first latent lies on the line from that of one seed to that of another
        (Fig. 3.12); the latents after it are those of the first seed."""
        check_scale(scale)
        model = self._model(None, (action,))
        if not model.latent:
            raise InputError("action", action, "is known to a model without latents alone: nothing lies between")
        ends = normal_noise(seeds, 1, model.latent)[:, 0]
        share = torch.linspace(0, 1, steps)[:, None]
        noise = normal_noise([seeds[0]] * steps, frames, model.latent)
        noise[:, 0] = (1 - share) * ends[:1] + share * ends[1:]  # the first prior is one and the same for all
        return self._motions(model, [[(action, frames)]] * steps, noise, None, scale)

    def _chunk(
        self,
        plans: Sequence[Plan],
        seeds: Sequence[int],
        starts: Sequence[np.ndarray] | None,
        variant: str | None,
        scale: float,
    ) -> list[Motion]:
        model = self._model(variant, [action for plan in plans for action, _ in plan])
        if not model.latent and (starts is None or min(map(len, starts)) < 1):
            raise InputError("start", "none", "a model without latents needs a pose to start from")
        if starts is not None and len({len(start) for start in starts}) > 1:  # one length at a time
            rows = [self._chunk([p], [s], [x], variant, scale) for p, s, x in zip(plans, seeds, starts, strict=True)]
            return [motion for row in rows for motion in row]
        before = 0 if starts is None else len(starts[0])
        steps = before + max(sum(frames for _, frames in plan) for plan in plans)
        noise = normal_noise(seeds, steps, model.latent)
        return self._motions(model, plans, noise, None if starts is None else np.stack(starts), scale)

    @torch.no_grad()
    def _motions(
        self, model: Action2Motion, plans: Sequence[Plan], noise: Tensor, starts: np.ndarray | None, scale: float
    ) -> list[Motion]:
        device, fps = next(model.parameters()).device, self.context.fps
        before = 0 if starts is None else starts.shape[1]
        rows = [_labels(model, plan, before, noise.shape[1]) for plan in plans]
        length = torch.tensor([count for _, count in rows], device=device)
        condition = model.condition(torch.tensor(np.stack([row for row, _ in rows]), device=device), length)
        given = None if starts is None else to_poses(torch.tensor(starts, device=device), fps)
        poses = model.unroll(condition, _Latents(model, condition, noise.to(device), given), given)
        joints = scale * to_joints(poses, fps).cpu().numpy()
        skeleton = scaled(self.context.skeleton, scale)
        return [Motion(row[:count], fps, skeleton) for row, (_, count) in zip(joints, rows, strict=True)]

    def _model(self, variant: str | None, actions: Sequence[str]) -> Action2Motion:
        """The variant of a name, or the usual one that knows all the actions."""
        if variant is not None and variant not in self.models:
            raise InputError("variant", variant, f"must be one of {', '.join(self.variants)}")
        asked = self.models.values() if variant is None else [self.models[variant]]
        for model in asked:
            if set(actions) <= set(model.config.labels):
                return model
        known = dict.fromkeys(name for model in asked for name in model.config.labels)
        unknown = [action for action in actions if action not in known]
        if unknown:
            raise InputError("action", unknown[0], f"must be one of {', '.join(known)}")
        raise InputError("actions", " and ".join(actions), "must be all coarse or all fine")


class _Latents:
    """Latents step by step: of the posterior while poses are given, of the prior after them."""

    def __init__(self, model: Action2Motion, condition: Tensor, noise: Tensor, given: Tensor | None):
        self.model, self.condition, self.noise = model, condition, noise
        self.state: Tensor | None = None
        self.known = 0 if given is None else given.shape[1]
        seen = None if given is None else model.posterior_of(given, condition[:, : self.known])
        self.drawn = None if seen is None else seen.sample(noise[:, : self.known])

    def __call__(self, step: int, read: Tensor) -> Tensor | None:
        """z (B, z) of a step, given the pose before it (B, 1, P)."""
        if self.model.prior is None:
            return None
        here = torch.cat([read, self.condition[:, step : step + 1]], -1)
        parameters, self.state = self.model.prior(here, self.state)
        if self.drawn is not None and step < self.known:
            return self.drawn[:, step]
        return gaussian(parameters[:, 0]).sample(self.noise[:, step])


def _labels(model: Action2Motion, plan: Plan, before: int, steps: int) -> tuple[np.ndarray, int]:
    """(steps,) label ids of a plan, the last one held to the end, and how many of them count; the first action also
    stands over the `before` frames that are given."""
    if not plan or any(frames < 1 for _, frames in plan):
        raise InputError("frames", [frames for _, frames in plan], "each action must have at least 1")
    ids = [model.config.labels.index(action) for action, _ in plan]
    row = np.repeat([ids[0], *ids], [before, *(frames for _, frames in plan)])
    return np.pad(row, (0, steps - len(row)), mode="edge"), len(row)
