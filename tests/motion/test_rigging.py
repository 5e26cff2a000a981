"""Onto rigs with other rest poses, axes, names and proportions, and back."""

from __future__ import annotations

import numpy as np
import pytest

import motionary
from motionary.corpus.demo import demo_clips
from motionary.errors import InputError
from motionary.formats import read_motion
from motionary.formats.rig_files import read_rig
from motionary.metrics import foot_skating
from motionary.motion import Motion, Skeleton, fit_rotations, forward_kinematics
from motionary.motion.rigging import Rig, to_rig
from motionary.motion.rotations import euler_to_rotmat, vectors_to_rotmat

MIXAMO = {
    **{"pelvis": "Hips", "spine1": "Spine", "spine2": "Spine1", "spine3": "Spine2", "neck": "Neck", "head": "Head"},
    **{f"{s}_{r}": f"{s.title()}{n}" for s in ("left", "right") for r, n in {
        "hip": "UpLeg", "knee": "Leg", "ankle": "Foot", "foot": "ToeBase", "collar": "Shoulder", "shoulder": "Arm",
        "elbow": "ForeArm", "wrist": "Hand"}.items()},
}  # fmt: skip
SIDES = (("left", 1), ("right", -1))


def baked(skeleton: Skeleton, turns: dict[str, np.ndarray]) -> Skeleton:
    """The same body, its rest pose being that which local rotations (3, 3) of some joints make."""
    turned = np.tile(np.eye(3), (len(skeleton), 1, 1))
    offsets = skeleton.offsets.astype(np.float64).copy()
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            offsets[joint] = turned[parent] @ offsets[joint]
            turned[joint] = turned[parent]
        turned[joint] = turned[joint] @ turns.get(skeleton.joints[joint], np.eye(3))
    return skeleton.with_offsets(offsets)


def along_x(skeleton: Skeleton) -> Rig:
    """Axes as animation programs give joints: x along the bone to the first child, in every joint."""
    axes = []
    for joint in range(len(skeleton)):
        child = next((j for j, parent in enumerate(skeleton.parents) if parent == joint), None)
        bone = skeleton.offsets[joint if child is None else child].astype(np.float64)
        axes.append(vectors_to_rotmat(np.array([[1.0, 0, 0]]), bone[None])[0])
    offsets, pose = np.zeros((len(skeleton), 3)), np.array(axes)
    for joint, parent in enumerate(skeleton.parents[1:], 1):
        offsets[joint] = axes[parent].T @ skeleton.offsets[joint]
        pose[joint] = axes[parent].T @ axes[joint]
    return Rig.posed(Skeleton.from_rig("along x", skeleton.joints, skeleton.parents, offsets), pose)


def renamed(skeleton: Skeleton, names) -> Skeleton:
    return Skeleton.from_rig("rig", names, skeleton.parents, skeleton.offsets)


def with_fingers(skeleton: Skeleton) -> Skeleton:
    names, parents, offsets = list(skeleton.joints), list(skeleton.parents), list(skeleton.offsets)
    for side, sign in SIDES:
        hand = names.index(MIXAMO[f"{side}_wrist"])
        for k in range(3):
            names.append(f"{side.title()}HandIndex{k + 1}")
            parents.append(hand if k == 0 else len(names) - 2)
            offsets.append(np.array([sign * 0.04, 0, 0.01]))
    return Skeleton.from_rig("fingers", names, parents, np.array(offsets))


def rigs() -> dict[str, Rig]:
    smpl = Skeleton.named("smpl22")
    arms = {f"{s}_shoulder": euler_to_rotmat(2, -sign * np.radians(50)) for s, sign in SIDES}
    hanging = {f"{s}_shoulder": euler_to_rotmat(2, -sign * np.radians(80)) for s, sign in SIDES}
    legs = {f"{s}_hip": euler_to_rotmat(2, sign * np.radians(20)) for s, sign in SIDES}
    legs |= {f"{s}_ankle": euler_to_rotmat(2, -sign * np.radians(20)) for s, sign in SIDES}
    bent = {f"{s}_elbow": euler_to_rotmat(1, -sign * np.radians(25)) for s, sign in SIDES}
    rng = np.random.default_rng(0)
    factors = {part: rng.uniform(0.85, 1.2) for part in sorted({joint.split("_")[-1] for joint in smpl.joints})}
    longer = smpl.with_offsets(smpl.offsets * np.array([[factors[joint.split("_")[-1]]] for joint in smpl.joints]))
    wide = smpl.offsets.copy()
    wide[[1, 2, 13, 14]] *= [1.3, 1, 1]
    mixamo = [f"mixamorig:{MIXAMO[joint]}" for joint in smpl.joints]
    rest = {
        "T": smpl,
        "A": baked(smpl, arms),
        "arms hang": baked(smpl, hanging),
        "legs apart": baked(smpl, legs | arms),
        "elbows bent": baked(smpl, arms | bent),
        "a child": smpl.with_offsets(smpl.offsets * 0.6),
        "wide hips": smpl.with_offsets(wide),
        "mixamo": renamed(longer, mixamo),
        "fingers": with_fingers(renamed(smpl, [MIXAMO[joint] for joint in smpl.joints])),
    }
    return {name: Rig.of(skeleton) for name, skeleton in rest.items()} | {
        "along x": along_x(smpl),
        "along x, A": along_x(baked(smpl, arms)),
    }


RIGS = rigs()


@pytest.fixture(scope="module")
def people() -> list[Motion]:
    return [fit_rotations(motion) for motion, _ in demo_clips(4)]


def degrees(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.degrees(2 * np.arccos(np.clip(np.abs((a.astype(np.float64) * b).sum(-1)), 0, 1)))


def there_and_back(motion: Motion, rig: Rig) -> tuple[Motion, np.ndarray, np.ndarray]:
    """The motion on the rig; after the way back, degrees of each joint (T, J) and metres of each foot joint (T, 4)."""
    there = to_rig(motion, rig)
    back = to_rig(there, Rig.of(motion.skeleton, motion.rotations), rig)
    feet = list(motion.skeleton.feet)
    missed = np.linalg.norm(back.positions[:, feet] - motion.positions[:, feet], axis=-1)
    return there, degrees(back.rotations, motion.rotations), missed


@pytest.mark.parametrize("name", RIGS)
def test_a_round_trip_keeps_joint_angles_and_feet(people, name):
    for motion in people:
        there, angles, feet = there_and_back(motion, RIGS[name])
        assert there.skeleton == RIGS[name].skeleton
        assert angles.mean() < 0.7
        assert np.percentile(angles, 95) < 2
        assert np.percentile(feet, 95) < 0.02


@pytest.mark.parametrize("name", RIGS)
def test_limbs_point_where_the_source_s_do_and_feet_stand(people, planted, name):
    for motion in people:
        there = to_rig(motion, RIGS[name])
        for side in ("left", "right"):
            for begin, end in (("shoulder", "elbow"), ("elbow", "wrist")):
                bones = [
                    m.positions[:, m.skeleton.roles[f"{side}_{end}"]]
                    - m.positions[:, m.skeleton.roles[f"{side}_{begin}"]]
                    for m in (motion, there)
                ]
                cosine = (bones[0] * bones[1]).sum(-1) / np.prod([np.linalg.norm(b, axis=-1) for b in bones], axis=0)
                assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 1
        assert foot_skating(there, contacts=planted(motion)) <= 1.2 * foot_skating(motion) + 0.002
        placed = forward_kinematics(there.skeleton, there.rotations, there.positions[:, 0])
        np.testing.assert_allclose(placed, there.positions, atol=1e-5)


def test_twist_is_carried_over(smpl):
    """A forearm that turns about itself moves no joint, and still turns on the target, whatever its rest pose."""
    rotations = np.zeros((20, 22, 4))
    rotations[..., 3] = 1
    half = np.linspace(0, 1, 20) / 2
    wrist = smpl.roles["left_wrist"]
    rotations[:, wrist] = np.stack([np.sin(half), 0 * half, 0 * half, np.cos(half)], -1)
    root = np.tile([0, 0.95, 0], (20, 1))
    motion = Motion(forward_kinematics(smpl, rotations, root), 20, smpl, rotations)
    for name in ("A", "along x", "arms hang"):
        there = to_rig(motion, RIGS[name])
        turned = degrees(there.rotations[:, wrist], there.rotations[:1, wrist])
        np.testing.assert_allclose(turned, np.degrees(2 * half), atol=0.1)


def test_fingers_stay_at_rest_and_the_rig_keeps_its_joints(people):
    rig = RIGS["fingers"]
    there = people[0].to(rig.skeleton)
    assert there.skeleton.joints == rig.skeleton.joints
    np.testing.assert_allclose(np.abs(there.rotations[:, 22:, 3]), 1, atol=1e-6)


def test_a_motion_of_positions_alone_goes_onto_a_rig(people):
    bare = Motion(people[0].positions, people[0].fps, people[0].skeleton)
    there = bare.to(RIGS["A"].skeleton)
    known = people[0].to(RIGS["A"].skeleton)
    assert np.linalg.norm(there.positions - known.positions, axis=-1).mean() < 0.01


def test_a_rest_pose_that_stands_nowhere_needs_its_motion(people):
    with pytest.raises(InputError, match="rest pose"):
        people[0].to(RIGS["along x"].skeleton)
    with pytest.raises(InputError, match=r"\.bvh or \.glb"):
        people[0].to("character.fbx")
    there = to_rig(people[0], RIGS["along x"])
    again = people[1].to(there)  # whose frames show how the rig stands
    assert again.skeleton == there.skeleton


@pytest.mark.real
@pytest.mark.parametrize(
    "file",
    [
        "cc_02_01",
        "cmu_05_01",
        "daz_salsa_10",
        "bandai_dataset-2_walk_active_003",
        "bandai_dataset-1_run_not-confident_001",
    ],
)
def test_round_trips_over_real_rigs(shared_data, people, file):
    path = shared_data / "bvh" / "motions" / f"{file}.bvh"
    rig = read_rig(path)
    for motion in people[:2]:
        _, angles, feet = there_and_back(motion, rig)
        assert np.percentile(angles, 95) < 0.5
        assert np.percentile(feet, 95) < 0.02
    own = motionary.motion.resample(read_motion(path), 20)
    there = own.to(Skeleton.named("smpl22"))
    back = to_rig(there, Rig.of(own.skeleton, own.rotations))
    roles = list(own.skeleton.roles.values())
    assert degrees(back.rotations, own.rotations)[:, roles].mean() < 2
    feet = list(own.skeleton.feet)
    assert np.percentile(np.linalg.norm((back.positions - own.positions)[:, feet], axis=-1), 95) < 0.02


@pytest.mark.real
def test_feet_of_real_clips_go_on_standing_on_a_rig(shared_data, smpl, planted):
    """By the contacts that the metric finds anew on the rig: those that are lower there drag; all clips together."""
    rig = read_rig(shared_data / "bvh" / "motions" / "cc_02_01.bvh")
    found = []
    for path in sorted((shared_data / "styled" / "motions").glob("*.npy"))[7::120]:
        motion = Motion(np.load(path), 20, smpl)
        there = to_rig(motion, rig)
        found.append(
            [foot_skating(m, contacts=c) for m, c in ((motion, None), (there, None), (there, planted(motion)))]
        )
    before, after, same = np.array(found).T
    assert len(before) > 20
    assert (after <= 1.2 * before + 0.003).all()
    assert after.mean() <= before.mean()
    assert same.mean() <= 1.2 * before.mean()
