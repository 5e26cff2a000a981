"""Motion as geometry: types, kinematics, retargeting, mirroring. No torch models here."""

from motionary.motion.contacts import foot_contacts
from motionary.motion.facing import heading
from motionary.motion.motion import Motion
from motionary.motion.skeleton import Skeleton

__all__ = ["Motion", "Skeleton", "foot_contacts", "heading"]
