"""A rig that lacks a joint that others have can still be drawn, viewed and exported."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.formats import read_motion, write_motion
from motionary.formats.render.figure import limbs
from motionary.formats.render.video import render_frame
from motionary.motion import Motion, Skeleton


def _without(motion: Motion, *roles: str) -> Motion:
    """The motion without these joints; what hangs on them hangs on their parents."""
    skeleton = motion.skeleton
    kept = [j for j, joint in enumerate(skeleton.joints) if joint not in roles]
    parents = []
    for joint in kept:
        above = skeleton.parents[joint]
        while above >= 0 and above not in kept:
            above = skeleton.parents[above]
        parents.append(kept.index(above) if above >= 0 else -1)
    rest = skeleton.rest[kept]
    offsets = rest - np.where(np.array(parents)[:, None] >= 0, rest[parents], rest)
    joints = [skeleton.joints[j] for j in kept]
    return Motion(motion.positions[:, kept], motion.fps, Skeleton.from_rig("part", joints, parents, offsets))


ALL = ("knee", "ankle", "foot", "wrist", "elbow", "shoulder", "hip")


@pytest.mark.parametrize("roles", [*[(f"left_{part}",) for part in ALL], ("head", "neck")])
def test_it_is_drawn_and_written(person, tmp_path, roles):
    motion = _without(person, *roles)
    for extension in ("html", "glb", "bvh", "npz"):
        assert write_motion(motion, tmp_path / f"a.{extension}").stat().st_size > 500
    assert read_motion(tmp_path / "a.npz").skeleton.joints == motion.skeleton.joints
    picture = render_frame(motion, width=96, height=96)
    assert (picture.std(axis=(0, 1)) > 5).all()  # a figure, not one colour


def test_thickness_follows_what_legs_there_are(person):
    """Without a shin the others tell how thick limbs are: the same within a third."""
    whole, part = (max(limb.radii[0] for limb in limbs(m.skeleton)) for m in (person, _without(person, "left_ankle")))
    assert part == pytest.approx(whole, rel=1 / 3)


def test_no_leg_at_all(person):
    legs = [f"{side}_{part}" for side in ("left", "right") for part in ("hip", "knee", "ankle", "foot")]
    motion = _without(person, *legs)
    assert len(limbs(motion.skeleton)) >= len(motion.skeleton) - 1
    assert np.isfinite([limb.radii for limb in limbs(motion.skeleton)]).all()
