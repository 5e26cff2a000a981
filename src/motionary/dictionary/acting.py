"""Motions of action labels: what :meth:`motionary.dictionary.Dictionary.act` asks of a trained pipeline."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from motionary.corpus.encoding import as_joints, frames_of, listed, one, planted
from motionary.errors import MOST_ASKED, InputError, check_whole
from motionary.motion import Motion
from motionary.systems.action_protocols import ActionToMotion


def act(
    actor: ActionToMotion,
    action: str | Sequence[str],
    n: int,
    seconds: float | Sequence[float],
    seed: int,
    scale: float,
    start: Motion | None,
    feet: bool,
) -> list[Motion]:
    """n motions of one plan; see the dictionary's method."""
    check_whole("n", n, 1, MOST_ASKED)
    check_whole("seed", seed, 0)
    actions = listed(action, str, "action")
    lengths: list[Any] = list(seconds) if isinstance(seconds, list | tuple) else [seconds] * len(actions)
    if len(lengths) != len(actions):
        raise InputError("seconds", len(lengths), f"must be one number, or one for each of {len(actions)} actions")
    plan = [(name, frames_of(length, actor.context)) for name, length in zip(actions, lengths, strict=True)]
    starts = None
    if start is not None:
        given = one(start, Motion, "start")
        starts = [as_joints(given, actor.context)] * n
    seeds = [int(np.random.SeedSequence([seed, k]).generate_state(1)[0]) for k in range(n)]
    first_frame = 0 if starts is None else len(starts[0])
    return planted(actor.act([plan] * n, seeds, starts=starts, scale=scale), feet, first_frame)


def between(
    actor: ActionToMotion, action: str, steps: int, seconds: float, seeds: tuple[int, int], scale: float
) -> list[Motion]:
    """Motions whose first latents lie between those of two seeds; see the dictionary's method."""
    check_whole("steps", steps, 2, MOST_ASKED)
    name = one(action, str, "action")
    if not isinstance(seeds, list | tuple) or len(seeds) != 2:
        raise InputError("seeds", seeds, "must be two")
    for seed in seeds:
        check_whole("seeds", seed, 0)
    ends = [int(np.random.SeedSequence([seed, 0]).generate_state(1)[0]) for seed in seeds]
    return actor.between(name, frames_of(seconds, actor.context), (ends[0], ends[1]), steps, scale)
