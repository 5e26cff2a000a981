"""Motion as geometry: types, kinematics, retargeting, mirroring. No torch models here."""

from motionary.motion.motion import Motion
from motionary.motion.skeleton import Skeleton

__all__ = ["Motion", "Skeleton"]
