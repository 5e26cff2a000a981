"""One clip of the demo corpus: spec, plan, joints and captions from (seed, index)."""

from __future__ import annotations

from typing import Any

import numpy as np

from motionary.corpus.demo.body import DemoRig, rig_of, solve
from motionary.corpus.demo.curves import RATE
from motionary.corpus.demo.grammar import LONGEST, Spec, compose, draw
from motionary.corpus.demo.plan import Plan, sample
from motionary.corpus.demo.sentences import captions
from motionary.errors import InputError
from motionary.motion import Motion, Skeleton


def planned(index: int, seed: int) -> tuple[Spec, Plan, DemoRig, np.random.Generator]:
    """Spec and plan of a clip, and the generator that goes on to its captions."""
    rng = np.random.default_rng([seed, index])
    rig = rig_of(Skeleton.named("smpl22"))
    while True:
        spec = draw(rng)
        plan = compose(spec, rng, rig)
        if plan.seconds <= LONGEST + 1 / RATE:
            return spec, plan, rig, rng


def motion_of(plan: Plan, rig: DemoRig, fps: float) -> Motion:
    """The joints of a plan, the root above the origin at the first frame."""
    motion = solve(rig, sample(plan, fps), fps)
    start = motion.positions[0, 0] * np.array([1, 0, 1], dtype=np.float32)
    return Motion(motion.positions - start, fps, rig.skeleton, motion.rotations)


def make(index: int, seed: int, fps: float) -> tuple[Motion, dict[str, Any]]:
    """See `motionary.corpus.demo.demo_clip`."""
    for name, value in (("index", index), ("seed", seed)):
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 0:
            raise InputError(name, value, "an integer of 0 or more")
    if not 1 <= fps <= 240:
        raise InputError("fps", fps, "between 1 and 240")
    spec, plan, rig, rng = planned(int(index), int(seed))
    truth = {
        "id": f"demo_{index:06d}",
        "captions": captions(spec.acts, spec.style, spec.together, rng),
        "style": spec.style,
        "action": spec.acts[0].action,
        "attributes": {
            **spec.acts[0].attributes(),
            "style": spec.style,
            "together": spec.together,
            "acts": [act.attributes() for act in spec.acts],
        },
    }
    return motion_of(plan, rig, fps), truth
