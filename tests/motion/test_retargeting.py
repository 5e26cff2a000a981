"""Retargeting: the source's directions, the target's bones."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.formats import read_motion
from motionary.motion import Motion, Skeleton, canonicalize, heading, mirror, name_joints, retarget
from motionary.motion.facing import wrap

LIMBS = ("hip", "knee", "ankle", "foot", "shoulder", "elbow", "wrist")


def bones(motion):
    return motion.positions[:, 1:] - motion.positions[:, list(motion.skeleton.parents[1:])]


def renamed(skeleton: Skeleton, joints) -> Skeleton:
    return Skeleton.from_rig("rig", tuple(joints), skeleton.parents, skeleton.offsets)


def test_to_itself_is_the_identity(smpl, wriggling):
    motion = wriggling(smpl)
    np.testing.assert_allclose(retarget(motion, smpl).positions, motion.positions, atol=1e-5)


def test_scaled_bodies_scale(smpl, wriggling):
    motion = canonicalize(wriggling(smpl))
    half = retarget(motion, smpl.with_offsets(smpl.offsets / 2))
    np.testing.assert_allclose(half.positions, motion.positions / 2, atol=1e-5)


def test_bones_take_the_target_lengths_and_keep_their_directions(smpl, wriggling):
    motion = wriggling(smpl)
    target = smpl.with_offsets(smpl.offsets * np.linspace(0.6, 1.4, 22)[:, None])
    result = retarget(motion, target)
    np.testing.assert_allclose(
        np.linalg.norm(bones(result), axis=-1), np.tile(target.bone_lengths[1:], (60, 1)), atol=1e-5
    )
    cosine = (bones(result) * bones(motion)).sum(-1) / target.bone_lengths[1:] / smpl.bone_lengths[1:]
    np.testing.assert_allclose(cosine, 1, atol=1e-5)
    assert result.positions[..., 1].min() == pytest.approx(motion.positions[..., 1].min(), abs=1e-5)


def test_between_smpl_and_kit_limbs_keep_their_directions(smpl, kit, wriggling):
    motion = wriggling(smpl, size=0.3)
    there = retarget(motion, kit)
    back = retarget(there, smpl)
    for side in ("left", "right"):
        for begin, end in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist")):
            for result in (there, back):
                found = [
                    m.positions[:, m.skeleton.roles[f"{side}_{end}"]]
                    - m.positions[:, m.skeleton.roles[f"{side}_{begin}"]]
                    for m in (motion, result)
                ]
                cosine = np.prod([1 / np.linalg.norm(v, axis=-1) for v in found], axis=0) * (found[0] * found[1]).sum(
                    -1
                )
                np.testing.assert_allclose(cosine, 1, atol=1e-5)
    np.testing.assert_allclose(wrap(heading(there) - heading(motion)), 0, atol=0.3)
    assert np.linalg.norm(back.positions - motion.positions, axis=-1).mean() < 0.1


def test_missing_joints_take_the_shape_of_the_rest_pose(smpl, t_pose):
    """A source without collars, spine1, toes and neck, at rest: the target's own rest pose fills them in."""
    absent = {"left_collar", "right_collar", "spine1", "left_foot", "right_foot", "neck"}
    mapping = {name: name for name in smpl.joints if name not in absent}
    motion = Motion(np.tile(t_pose, (3, 1, 1)), 20, renamed(smpl, (*smpl.joints[:-1], "right_hand")))
    mapping["right_wrist"] = "right_hand"
    result = retarget(motion, smpl, mapping)
    np.testing.assert_allclose(result.positions - result.positions[:, :1], np.tile(t_pose, (3, 1, 1)), atol=1e-5)


def test_coincident_joints_are_filled_in(smpl, t_pose):
    squeezed = t_pose.copy()
    for name, onto in (("spine1", "pelvis"), ("left_collar", "spine3"), ("right_collar", "spine3")):
        squeezed[smpl.joints.index(name)] = squeezed[smpl.joints.index(onto)]
    result = retarget(Motion(np.tile(squeezed, (3, 1, 1)), 20, smpl), smpl)
    np.testing.assert_allclose(result.positions, np.tile(t_pose, (3, 1, 1)), atol=1e-5)


def test_a_rig_without_known_names_needs_a_mapping(smpl, wriggling):
    """Where neither names nor the tree tell: here the two legs are no twins."""
    motion = wriggling(smpl)
    uneven = smpl.offsets.copy()
    uneven[smpl.joints.index("left_knee")] *= 2
    strange = renamed(smpl, [f"bone_{i}" for i in range(22)]).with_offsets(uneven)
    with pytest.raises(InputError, match="left_knee"):
        retarget(Motion(motion.positions, 20, strange), smpl)
    with pytest.raises(InputError, match="left_knee"):
        retarget(motion, strange.with_offsets(uneven * 2))
    mapping = dict(zip(smpl.joints, strange.joints, strict=True))
    result = retarget(Motion(motion.positions, 20, strange), smpl, mapping)
    np.testing.assert_allclose(result.positions, motion.positions, atol=1e-5)


def test_a_mapping_adds_to_what_names_tell_and_wins_over_it(smpl, wriggling):
    """Two joints of a known rig are called otherwise, and one bears the name of another's role."""
    names = list(smpl.joints)
    elbow, hand, head = (names.index(role) for role in ("left_elbow", "left_wrist", "head"))
    names[elbow], names[hand], names[head] = "hinge", "left_elbow", "skull"
    known = wriggling(smpl)
    motion = Motion(known.positions, 20, renamed(smpl, names))
    mapping = {"left_elbow": "hinge", "left_wrist": "left_elbow"}
    found = name_joints(motion, mapping).skeleton
    assert found.joints[elbow] == "left_elbow"
    assert found.joints[hand] == "left_wrist"
    assert found.joints[head] == "head"  # the tree tells
    assert found.feet == smpl.feet
    np.testing.assert_allclose(retarget(motion, smpl, mapping).positions, known.positions, atol=1e-5)


@pytest.mark.parametrize("frames", [1, 5])
def test_degenerate_bodies_stay_finite(smpl, kit, t_pose, frames):
    flicker = np.tile(t_pose, (frames, 1, 1))
    flicker[1::2] = 0
    for positions in (np.zeros((frames, 22, 3)), flicker, np.tile(-t_pose, (frames, 1, 1))):
        for target in (smpl, kit):
            result = retarget(Motion(positions, 20, smpl), target)
            assert np.isfinite(result.positions).all()
            lengths = np.linalg.norm(bones(result), axis=-1)
            np.testing.assert_allclose(lengths, np.tile(target.bone_lengths[1:], (frames, 1)), atol=1e-5)


@pytest.mark.real
def test_real_clips_of_every_source_reach_both_skeletons(shared_data, smpl, kit):
    for folder in ("captioned", "styled", "actions"):
        for path in sorted((shared_data / folder / "motions").glob("*.npy"))[::60]:
            motion = Motion(np.load(path), 20, smpl)
            for target in (smpl, kit):
                result = retarget(motion, target)
                lengths = np.linalg.norm(bones(result), axis=-1)
                np.testing.assert_allclose(lengths, np.tile(target.bone_lengths[1:], (motion.frames, 1)), atol=1e-4)
                assert np.linalg.norm(result.positions[:, 0] - motion.positions[:, 0], axis=-1).max() < 1.5


@pytest.mark.real
@pytest.mark.parametrize("rig", ["cmu_05", "cmu_49", "cc_02", "cc_06", "daz", "bandai_dataset-1", "bandai_dataset-2"])
def test_real_rigs_reach_smpl(shared_data, smpl, rig):
    """Limbs of each rig's BVH keep their directions, feet stay on the floor, and its mirror holds together."""
    path = sorted((shared_data / "bvh" / "motions").glob(f"{rig}*.bvh"))[0]
    motion = read_motion(path)
    result = retarget(motion, smpl)
    roles = motion.skeleton.roles
    for side in ("left", "right"):
        for begin, end in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist")):
            bone = motion.positions[:, roles[f"{side}_{end}"]] - motion.positions[:, roles[f"{side}_{begin}"]]
            found = (
                result.positions[:, smpl.roles[f"{side}_{end}"]] - result.positions[:, smpl.roles[f"{side}_{begin}"]]
            )
            cosine = (bone * found).sum(-1) / np.linalg.norm(bone, axis=-1) / np.linalg.norm(found, axis=-1)
            np.testing.assert_allclose(cosine, 1, atol=1e-4)
    heights = canonicalize(result).positions[..., 1]
    assert 0.8 < np.median(heights[:, smpl.roles["head"]]) < 1.7
    assert np.median(heights[:, list(smpl.feet)].min(axis=1)) < 0.25
    twice = mirror(mirror(motion))
    np.testing.assert_allclose(twice.positions, motion.positions, atol=1e-6)
