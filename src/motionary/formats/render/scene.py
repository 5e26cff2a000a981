"""A motion as a picture: ground, path, shadow and a figure of shaded limbs under a camera that follows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from motionary.errors import InputError
from motionary.formats.render.figure import COLORS, segments
from motionary.formats.render.raster import Ball, Camera, Ground, capsule, shadow, stamps
from motionary.motion import Motion, heading

_PATH = np.array([226, 164, 58], np.float32)
_STEP = 0.02  # metres between the stamps of the path
_SUN = np.array([0.28, 0.0, 0.12])  # how far a shadow falls aside, per metre of height
_LONGEST = 20_000  # frames


class Scene:
    """One motion under one camera, drawn frame by frame."""

    def __init__(self, motion: Motion, width: int, height: int, azimuth: float | None = None, ground: bool = True):
        """
        Args:
            motion: what to draw; its lowest point stands on the floor.
            width, height: pixels.
            azimuth: radians, from where the camera looks (0: from +z); None: from half right of the first heading.
            ground: draw grid and path.

        Raises:
            InputError: more than 20,000 frames, or a size that cannot be drawn.
        """
        if motion.frames > _LONGEST:
            raise InputError("motion", f"{motion.frames} frames", f"at most {_LONGEST} can be drawn")
        if not (16 <= width <= 8192 and 16 <= height <= 8192):
            raise InputError("size", f"{width}x{height}", "width and height must be 16 to 8192 pixels")
        self.fps, self.frames, self.skeleton = motion.fps, motion.frames, motion.skeleton
        begins, ends, self.radii, self.sides = segments(motion.skeleton, motion.positions.astype(np.float64))
        if not len(self.radii):
            raise InputError("skeleton", motion.skeleton.name, "has no bones to draw")
        thick = np.minimum(begins[..., 1] - self.radii[:, 0], ends[..., 1] - self.radii[:, 1])
        self.down = np.array([0, float(np.percentile(thick.min(-1), 2)), 0])
        self.begins, self.ends = begins - self.down, ends - self.down
        root = motion.positions[:, 0].astype(np.float64) * [1, 0, 1]
        self.target = _smooth(root, motion.fps * 0.4)
        points = np.concatenate([self.begins, self.ends], 1)
        top = float(np.percentile(points[..., 1].max(1), 99)) + float(self.radii.max())
        wide = float(np.percentile(np.hypot(*(points - self.target[:, None])[..., [0, 2]].T).max(0), 99))
        self.target[:, 1] = top * 0.47
        camera = Camera(width, height, azimuth=azimuth_of(motion) if azimuth is None else azimuth)
        distance = camera.focal * max(top * 1.32, 2.3 * wide * height / width, 0.3)
        self.camera = replace(camera, distance=distance)
        self.ground = Ground(self.camera, top * 0.47, lines=ground)
        self._nearest = np.empty((height, width), np.float32)
        self.path, self.when = _trail(root, _STEP * max(distance / 4, 0.1)) if ground else (root[:0], np.zeros(0))

    def draw(self, seconds: float, out: np.ndarray | None = None) -> np.ndarray:
        """The picture (H, W, 3) float32 of a moment; before the start and after the end the figure stands still.

        `out`, an earlier picture of this scene, is painted over and returned where it is given.
        """
        at = float(np.clip(seconds * self.fps, 0, self.frames - 1))
        low = int(at)
        high, share = min(low + 1, self.frames - 1), at - low
        begins, ends, target = (
            values[low] * (1 - share) + values[high] * share for values in (self.begins, self.ends, self.target)
        )
        image = self.ground.draw(target, out)
        self._trace(image, target, at)
        self._shadow(image, target, begins, ends)
        a, scale_a = self.camera.project(begins, target)
        b, scale_b = self.camera.project(ends, target)
        depths = (np.stack([begins, ends]) - self.camera.eye(target)) @ self.camera.axes[2]
        nearest = self._nearest
        nearest.fill(np.inf)
        for i in np.argsort(-depths.mean(0) + self.radii.max(-1), kind="stable"):  # far ones first: smooth outlines
            if scale_a[i] and scale_b[i]:
                (ra, rb), (da, db) = self.radii[i], depths[:, i]
                begin, end = Ball(a[i], ra * scale_a[i], da, ra), Ball(b[i], rb * scale_b[i], db, rb)
                capsule(image, nearest, begin, end, COLORS[self.sides[i]])
        return image

    def _trace(self, image: np.ndarray, target: np.ndarray, at: float) -> None:
        if not len(self.path):
            return
        points, scale = self.camera.project(self.path, target)
        seen = (scale > 0) & (np.abs(points - [self.camera.width / 2, self.camera.height / 2]).max(-1) < 5000)
        past = np.where(self.when <= at, 0.95, 0.28)[seen]
        stamps(image, points[seen], 0.014 * scale[seen], _PATH, past)

    def _shadow(self, image: np.ndarray, target: np.ndarray, begins: np.ndarray, ends: np.ndarray) -> None:
        a, scale = self.camera.project(begins * [1, 0, 1] + begins[:, 1:2] * _SUN, target)
        b, scale_b = self.camera.project(ends * [1, 0, 1] + ends[:, 1:2] * _SUN, target)
        seen = (scale > 0) & (scale_b > 0)
        if seen.any():
            shadow(image, a[seen], b[seen], (self.radii.mean(-1) * scale)[seen])


def azimuth_of(motion: Motion) -> float:
    """An azimuth half from the front, half from the side of where the figure first faces."""
    known = len({*motion.skeleton.hips, *motion.skeleton.shoulders}) == 4
    return (float(heading(motion)[0]) if known else 0.0) + 0.6


def _smooth(values: np.ndarray, sigma: float) -> np.ndarray:
    """A Gaussian mean over time of (T, 3), its ends held."""
    reach = min(int(3 * sigma), 3 * len(values))
    if reach < 1:
        return values.copy()
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    padded = np.pad(values, ((reach, reach), (0, 0)), mode="edge")
    return np.stack([np.convolve(column, kernel / kernel.sum(), mode="valid") for column in padded.T], -1)


def _trail(root: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Evenly spaced points on a path (T, 3), at most 2,000, and the frame at which each is passed."""
    run = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(root, axis=0), axis=-1))])
    if run[-1] < 0.25:  # a figure that stays has no path to show
        return root[:0], np.zeros(0)
    at = np.linspace(0, run[-1], min(int(run[-1] / step) + 2, 2000))
    frames = np.interp(at, run, np.arange(len(root)))
    return np.stack([np.interp(frames, np.arange(len(root)), root[:, i]) for i in range(3)], -1), frames
