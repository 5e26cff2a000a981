"""Motion as geometry: types, kinematics, retargeting, mirroring. No torch models here."""

from motionary.motion.contacts import foot_contacts
from motionary.motion.facing import heading
from motionary.motion.fitting import fit_rotations
from motionary.motion.kinematics import forward_kinematics
from motionary.motion.motion import Motion
from motionary.motion.retargeting import name_joints, retarget
from motionary.motion.skeleton import Skeleton
from motionary.motion.transforms import canonicalize, mirror, repeat_last_step, resample

__all__ = [
    "Motion",
    "Skeleton",
    "canonicalize",
    "fit_rotations",
    "foot_contacts",
    "forward_kinematics",
    "heading",
    "mirror",
    "name_joints",
    "repeat_last_step",
    "resample",
    "retarget",
]
