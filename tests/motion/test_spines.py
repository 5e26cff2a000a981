"""Bends of the spine reach other bodies at their height, however many joints either spine has."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.motion import Motion, Skeleton, forward_kinematics, retarget

NECK = 0.52  # metres above the pelvis
ARM = (("Shoulder", (0.03, 0, 0)), ("Arm", (0.15, 0, 0)), ("ForeArm", (0.28, 0, 0)), ("Hand", (0.26, 0, 0)))
LEG = (("UpLeg", (0.09, -0.02, 0)), ("Leg", (0, -0.42, 0)), ("Foot", (0, -0.41, 0)), ("ToeBase", (0, -0.07, 0.14)))
CUTS = {"even": (0.1, 0.32), "low": (0.05, 0.25), "high": (0.12, 0.4)}  # heights of the lowest and highest joint


def heights(joints: int, cut: str) -> np.ndarray:
    return np.linspace(*CUTS[cut], joints) if joints > 1 else np.array(CUTS[cut][:1])


def person(spine: np.ndarray, beside: bool = False) -> Skeleton:
    """A straight body whose spine has joints at these heights, on the pelvis or `beside` it, on a root at the feet."""
    names, parents, offsets = ["Hips"], [-1], [np.zeros(3)]
    if beside:
        names, parents, offsets = ["Root", "Hips"], [-1, 0], [np.zeros(3), np.array([0, 0.9, 0])]

    def add(name: str, parent: int, offset) -> int:
        names.append(name)
        parents.append(parent)
        offsets.append(np.array(offset, float))
        return len(names) - 1

    pelvis = names.index("Hips")
    top, height = (0, -0.9) if beside else (pelvis, 0.0)
    for k, joint in enumerate(spine):
        top, height = add(f"Spine{k or ''}", top, (0, joint - height, 0)), joint
    add("Head", add("Neck", top, (0, NECK - height, 0)), (0, 0.11, 0.02))
    for side, sign in (("Left", 1), ("Right", -1)):
        for limb, joint in ((LEG, pelvis), (ARM, top)):
            for part, offset in limb:
                up = NECK - 0.04 - height if part == "Shoulder" else 0
                joint = add(side + part, joint, np.array(offset) * [sign, 1, 1] + [0, up, 0])
    return Skeleton.from_rig("person", names, parents, np.array(offsets))


def bow(skeleton: Skeleton, degrees: dict[str, float]) -> Motion:
    """Stands, then bends ahead at some joints, within 14 frames."""
    rotations = np.tile([0, 0, 0, 1.0], (14, len(skeleton), 1))
    for joint, angle in degrees.items():
        half = np.radians(np.linspace(0, angle, 14)) / 2
        rotations[:, skeleton.joints.index(joint), 0] = np.sin(half)
        rotations[:, skeleton.joints.index(joint), 3] = np.cos(half)
    return Motion(forward_kinematics(skeleton, rotations, np.zeros((14, 3))), 10, skeleton)


def lean(motion: Motion) -> float:
    """How far the line from pelvis to neck leans ahead in the last frame, in degrees."""
    roles = motion.skeleton.roles
    line = motion.positions[-1, roles["neck"]] - motion.positions[-1, roles["pelvis"]]
    return float(np.degrees(np.arctan2(line[2], line[1])))


def leaning(height: float, degrees: float) -> float:
    """The lean of a straight body that bends at one height."""
    angle = np.radians(degrees)
    above = NECK - height
    return float(np.degrees(np.arctan2(above * np.sin(angle), height + above * np.cos(angle))))


@pytest.mark.parametrize("cut", CUTS)
@pytest.mark.parametrize(("joints", "bent"), [(n, k) for n in range(1, 7) for k in range(n)])
def test_the_body_leans_as_the_source_does(smpl, kit, joints, bent, cut):
    spine = heights(joints, cut)
    for degrees in (60, -40):
        motion = bow(person(spine), {f"Spine{bent or ''}": degrees})
        expected = leaning(spine[bent], degrees)
        assert lean(motion) == pytest.approx(expected, abs=1e-3)
        for target in (smpl, kit):
            assert lean(retarget(motion, target)) == pytest.approx(expected, abs=3)


@pytest.mark.parametrize("onto", range(1, 7))
@pytest.mark.parametrize("joints", [1, 3, 6])
def test_spines_of_any_number_of_joints_take_any_other(joints, onto):
    target = person(heights(onto, "even"))
    for bent, height in enumerate(heights(joints, "high")):
        motion = bow(person(heights(joints, "high")), {f"Spine{bent or ''}": 60})
        assert lean(retarget(motion, target)) == pytest.approx(leaning(height, 60), abs=3)


def test_a_bend_spread_over_the_spine(smpl):
    motion = bow(person(heights(4, "even")), {f"Spine{k or ''}": 20 for k in range(4)})
    assert lean(retarget(motion, smpl)) == pytest.approx(lean(motion), abs=3)


@pytest.mark.parametrize("bent", range(4))
def test_a_spine_that_hangs_beside_the_pelvis(smpl, bent):
    """What both hang on, here between the feet, is no part of the spine."""
    spine = heights(4, "even")
    motion = bow(person(spine, beside=True), {f"Spine{bent or ''}": 60})
    assert lean(retarget(motion, smpl)) == pytest.approx(leaning(spine[bent], 60), abs=3)
    # As a target it hangs on what retargeting cannot cut, and is still reached.
    assert np.isfinite(retarget(bow(person(spine), {"Spine1": 60}), motion.skeleton).positions).all()


@pytest.mark.parametrize("bent", range(4))
def test_a_rest_pose_with_all_bones_along_one_axis(smpl, bent):
    lengths = np.linalg.norm(smpl.offsets, axis=-1)
    target = smpl.with_offsets(lengths[:, None] * np.array([0, 1.0, 0]))
    spine = heights(4, "even")
    motion = bow(person(spine), {f"Spine{bent or ''}": 60})
    assert lean(retarget(motion, target)) == pytest.approx(leaning(spine[bent], 60), abs=3)


def test_the_chest_turns_as_the_source_does(smpl):
    """Collars follow the joint that bears the arms, wherever the target's own spine is cut."""
    motion = bow(person(heights(4, "high")), {"Spine3": 60})
    result = retarget(motion, smpl)
    collar = (
        result.positions[[0, -1], smpl.roles["left_collar"], 1:] - result.positions[[0, -1], smpl.roles["spine3"], 1:]
    )
    across = collar[0, 0] * collar[1, 1] - collar[0, 1] * collar[1, 0]
    assert np.degrees(np.arctan2(across, collar[0] @ collar[1])) == pytest.approx(60, abs=3)


@pytest.mark.parametrize("gone", [{"neck"}, {"spine1", "spine2", "spine3", "neck", "head"}])
def test_rigs_without_a_neck_or_a_spine(smpl, kit, gone):
    """Where the line is not known, spines come by roles."""
    source = bow(person(heights(3, "even")), {"Spine1": 60})
    kept = [j for j, role in enumerate(smpl.joints) if role not in gone]
    chosen = Motion(retarget(source, smpl).positions, 10, smpl)
    parents = []
    for j in kept:
        above = smpl.parents[j]
        while above >= 0 and above not in kept:
            above = smpl.parents[above]
        parents.append(kept.index(above) if above >= 0 else -1)
    offsets = smpl.rest[kept] - np.where(np.array(parents)[:, None] < 0, 0, smpl.rest[kept][parents])
    rig = Skeleton.from_rig("rig", [smpl.joints[j] for j in kept], parents, offsets)
    assert not gone & rig.roles.keys()
    assert np.isfinite(retarget(source, rig).positions).all()
    assert np.isfinite(retarget(Motion(chosen.positions[:, kept], 10, rig), kit).positions).all()
