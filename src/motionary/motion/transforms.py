"""Motions brought to another rate, place or side."""

from __future__ import annotations

import numpy as np

from motionary.errors import InputError, is_real
from motionary.motion.facing import heading, rotate_y
from motionary.motion.kinematics import agrees, forward_kinematics
from motionary.motion.motion import FASTEST_RATE, SLOWEST_RATE, Motion
from motionary.motion.rotations import quat_product, unitquat_slerp
from motionary.motion.skeleton import Skeleton

_MOST = 1_000_000  # most joints x frames of a result at a raised rate: 38 minutes of 22 joints at 20 fps
_MIRROR = np.array([-1, 1, 1], np.float32)
# A mirrored rotation turns the other way about the mirrored axis: M R M has the axis (x, -y, -z).
_MIRROR_TURN = np.array([1, -1, -1, 1], np.float32)


def canonicalize(motion: Motion) -> Motion:
    """The motion on the floor and facing ahead, as HumanML3D stores it.

    The lowest joint of all frames stands at y = 0; in the first frame the pelvis is at x = z = 0 and the body faces +z.
    """
    angle = float(heading(motion)[0])
    positions = motion.positions.astype(np.float64)
    pelvis = motion.skeleton.roles.get("pelvis", 0)
    shift = np.array([positions[0, pelvis, 0], positions[..., 1].min(), positions[0, pelvis, 2]])
    positions = rotate_y(positions - shift, -angle)
    return Motion(positions, motion.fps, motion.skeleton, _turn_root(motion.rotations, -angle))


def check_rate(fps: float) -> None:
    """InputError unless motions can have this rate."""
    if not is_real(fps) or not SLOWEST_RATE <= fps <= FASTEST_RATE:
        raise InputError("fps", fps, f"must be frames per second, {SLOWEST_RATE:g} to {FASTEST_RATE:g}")


def resample(motion: Motion, fps: float) -> Motion:
    """The motion at another rate, from its first frame on, for as long as it has frames.

    Positions follow a Catmull-Rom spline through the frames. Rotations are slerped; where they place the joints of
    the motion, they place those of the result too, so that bones stay constant between frames.

    Raises:
        InputError: fps is no rate of a motion, or there would be too many frames.
    """
    check_rate(fps)
    if fps == motion.fps:
        return motion
    # The tolerance keeps the last frame where 1 / fps was rounded, as in BVH files.
    frames = int(np.floor((motion.frames - 1) * fps / motion.fps + 1e-3)) + 1
    if frames > 2 * motion.frames and frames * len(motion.skeleton) > _MOST:
        rule = f"{motion.duration:,.0f} s would be {frames:,} frames; at most {_MOST:,} joints x frames can be made"
        raise InputError("fps", f"{fps:g}", rule)
    time = np.minimum(np.arange(frames) * (motion.fps / fps), motion.frames - 1)
    before = np.minimum(time.astype(np.int64), max(motion.frames - 2, 0))
    share = time - before
    after = np.minimum(before + 1, motion.frames - 1)
    positions, rotations = _spline(motion.positions, before, share), None
    if motion.rotations is not None:
        rotations = unitquat_slerp(motion.rotations[before], motion.rotations[after], share).astype(np.float32)
        if agrees(motion):
            positions = forward_kinematics(motion.skeleton, rotations, positions[:, 0])
    return Motion(positions, fps, motion.skeleton, rotations)


def repeat_last_step(motion: Motion) -> Motion:
    """The motion with one frame more, in which every joint moves on as it did last: features of T frames decode to T
    frames, but it takes T + 1 to encode them. Rotations are left out; a single frame stays as it is."""
    if motion.frames < 2:
        return motion
    after = 2 * motion.positions[-1:] - motion.positions[-2:-1]
    return Motion(np.concatenate([motion.positions, after]), motion.fps, motion.skeleton)


def mirror(motion: Motion) -> Motion:
    """The motion as in a mirror: x becomes -x, left and right joints change places.

    With rotations the skeleton is mirrored too, where its sides differ, so that they still place the joints.
    Twice mirrored is the motion itself. (`motionary.language.mirror_text` mirrors its captions.)
    """
    swap = _swap(motion.skeleton)
    positions = motion.positions[:, swap] * _MIRROR
    if motion.rotations is None:
        return Motion(positions, motion.fps, motion.skeleton)
    rotations = motion.rotations[:, swap] * _MIRROR_TURN
    skeleton, offsets = motion.skeleton, motion.skeleton.offsets[swap] * _MIRROR
    if np.abs(offsets - skeleton.offsets).max() > 1e-6:
        skeleton = skeleton.with_offsets(offsets)
    return Motion(positions, motion.fps, skeleton, rotations)


def _swap(skeleton: Skeleton) -> list[int]:
    swap = list(range(len(skeleton)))
    for left, right in skeleton.pairs:
        swap[left], swap[right] = right, left
    # Joints whose parents do not mirror with them would be torn from their bones.
    for joint, parent in enumerate(skeleton.parents):
        if joint and skeleton.parents[swap[joint]] != swap[parent]:
            raise InputError(
                f"skeleton {skeleton.name}", skeleton.joints[joint], "pairs must mirror the joint's parent too"
            )
    return swap


def _spline(positions: np.ndarray, before: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Catmull-Rom between frame `before` and the next; the ends are extended by their last step."""
    if len(positions) == 1:
        return positions[before]
    ends = 2 * positions[[0, -1]] - positions[[1, -2]]
    padded = np.concatenate([ends[:1], positions, ends[1:]]).astype(np.float64)
    a, b, c, d = (padded[before + k] for k in range(4))
    s = share[:, None, None]
    return b + s / 2 * (c - a + s * (2 * a - 5 * b + 4 * c - d + s * (3 * (b - c) + d - a)))


def _turn_root(rotations: np.ndarray | None, angle: float) -> np.ndarray | None:
    """Local rotations (T, J, 4) of the body turned about +y by angle radians."""
    if rotations is None:
        return None
    turned = rotations.copy()
    turned[:, 0] = quat_product(np.array([0.0, np.sin(angle / 2), 0.0, np.cos(angle / 2)]), rotations[:, 0])
    return turned
