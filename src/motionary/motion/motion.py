"""`Motion`: joint positions over time on a skeleton, and local rotations where they are known."""

from __future__ import annotations

from dataclasses import dataclass, field
from numbers import Integral
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.lazy import plant, save, to
from motionary.motion.skeleton import Skeleton

SLOWEST_RATE, FASTEST_RATE = 0.5, 10_000.0  # frames per second of any recording of motion
FARTHEST = 1e7  # m from the origin: float32 steps are a metre there


@dataclass(frozen=True, eq=False)
class Motion:
    """T frames of J joints.

    Attributes:
        positions: (T, J, 3) float32 metres, y up.
        fps: frames per second.
        skeleton: the J joints.
        rotations: (T, J, 4) float32 local unit quaternions xyzw relative to the rest offsets (the root's is global),
            or None where they are unknown. They are the true ones, never the HumanML3D codec's.

    Raises:
        InputError: wrong shape, values that are not finite or farther than 10,000 km, or a rate that no motion has.
    """

    positions: np.ndarray
    fps: float
    skeleton: Skeleton
    rotations: np.ndarray | None = field(default=None)

    def __post_init__(self):
        if not isinstance(self.skeleton, Skeleton):
            raise InputError("skeleton", self.skeleton, "must be a Skeleton")
        joints = len(self.skeleton.joints)
        object.__setattr__(self, "positions", _array("positions", self.positions, (joints, 3)))
        fps = _number(self.fps)
        if not SLOWEST_RATE <= fps <= FASTEST_RATE:
            rule = f"must be frames per second, {SLOWEST_RATE:g} to {FASTEST_RATE:g}"
            raise InputError("fps", self.fps, rule)
        object.__setattr__(self, "fps", fps)
        if (far := float(max(self.positions.max(), -self.positions.min()))) > FARTHEST:
            raise InputError("positions", f"{far:.3g} m", f"must lie within {FARTHEST:g} m of the origin")
        if self.rotations is None:
            return
        rotations = _array("rotations", self.rotations, (joints, 4))
        if len(rotations) != len(self.positions):
            raise InputError("rotations", rotations.shape, f"as many frames as positions ({len(self.positions)})")
        squares = np.einsum("tjc,tjc->tj", rotations, rotations)
        low, high = np.sqrt(squares.min()), np.sqrt(squares.max())
        if low < 1 - 1e-3 or high > 1 + 1e-3:
            raise InputError("rotations", f"norms {low:.4f} to {high:.4f}", "unit quaternions xyzw")
        object.__setattr__(self, "rotations", rotations)

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.positions)

    @property
    def duration(self) -> float:
        """Seconds, T / fps."""
        return self.frames / self.fps

    def crop(self, start_frame: int, end_frame: int) -> Motion:
        """Frames start_frame to end_frame (exclusive).

        Raises:
            InputError: not 0 <= start_frame < end_frame <= frames.
        """
        whole = isinstance(start_frame, Integral) and isinstance(end_frame, Integral)
        if not whole or not 0 <= start_frame < end_frame <= self.frames:
            rule = f"must be whole numbers, 0 <= start < end <= {self.frames} frames"
            raise InputError("crop", (start_frame, end_frame), rule)
        rotations = None if self.rotations is None else self.rotations[start_frame:end_frame]
        return Motion(self.positions[start_frame:end_frame], self.fps, self.skeleton, rotations)

    def save(self, path: Path | str, **options: Any) -> None:
        """Write to a file by its extension: .bvh .npy .npz .glb .mp4 .gif .html (options go to that format)."""
        save(self, path, **options)

    def to(self, rig: Skeleton | Motion | Path | str) -> Motion:
        """The motion on another character's rig: its joints, their order, its rest pose and proportions.

        Rotations keep their twist, fingers and extra joints stay as they are in the rig's own pose, and feet that
        stand go on standing. Saved as .bvh or .glb, `onto=` the rig's file keeps all else that the file holds.

        Args:
            rig: a .bvh or .glb file, a motion on the rig, or a skeleton whose rest pose is a standing person's.

        Raises:
            InputError: a role that retargeting needs is missing on either side, or the file is no rig.
        """
        if not isinstance(rig, Skeleton | Motion | str | PathLike):
            raise InputError("rig", rig, "must be a file's path, a motion or a skeleton")
        return to(self, rig)

    def plant_feet(self, first_frame: int = 0) -> Motion:
        """The motion with feet that stand still while they stand, as those of generated motion do not.

        The body goes along with feet that slide for long, the legs do the rest by inverse kinematics, with fading
        ends; frames in the air keep their pose to a millimetre, and bones have one length. Rotations come out where
        they came in. A rig without known hips, knees and ankles is returned as it is, with one line of warning.

        Args:
            first_frame: frames before it stay as they are, and what follows goes on from them.

        Raises:
            InputError: first_frame is not among the frames.
        """
        if not isinstance(first_frame, Integral) or not 0 <= first_frame <= self.frames:
            raise InputError("first_frame", first_frame, f"must be a whole number from 0 to {self.frames}")
        return plant(self, first_frame)

    def __repr__(self) -> str:
        rotations = "" if self.rotations is None else ", rotations"
        return f"Motion({self.frames} frames, {self.fps:g} fps, {self.skeleton.name}{rotations})"


def _number(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return float("nan")


def _array(name: str, values: Any, tail: tuple[int, int]) -> np.ndarray:
    """float32 values of shape (T, *tail), finite, T >= 1."""
    try:
        array = np.asarray(values)
        if array.dtype.kind not in "fiu":
            raise TypeError(array.dtype)
        with np.errstate(over="ignore"):  # what float32 cannot hold is said below, as infinity
            array = np.ascontiguousarray(array, dtype=np.float32)
    except (TypeError, ValueError):
        raise InputError(name, type(values).__name__, f"numbers of shape (T, {tail[0]}, {tail[1]})") from None
    if array.ndim != 3 or array.shape[1:] != tail or len(array) < 1:
        raise InputError(name, array.shape, f"shape (T, {tail[0]}, {tail[1]}) with T >= 1")
    if not np.isfinite(array).all():
        frame, joint = np.argwhere(~np.isfinite(array))[0][:2]
        raise InputError(name, f"frame {frame}, joint {joint}", "values must be finite (no NaN, no infinity)")
    return array
