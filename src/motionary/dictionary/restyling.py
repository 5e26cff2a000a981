"""Stylization of whole motions: what :meth:`motionary.dictionary.Dictionary.stylize` asks of a trained pipeline."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from motionary.corpus.encoding import as_motion, encode, one
from motionary.errors import MOST_ASKED, STRONGEST, InputError, check_whole
from motionary.motion import Motion, fit_rotations, resample
from motionary.motion.rigging import Rig, to_rig
from motionary.systems.protocols import Made, MotionStylizer


def stylize(
    transfer: MotionStylizer,
    motions: Sequence[Motion],
    style: str | None,
    reference: Motion | None,
    n: int,
    seed: int,
    strength: float,
) -> list[list[Motion]]:
    """n variants of every motion; see the dictionary's method."""
    check_whole("n", n, 1, MOST_ASKED)
    check_whole("seed", seed, 0)
    number = isinstance(strength, int | float) and not isinstance(strength, bool)
    if not number or not 0 <= strength <= STRONGEST:
        raise InputError("strength", strength, f"must be a number from 0 to {STRONGEST}")
    if reference is not None and n > 1:
        raise InputError("n", n, "a reference gives one motion; variants come from a style or from nothing at all")
    contents = [encode(motion, transfer.context, whole=True) for motion in motions]
    repeated = [content for content in contents for _ in range(n)]
    given: dict[str, Any] = {"setting": "unsupervised"}
    if style is not None:
        given = {"setting": "supervised", "labels": [label_of(transfer, style)] * len(repeated)}
    if reference is not None:
        given["references"] = [_reference(transfer, reference)] * len(repeated)
    seeds = [_seed(seed, k) for k in range(n)] * len(contents)
    made = _motions(transfer, transfer.stylize(repeated, seeds=seeds, strength=strength, **given))
    return [made[i : i + n] for i in range(0, len(made), n)]


def returned(made: Motion, original: Motion) -> Motion:
    """A motion of the models on the rig and at the rate of the one that it was made from.

    Raises:
        InputError: no pose is known in which the original's rig stands.
    """
    return resample(to_rig(made, Rig.of(original.skeleton, original.rotations)), original.fps)


def interpolate(
    transfer: MotionStylizer, motion: Motion, first: str | Motion, second: str | Motion, steps: int, seed: int
) -> list[Motion]:
    """The motion in `steps` styles from the first to the second; see the dictionary's method."""
    import torch

    from motionary.nn.noise import normal_noise

    check_whole("steps", steps, 2, MOST_ASKED)
    check_whole("seed", seed, 0)
    ends = (first, second)
    if all(isinstance(end, str) for end in ends):
        setting, labels = "supervised", [label_of(transfer, str(end)) for end in ends]
        codes = normal_noise([_seed(seed, 0)] * 2, 1, transfer.model(setting).config.style_dim)[:, 0]
    elif all(isinstance(end, Motion) for end in ends):
        setting, labels = "unsupervised", None
        references = [_reference(transfer, end) for end in ends if isinstance(end, Motion)]
        codes = torch.from_numpy(transfer.style_codes(references, setting=setting))
    else:
        raise InputError("first, second", f"{first!r}, {second!r}"[:80], "must be two styles or two motions")
    style = transfer.style(codes, labels, setting)
    share = torch.linspace(0, 1, steps, device=style.device)[:, None]
    content = encode(motion, transfer.context, whole=True)
    mixed = (1 - share) * style[:1] + share * style[1:]
    return _motions(transfer, transfer.generate([content] * steps, mixed, setting=setting))


def label_of(transfer: MotionStylizer, style: str) -> int:
    """Id of a style's name; InputError lists the known ones, or says that there are none."""
    transfer.model("supervised")
    if not isinstance(style, str) or style not in transfer.styles:
        raise InputError("style", style, f"must be one of {', '.join(transfer.styles)}")
    return transfer.styles.index(style)


def _reference(transfer: MotionStylizer, reference: Motion) -> np.ndarray:
    motion = one(reference, Motion, "reference")
    return encode(motion, transfer.context, whole=True)


def _motions(transfer: MotionStylizer, made: Sequence[Made]) -> list[Motion]:
    return [fit_rotations(as_motion(features, transfer.context)) for features in made]


def _seed(seed: int, variant: int) -> int:
    return int(np.random.SeedSequence([seed, variant]).generate_state(1)[0])
