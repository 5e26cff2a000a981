"""The joints of the Master Motor Map among those of SMPL (TEMOS Table A.6), to compare bodies of both."""

from __future__ import annotations

from motionary.motion import Skeleton

SCALE = 0.64  # of SMPL's joints, by which they are about MMM's size (TEMOS 0.A.6)

# MMM's joint: SMPL-H's. LMrot and RMrot are heels, which the 22 joints of SMPL lack.
JOINTS = {
    "root": "pelvis", "BP": "spine1", "BT": "spine3", "BLN": "neck", "BUN": "head",
    "LS": "left_shoulder", "LE": "left_elbow", "LW": "left_wrist",
    "RS": "right_shoulder", "RE": "right_elbow", "RW": "right_wrist",
    "LH": "left_hip", "LK": "left_knee", "LA": "left_ankle", "LMrot": "left_heel", "LF": "left_foot",
    "RH": "right_hip", "RK": "right_knee", "RA": "right_ankle", "RMrot": "right_heel", "RF": "right_foot",
}  # fmt: skip


def mmm_joints(skeleton: Skeleton) -> list[int]:
    """Indices in the skeleton of the joints of Table A.6, in its order; joints that the skeleton lacks are left out."""
    place = {name: joint for joint, name in enumerate(skeleton.joints)}
    return [place[name] for name in JOINTS.values() if name in place]
