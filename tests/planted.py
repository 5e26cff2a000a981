"""Faults planted in sound clips, as recordings have them: joints (T, 22, 3) in metres, y up, at some rate."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from motionary.motion import Skeleton

SMPL = Skeleton.named("smpl22")
LEFT = [left for left, _ in SMPL.pairs]
RIGHT = [right for _, right in SMPL.pairs]
Fault = Callable[[np.ndarray, np.random.Generator, float], np.ndarray]


def _t_pose(joints: np.ndarray, rng: np.random.Generator, fps: float) -> np.ndarray:
    """Nothing but the rest pose, where the body is."""
    return SMPL.rest - SMPL.rest[:, 1].min() * np.array([0, 1, 0]) + joints[:1, :1] * [1, 0, 1] + 0 * joints


def _t_pose_carried(joints: np.ndarray, rng: np.random.Generator, fps: float) -> np.ndarray:
    """The rest pose, carried along the way of the body."""
    return _t_pose(joints, rng, fps) + (joints[:, :1] - joints[:1, :1]) * [1, 0, 1]


def _idle(joints: np.ndarray, rng: np.random.Generator, fps: float) -> np.ndarray:
    """One pose throughout, with a sensor's noise."""
    frame = rng.integers(len(joints))
    return joints[frame] + rng.normal(0, 5e-4, joints.shape)


def _jitter(joints: np.ndarray, rng: np.random.Generator, fps: float) -> np.ndarray:
    """Noise of 6 to 20 mm on every joint."""
    return joints + rng.normal(0, rng.uniform(0.006, 0.02), joints.shape)


def _flip(joints: np.ndarray, rng: np.random.Generator, fps: float) -> np.ndarray:
    """The body turned round for a while."""
    place, result = _stretch(joints, rng), joints.copy()
    middle = joints[place.start, 0] * [1, 0, 1]
    result[place] = (joints[place] - middle) * [-1, 1, -1] + middle
    return result


def _swap(joints: np.ndarray, rng: np.random.Generator, fps: float) -> np.ndarray:
    """Left and right exchanged for a while."""
    place, result = _stretch(joints, rng), joints.copy()
    result[place, LEFT], result[place, RIGHT] = joints[place][:, RIGHT], joints[place][:, LEFT]
    return result


def _teleport(joints: np.ndarray, rng: np.random.Generator, fps: float) -> np.ndarray:
    """From one frame to the next the body is 0.3 to 2 m away."""
    result = joints.copy()
    result[_stretch(joints, rng).start :] += _direction(rng) * rng.uniform(0.3, 2)
    return result


def _spike(joints: np.ndarray, rng: np.random.Generator, fps: float) -> np.ndarray:
    """A wrist or an ankle far off for one frame."""
    result, joint = joints.copy(), SMPL.joints.index(str(rng.choice(["left_wrist", "right_ankle"])))
    result[_stretch(joints, rng).start, joint] += _direction(rng) * rng.uniform(0.4, 1)
    return result


def _slide(joints: np.ndarray, rng: np.random.Generator, fps: float) -> np.ndarray:
    """All of it drifts at 0.5 to 1.5 m/s."""
    seconds = np.arange(len(joints))[:, None, None] / fps
    return joints + _direction(rng) * rng.uniform(0.5, 1.5) * seconds


def _small(joints: np.ndarray, rng: np.random.Generator, fps: float) -> np.ndarray:
    """Someone of half to four fifths of the size."""
    return joints * rng.uniform(0.5, 0.8)


def _large(joints: np.ndarray, rng: np.random.Generator, fps: float) -> np.ndarray:
    """A giant."""
    return joints * rng.uniform(1.3, 2)


def _centimetres(joints: np.ndarray, rng: np.random.Generator, fps: float) -> np.ndarray:
    """Another unit than the rest of the folder."""
    return joints * 100


def _upside_down(joints: np.ndarray, rng: np.random.Generator, fps: float) -> np.ndarray:
    """Turned about the x axis."""
    return joints * [1, -1, -1]


def _lying(joints: np.ndarray, rng: np.random.Generator, fps: float) -> np.ndarray:
    """Another axis up than in the rest of the folder."""
    return joints[..., [0, 2, 1]] * [1, -1, 1]


FAULTS: dict[str, Fault] = {
    "t-pose": _t_pose,
    "t-pose carried": _t_pose_carried,
    "idle": _idle,
    "jitter": _jitter,
    "flip": _flip,
    "sides exchanged": _swap,
    "teleport": _teleport,
    "spike": _spike,
    "slide": _slide,
    "small": _small,
    "large": _large,
    "centimetres": _centimetres,
    "upside down": _upside_down,
    "z up": _lying,
}


def _stretch(joints: np.ndarray, rng: np.random.Generator) -> slice:
    """Some frames within the middle of the clip, three at least."""
    first = int(rng.integers(len(joints) // 5, max(len(joints) // 5 + 1, 3 * len(joints) // 5)))
    return slice(first, first + int(rng.integers(3, max(4, len(joints) // 5))))


def _direction(rng: np.random.Generator) -> np.ndarray:
    """Along the ground."""
    angle = rng.uniform(0, 2 * np.pi)
    return np.array([np.cos(angle), 0.0, np.sin(angle)])
