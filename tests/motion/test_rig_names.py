"""Which joint plays which role, by the names that many programs give them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest

from motionary.motion.rigs import LIMBS, REQUIRED, find_roles

CENTER = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")
# Names of pelvis, three of the spine, neck and head; of the eight joints of a limb pair in the order of LIMBS, with the
# side in the place of *; and the words for left and right.
NAMES = {
    "mixamo": (
        "Hips Spine Spine1 Spine2 Neck Head",
        "*UpLeg *Leg *Foot *ToeBase *Shoulder *Arm *ForeArm *Hand",
        "Left Right",
    ),
    "xsens": (
        "Hips Chest Chest2 Chest4 Neck Head",
        "*Hip *Knee *Ankle *Toe *Collar *Shoulder *Elbow *Wrist",
        "Left Right",
    ),
    "unreal": (
        "pelvis spine_01 spine_02 spine_03 neck_01 head",
        "thigh_* calf_* foot_* ball_* clavicle_* upperarm_* lowerarm_* hand_*",
        "l r",
    ),
    "unity": (
        "Hips Spine Chest UpperChest Neck Head",
        "*UpperLeg *LowerLeg *Foot *Toes *Shoulder *UpperArm *LowerArm *Hand",
        "Left Right",
    ),
    "vroid": (
        "C_Hips C_Spine C_Chest C_UpperChest C_Neck C_Head",
        "*_UpperLeg *_LowerLeg *_Foot *_ToeBase *_Shoulder *_UpperArm *_LowerArm *_Hand",
        "L R",
    ),
    "rigify": (
        "spine spine.001 spine.002 spine.003 spine.004 spine.006",
        "thigh.* shin.* foot.* toe.* shoulder.* upper_arm.* forearm.* hand.*",
        "L R",
    ),
    "mocopi": (
        "root torso_1 torso_4 torso_7 neck_1 head",
        "*_up_leg *_low_leg *_foot *_toes *_shoulder *_up_arm *_low_arm *_hand",
        "l r",
    ),
    "mmd": ("下半身 上半身 首飾り 上半身2 首 頭", "*足 *ひざ *足首 *つま先 *肩 *腕 *ひじ *手首", "左 右"),
}
ROLES = [*CENTER, *(f"{side}_{part}" for part in LIMBS for side in ("left", "right"))]


def names_of(rig: str) -> dict[str, str]:
    """A joint's name by role."""
    center, limbs, sides = (text.split() for text in NAMES[rig])
    found = dict(zip(CENTER, center, strict=True))
    for part, name in zip(LIMBS, limbs, strict=True):
        for side, word in zip(("left", "right"), sides, strict=True):
            found[f"{side}_{part}"] = name.replace("*", word)
    return found


@pytest.mark.parametrize(
    "affixes", [("", ""), ("Character1_", ""), ("ns:rig:", ""), ("Bip01 ", ""), ("", "_JNT"), ("DEF-", "")]
)
@pytest.mark.parametrize("rig", NAMES)
def test_names_of_many_programs_with_any_prefix(rig, affixes):
    """Every role is found, whatever stands before or after all names, and in any case."""
    names = names_of(rig)
    for change in (str, str.upper):
        joints = tuple(change(f"{affixes[0]}{names[role]}{affixes[1]}") for role in ROLES)
        found = find_roles(joints)
        assert {role: ROLES[joint] for role, joint in found.items() if role != "spine2"} == {
            role: role for role in ROLES if role != "spine2"
        }


# By program the name of the pelvis; of the required joints of the limbs, with the side in the place of *; the words for
# left and right; and others, among them what other rigs call by a name of these.
TABLE = """
old_rigify = hips; thigh.*, shin.*, foot.*, upper_arm.*, forearm.*, hand.*; L R; spine, chest, neck, head, shoulder.*,
    toe.*
rigify_generated = DEF-spine; DEF-thigh.*, DEF-shin.*, DEF-foot.*, DEF-upper_arm.*, DEF-forearm.*, DEF-hand.*; L R;
    root, torso, hips, chest, neck, head, shoulder.*, hand_ik.*, foot_ik.*, thigh_fk.*, MCH-spine, DEF-pelvis.*,
    DEF-spine.001, DEF-spine.002, DEF-spine.003, DEF-shoulder.*, DEF-thigh.*.001, DEF-upper_arm.*.001
auto_rig_pro = root.x; thigh_stretch.*, leg_stretch.*, foot.*, arm_stretch.*, forearm_stretch.*, hand.*; l r;
    c_root_master.x, spine_01.x, spine_02.x, neck.x, head.x, shoulder.*, thigh_twist.*, arm_twist.*, toes_01.*
advanced_skeleton = Root_M; Hip_*, Knee_*, Ankle_*, Shoulder_*, Elbow_*, Wrist_*; L R; RootPart1_M, Spine1_M, Chest_M,
    Neck_M, Head_M, Scapula_*, Toes_*
cats = Hips; * leg, * knee, * ankle, * arm, * elbow, * wrist; Left Right; Spine, Chest, Neck, Head, * shoulder, * toe
makehuman = root; upperleg01.*, lowerleg01.*, foot.*, upperarm01.*, lowerarm01.*, wrist.*; L R; spine05, spine04,
    spine03, spine02, spine01, neck01, head, pelvis.*, upperleg02.*, lowerleg02.*, clavicle.*, shoulder01.*,
    upperarm02.*, lowerarm02.*
biovision = Hips; *UpLeg, *LowLeg, *Foot, *UpArm, *LowArm, *Hand; Left Right; Chest, Neck, Head, *Collar
biovision_joints = Hips; *Hip, *Knee, *Ankle, *Shoulder, *Elbow, *Wrist; Left Right; Chest, Neck, Head, *Collar
webxr = hips; *-upper-leg, *-lower-leg, *-foot-ankle, *-arm-upper, *-arm-lower, *-hand-wrist; left right; root,
    spine-lower, spine-middle, spine-upper, chest, neck, head, *-shoulder, *-scapula, *-foot-ball, *-hand-wrist-twist
meta = Body_Hips; Body_*UpperLeg, Body_*LowerLeg, Body_*FootAnkle, Body_*ArmUpper, Body_*ArmLower, Body_*HandWrist;
    Left Right; Body_Root, Body_SpineLower, Body_Chest, Body_Neck, Body_Head, Body_*Shoulder, Body_*Scapula,
    Body_*FootBall
source_2 = pelvis; leg_upper_*, leg_lower_*, ankle_*, arm_upper_*, arm_lower_*, hand_*; L R; root_motion, spine_0,
    spine_1, spine_2, neck_0, head, clavicle_*, ball_*
daz_9 = hip; *_thigh, *_shin, *_foot, *_upperarm, *_forearm, *_hand; l r; pelvis, spine1, spine2, spine3, spine4,
    neck1, neck2, head, *_shoulder, *_metatarsal, *_toes
daz_8 = hip; *ThighBend, *Shin, *Foot, *ShldrBend, *ForearmBend, *Hand; l r; pelvis, abdomenLower, abdomenUpper,
    chestLower, neckLower, head, *Collar, *ThighTwist, *ShldrTwist, *Toe
mmd_english = lower body; leg_*, knee_*, ankle_*, arm_*, elbow_*, wrist_*; L R; center, upper body, upper body 2,
    neck, head, shoulder_*, toe_*, leg ik_*
mmd = 下半身; *足, *ひざ, *足首, *腕, *ひじ, *手首; 左 右; 全ての親, センター, 腰, 上半身, 首, 頭,
    *肩, *腕捩, *手捩, *足D, *足ＩＫ
mmd_blender = 下半身; 足.*, ひざ.*, 足首.*, 腕.*, ひじ.*, 手首.*; L R; センター, 上半身, 首, 頭, 肩.*
ipi = Hip; *Thigh, *Shin, *Foot, *Shoulder, *Forearm, *Hand; L R; LowerSpine, MiddleSpine, Chest, Neck, Head,
    *Clavicle, *Toe
cascadeur = pelvis; thigh_*, calf_*, foot_*, arm_*, forearm_*, hand_*; l r; stomach, chest, neck, head, clavicle_*,
    toe_*
unreal = pelvis; thigh_*, calf_*, foot_*, upperarm_*, lowerarm_*, hand_*; l r; root, spine_01, spine_05, neck_01,
    head, clavicle_*, ball_*, thigh_twist_01_*, ik_foot_*, ik_hand_*, ik_foot_root
character_creator = CC_Base_Hip; CC_Base_*_Thigh, CC_Base_*_Calf, CC_Base_*_Foot, CC_Base_*_Upperarm,
    CC_Base_*_Forearm, CC_Base_*_Hand; L R; CC_Base_BoneRoot, CC_Base_Pelvis, CC_Base_Waist, CC_Base_Spine01,
    CC_Base_Head, CC_Base_*_Clavicle
shadow = Hips; *Thigh, *Leg, *Foot, *Arm, *Forearm, *Hand; Left Right; Body, SpineLow, SpineMid, Chest, Neck, Head,
    *Shoulder, *Toe
rokoko = Hips; *Thigh, *Shin, *Foot, *Arm, *ForeArm, *Hand; Left Right; Spine, Spine2, Spine3, Spine4, Neck, Head,
    *Shoulder, *Toe
soma = Hips; *Leg, *Shin, *Foot, *Arm, *ForeArm, *Hand; Left Right; Root, Spine1, Spine2, Chest, Neck1, Neck2, Head,
    *Shoulder, *ToeBase
xsens_mvn = Pelvis; * Upper Leg, * Lower Leg, * Foot, * Upper Arm, * Forearm, * Hand; Left Right; L5, L3, T12, T8,
    Neck, Head, * Shoulder, * Toe
optitrack = Hip; *Thigh, *Shin, *Foot, *UArm, *FArm, *Hand; L R; Ab, Chest, Neck, Head, *Shoulder, *Toe
kinect_1 = HipCenter; Hip*, Knee*, Ankle*, Shoulder*, Elbow*, Wrist*; Left Right; Spine, ShoulderCenter, Head, Hand*,
    Foot*
azure_kinect = K4ABT_JOINT_PELVIS; K4ABT_JOINT_HIP_*, K4ABT_JOINT_KNEE_*, K4ABT_JOINT_ANKLE_*, K4ABT_JOINT_SHOULDER_*,
    K4ABT_JOINT_ELBOW_*, K4ABT_JOINT_WRIST_*; LEFT RIGHT; K4ABT_JOINT_SPINE_NAVEL, K4ABT_JOINT_SPINE_CHEST,
    K4ABT_JOINT_CLAVICLE_*, K4ABT_JOINT_HAND_*
arkit = hips_joint; *_upLeg_joint, *_leg_joint, *_foot_joint, *_arm_joint, *_forearm_joint, *_hand_joint; left right;
    root, spine_1_joint, spine_4_joint, spine_7_joint, neck_1_joint, head_joint, *_shoulder_1_joint
body25 = MidHip; *Hip, *Knee, *Ankle, *Shoulder, *Elbow, *Wrist; L R; Nose, Neck, *Eye, *BigToe, *Heel
roblox = LowerTorso; *UpperLeg, *LowerLeg, *Foot, *UpperArm, *LowerArm, *Hand; Left Right; HumanoidRootPart,
    UpperTorso, Head
freemocap = hips_center; *_hip, *_knee, *_ankle, *_shoulder, *_elbow, *_wrist; left right; trunk_center, neck_center,
    head_center, *_heel
deepmimic = root; *_hip, *_knee, *_ankle, *_shoulder, *_elbow, *_wrist; left right; chest, neck
valve = ValveBiped.Bip01_Pelvis; ValveBiped.Bip01_*_Thigh, ValveBiped.Bip01_*_Calf, ValveBiped.Bip01_*_Foot,
    ValveBiped.Bip01_*_UpperArm, ValveBiped.Bip01_*_Forearm, ValveBiped.Bip01_*_Hand; L R; ValveBiped.Bip01_Spine,
    ValveBiped.Bip01_Spine4, ValveBiped.Bip01_Head1, ValveBiped.Bip01_*_Clavicle
sides_at_the_end = mixamorig:Hips; mixamorig:UpLeg.*, mixamorig:Leg.*, mixamorig:Foot.*, mixamorig:Arm.*,
    mixamorig:ForeArm.*, mixamorig:Hand.*; L R; mixamorig:Spine, mixamorig:Shoulder.*
mixamo = Hips; *UpLeg, *Leg, *Foot, *Arm, *ForeArm, *Hand; Left Right; Spine, Spine1, Neck, Head, *Shoulder, *ToeBase
vroid = J_Bip_C_Hips; J_Bip_*_UpperLeg, J_Bip_*_LowerLeg, J_Bip_*_Foot, J_Bip_*_UpperArm, J_Bip_*_LowerArm,
    J_Bip_*_Hand; L R; J_Bip_C_Spine, J_Bip_C_Chest, J_Bip_C_Head, J_Bip_*_Shoulder, Face, J_Adj_*_FaceEye,
    J_Sec_Hair1_01
"""
PROGRAMS = {
    name: tuple(part.strip() for part in row.split(";"))
    for name, row in (line.split(" = ") for line in TABLE.replace("\n    ", " ").strip().splitlines())
}
PARTS = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")


def rig_of(program: str) -> tuple[dict[str, str], list[str]]:
    """Joint name by required role, and all names: the others first, as they may hide the right ones."""
    pelvis, limbs, words, others = PROGRAMS[program]
    expected = {"pelvis": pelvis}
    for part, name in zip(PARTS, limbs.split(","), strict=True):
        for side, word in zip(("left", "right"), words.split(), strict=True):
            expected[f"{side}_{part}"] = name.strip().replace("*", word)
    beside = [name.strip().replace("*", word) for name in others.split(",") for word in words.split()]
    return expected, [*dict.fromkeys(beside), *expected.values()]


def check_roles(program: str, change: Callable[[int, str], str], more: Sequence[str] = ()) -> None:
    expected, names = rig_of(program)
    found = find_roles((*(change(i, name) for i, name in enumerate(names)), *more))
    assert {role: names[found[role]] for role in REQUIRED if role in found} == expected
    assert len(set(found.values())) == len(found)


@pytest.mark.parametrize("program", PROGRAMS)
def test_required_roles_by_the_names_of_many_programs(program):
    """A rig's names decide together: `LeftLeg` is a shin here and a thigh there. No joint has two roles."""
    check_roles(program, lambda _, name: name)
    check_roles(program, lambda _, name: f"Model:{name}")


@pytest.mark.parametrize("program", ["mixamo", "vroid", "valve", "arkit"])
@pytest.mark.parametrize("bones", [10, 60])
def test_bones_of_hair_and_skirts_hide_no_affix(program, bones):
    check_roles(program, lambda _, name: f"HIK_{name}", [f"Bone{i:03d}" for i in range(bones)])


@pytest.mark.parametrize(
    "affixed",
    [
        *("mixamorig{name}", "mixamorig12{name}", "mixamorig1:{name}", "mixamorig:{name}_{i:02d}", "{name}_{i:03d}"),
        *("mixamorig{name}_{i:02d}", "Character1:{name}", "a:b:{name}", "Model|{name}", "Skeleton 001_{name}"),
    ],
)
def test_prefixes_namespaces_and_numbers_of_exporters(affixed):
    check_roles("mixamo", lambda i, name: affixed.format(i=i, name=name))


def test_points_without_a_pelvis_and_roots_on_the_ground_are_no_pelvis():
    joints = [f"{side}_{part}" for side in ("left", "right") for part in PARTS]
    for others in (["nose"], ["root", "Waist", "spine_01", "head"], ["Bip01", "Spine", "Spine1", "Neck", "Head"]):
        assert set(REQUIRED) - find_roles((*others, *joints)).keys() == {"pelvis"}


def test_long_names_take_no_time():
    assert find_roles(("Hand_Leg_" * 50_000, "A" * 500_000, "_" * 500_000, ":", "")) == {}
