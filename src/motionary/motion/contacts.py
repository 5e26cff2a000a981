"""Foot contacts: which ankles and toes stand still, frame by frame."""

from __future__ import annotations

import numpy as np

from motionary.motion.motion import Motion

CONTACT_THRESHOLD = 0.002  # m^2 per frame^2 at 20 fps, as HumanML3D's
_RATE = 20.0


def foot_contacts(motion: Motion, threshold: float = CONTACT_THRESHOLD) -> np.ndarray:
    """(T - 1, 4) float32: 1 where a joint of `skeleton.feet` moves less than the threshold to the next frame.

    Args:
        motion: at any rate; the threshold is one of speed, scaled to the motion's fps.
        threshold: squared step in m^2 per frame^2 at 20 fps.
    """
    feet = motion.positions[:, list(motion.skeleton.feet)]
    steps = np.square(np.diff(feet, axis=0)).sum(axis=-1)
    return (steps < threshold * (_RATE / motion.fps) ** 2).astype(np.float32)
