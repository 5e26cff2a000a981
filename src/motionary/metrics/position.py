"""Errors of joint positions and rotations against a target motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from motionary.errors import InputError
from motionary.metrics.inputs import matrix, same_shape

if TYPE_CHECKING:
    from motionary.motion import Motion

Kind = Literal["local", "root", "global"]


def average_position_error(a: Any, b: Any) -> np.ndarray:
    """Mean distance of each joint over frames and samples (TEMOS Eq. 4, APE[j]).

    Args:
        a: (..., F, J, 3) joint positions in metres; a `Motion` serves as well.
        b: the target, same shape.

    Returns:
        (J,) float64, metres.
    """
    a, b = _pair(a, b)
    return np.linalg.norm(a - b, axis=-1).reshape(-1, a.shape[-2]).mean(0)


def average_variance_error(a: Any, b: Any) -> np.ndarray:
    """Mean distance of the variances over time of each joint (TEMOS Eq. 5-6, AVE[j]; variances divide by F - 1).

    Args:
        a: (..., F, J, 3) joint positions in metres, F >= 2; a `Motion` serves as well.
        b: the target, same shape.

    Returns:
        (J,) float64, square metres.
    """
    a, b = _pair(a, b)
    if a.shape[-3] < 2:
        raise InputError("a, b", a.shape, "a variance over time needs at least 2 frames")
    difference = a.var(axis=-3, ddof=1) - b.var(axis=-3, ddof=1)
    return np.linalg.norm(difference, axis=-1).reshape(-1, a.shape[-2]).mean(0)


@dataclass(frozen=True)
class PositionErrors:
    """The eight numbers of TEMOS Table 1: APE in metres, AVE in square metres."""

    ape_root: float
    ape_trajectory: float
    ape_local: float
    ape_global: float
    ave_root: float
    ave_trajectory: float
    ave_local: float
    ave_global: float


def position_errors(
    predicted: Sequence[Motion], target: Sequence[Motion], joints: Sequence[int] | None = None, factor: float = 1.0
) -> PositionErrors:
    """APE and AVE of root, ground trajectory, local joints and global joints over a test set (TEMOS appendix C).

    Every motion should be canonical (at the origin, facing +z at the first frame). Frames weigh alike in the APE,
    samples in the AVE. The local and global means leave the root out; local joints stand in the body's own frame.
    Arguments `joints` and `factor` as for :func:`sample_errors`.
    """
    if len(predicted) != len(target) or not predicted:
        raise InputError("predicted, target", f"{len(predicted)} and {len(target)}", "need as many motions, at least 1")
    ape, ave, frames = np.zeros(4), np.zeros(4), 0
    for a, b in zip(predicted, target, strict=True):
        errors = sample_errors(a, b, joints, factor)
        ape += errors[:4] * a.frames
        ave += errors[4:]
        frames += a.frames
    return PositionErrors(*(ape / frames).tolist(), *(ave / len(target)).tolist())


def sample_errors(
    predicted: Motion, target: Motion, joints: Sequence[int] | None = None, factor: float = 1.0
) -> np.ndarray:
    """(8,) errors of one sample in the order of :class:`PositionErrors`, metres and square metres (TEMOS Eq. 4-6).

    Args:
        predicted, target: canonical motions of as many frames and the same joints.
        joints: that count, the root first; None counts all. :mod:`motionary.metrics.mmm` has those of TEMOS Table A.6.
        factor: on all positions, as .64 for bodies of MMM's size (TEMOS 0.A.6).
    """
    x, y = (factor * values for values in _pair(predicted, target))
    # The body's frame is that of the whole skeleton, whatever is counted.
    local_x, local_y = (factor * local_pose(motion, heights=True) for motion in (predicted, target))
    rest = [joint for joint in (range(x.shape[1]) if joints is None else joints) if joint]
    parts = [
        (x[:, :1], y[:, :1]),
        (x[:, :1, [0, 2]], y[:, :1, [0, 2]]),
        (local_x[:, rest], local_y[:, rest]),
        (x[:, rest], y[:, rest]),
    ]
    ape = [average_position_error(u, v).mean() for u, v in parts]
    return np.array([*ape, *(average_variance_error(u, v).mean() for u, v in parts)])


def mpjpe(predicted: Motion, target: Motion, kind: Kind = "global") -> float:
    """Mean per-joint position error in millimetres over all frames and joints.

    Args:
        predicted: the motion to judge.
        target: the truth, with as many frames and joints.
        kind: "global" removes nothing, "root" removes each frame's root position, "local" its root position and
            heading, each motion's by its own hips and shoulders.
    """
    a, b = _pair(predicted, target)
    if kind == "local":
        a, b = local_pose(predicted), local_pose(target)
    elif kind == "root":
        a, b = a - a[:, :1], b - b[:, :1]
    elif kind != "global":
        raise InputError("kind", kind, "must be local, root or global")
    return float(1000 * np.linalg.norm(a - b, axis=-1).mean())


def local_pose(motion: Motion, heights: bool = False) -> np.ndarray:
    """Positions (T, J, 3) with each frame's root at the origin and the body facing +z (height kept on request)."""
    p = np.asarray(motion.positions, np.float64)
    origin = p[:, :1] * ([1, 0, 1] if heights else 1)
    p = p - origin
    x, z = across(p, motion.skeleton.hips, motion.skeleton.shoulders).T
    # `across` points to the body's left, which is +x when facing +z: turn it there.
    left = p[..., 0] * x[:, None] + p[..., 2] * z[:, None]
    forward = p[..., 2] * x[:, None] - p[..., 0] * z[:, None]
    return np.stack([left, p[..., 1], forward], -1)


def across(positions: np.ndarray, hips: tuple[int, int], shoulders: tuple[int, int]) -> np.ndarray:
    """Unit (T, 2) direction on the ground (x, z) from the right to the left of the body, by hips and shoulders."""
    side = positions[:, hips[0]] - positions[:, hips[1]] + positions[:, shoulders[0]] - positions[:, shoulders[1]]
    side = side[:, [0, 2]].astype(np.float64)
    length = np.linalg.norm(side, axis=-1, keepdims=True)
    return np.where(length > 1e-6, side / np.maximum(length, 1e-6), [1.0, 0.0])


def geodesic_distance(a: Any, b: Any) -> np.ndarray:
    """Angle of the rotation between two rotations.

    Args:
        a: (..., 4) quaternions xyzw, of any length but zero.
        b: (..., 4), broadcast against a.

    Returns:
        (...) float64, radians in [0, pi]; q and -q are one rotation. Exact near 0 and near pi, where arc cosines lose
        half of their digits: on the sphere of unit quaternions the chords a - b and a + b give the half angle.
    """
    a, b = _unit("a", a), _unit("b", b)
    minus, plus = np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1)
    return 4 * np.arctan2(np.minimum(minus, plus), np.maximum(minus, plus))


def _unit(what: str, q: Any) -> np.ndarray:
    q = np.asarray(q, np.float64)
    if q.ndim == 0 or q.shape[-1] != 4 or not np.isfinite(q).all():
        raise InputError(what, q.shape, "must be finite quaternions (..., 4)")
    length = np.linalg.norm(q, axis=-1, keepdims=True)
    if (length < 1e-8).any():
        raise InputError(what, "a zero quaternion", "is no rotation")
    return q / length


def _pair(a: Any, b: Any) -> tuple[np.ndarray, np.ndarray]:
    """Positions of motions or arrays as float64 of one shape (..., F, J, 3)."""
    a, b = getattr(a, "positions", a), getattr(b, "positions", b)
    a = matrix("a", a, np.ndim(a)).astype(np.float64)
    b = matrix("b", b, np.ndim(b)).astype(np.float64)
    same_shape("a, b", a, b)
    if a.ndim < 3:
        raise InputError("a, b", a.shape, "must be joint positions (..., frames, joints, 3)")
    return a, b
