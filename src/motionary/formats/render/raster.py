"""A small anti-aliased rasteriser on numpy arrays: a perspective camera, a ground, shaded capsules, stamped lines.

Drawing frames directly is some hundred times faster than a plotting library, which matters for video.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

LIGHT = np.array([-0.45, -0.7, 0.56], np.float32)  # x right, y down, z towards the eye
SKY_TOP, SKY = np.array([226, 232, 240], np.float32), np.array([248, 249, 251], np.float32)
GROUND, LINE = np.array([238, 240, 244], np.float32), np.array([214, 219, 227], np.float32)
SHADOW = np.array([92, 102, 122], np.float32)


@dataclass(frozen=True)
class Camera:
    """A perspective camera that keeps its direction; only its target moves.

    Attributes:
        width, height: pixels.
        azimuth: radians about y, from +z towards +x, of the side from which it looks.
        elevation: radians above the horizon.
        distance: metres from the target.
        focal: in image heights.
    """

    width: int
    height: int
    azimuth: float = 0.6
    elevation: float = 0.25
    distance: float = 4.0
    focal: float = 1.6

    @cached_property
    def axes(self) -> np.ndarray:
        """(3, 3): rows right, down, forward in world coordinates."""
        ce, se, ca, sa = np.cos(self.elevation), np.sin(self.elevation), np.cos(self.azimuth), np.sin(self.azimuth)
        forward = -np.array([ce * sa, se, ce * ca])
        right = np.array([ca, 0.0, -sa])
        return np.stack([right, np.cross(forward, right), forward])

    def eye(self, target: np.ndarray) -> np.ndarray:
        """Where the camera stands (..., 3) when it looks at `target` (..., 3)."""
        return np.asarray(target) - self.distance * self.axes[2]

    def project(self, points: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixel positions (..., 2) and pixels per metre (...), of world points (..., 3); behind the eye: scale 0."""
        local = (points - self.eye(target)) @ self.axes.T
        depth = np.maximum(local[..., 2], 1e-3)
        scale = self.focal * self.height / depth
        centre = np.array([self.width / 2, self.height / 2])
        return centre + local[..., :2] * scale[..., None], np.where(local[..., 2] > 0.05, scale, 0.0)


class Ground:
    """The floor y = 0 under a camera of fixed direction: rays are computed once, each frame only moves the grid."""

    def __init__(self, camera: Camera, height: float, lines: bool = True):
        """`height`: of the target above the floor, metres; `lines`: draw the grid."""
        axes, focal = camera.axes, camera.focal * camera.height
        x = (np.arange(camera.width) + 0.5 - camera.width / 2) / focal
        y = (np.arange(camera.height) + 0.5 - camera.height / 2) / focal
        down = axes[1, 1] * y + axes[2, 1]  # the world y of each row's ray: right has none
        eye = camera.eye(np.array([0.0, height, 0.0]))
        first = int(np.argmax(down < -0.02)) if (down < -0.02).any() else camera.height
        self.first, self.lines = first, lines
        ray = axes[1] * y[first:, None] + axes[2]  # (rows, 3)
        reach = (-eye[1] / ray[:, 1])[:, None]
        self.x = (eye[0] + reach * (ray[:, :1] + axes[0, 0] * x)).astype(np.float32)
        self.z = (eye[2] + reach * (ray[:, 2:] + axes[0, 2] * x)).astype(np.float32)
        # Lines are smoothed by the width of a pixel on the floor, and fade out towards the horizon.
        footprint = (reach / focal / np.maximum(-ray[:, 1:2], 0.05) * 0.45).astype(np.float32)
        fade = np.clip(1.35 - np.hypot(self.x, self.z) / camera.distance * 0.62, 0, 1) ** 1.5
        self.kinds = [_Lines(0.5, 0.006, footprint, fade), _Lines(2.0, 0.011, footprint, fade * 2)]
        rows = np.linspace(0, 2, camera.height, dtype=np.float32).clip(0, 1)[:, None, None]
        # Pictures are (H, W, 3) in shape, but in memory each colour lies by itself: numpy then works along rows of
        # pixels and not along three colours, which takes half the time.
        self.base = np.moveaxis(np.empty((3, camera.height, camera.width), np.float32), 0, -1)
        self.base[:] = SKY_TOP + (SKY - SKY_TOP) * rows
        self.base[first:] += (GROUND - self.base[first:]) * fade[..., None]
        self.darker = LINE - self.base[first:]
        self._scratch = tuple(np.empty(self.x.shape, np.float32) for _ in range(4))

    def draw(self, target: np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
        """A picture (H, W, 3) float32 of the floor, when the camera's target is over (x, z) of `target`.

        It is a new one, or `out` (an earlier one) painted over, which spares fetching megabytes for every frame.
        """
        image = self.base.copy(order="K") if out is None else out
        np.copyto(image, self.base)
        if not self.lines or self.first >= len(self.base):
            return image
        x, z, mask, more = self._scratch
        np.add(self.x, np.float32(target[0] % 4), out=x)
        np.add(self.z, np.float32(target[2] % 4), out=z)
        for kind, cover in zip(self.kinds, (mask, more), strict=True):
            kind.cover(x, z, cover)
        np.maximum(mask, more, out=mask)
        for channel in range(3):
            image[self.first :, :, channel] += np.multiply(self.darker[..., channel], mask, out=more)
        return image


class _Lines:
    """Two families of parallel lines on the floor, `every` so many metres: how much of each pixel they cover."""

    def __init__(self, every: float, half: float, footprint: np.ndarray, strength: np.ndarray):
        slope = 1 / (2 * footprint)
        strength = strength * np.minimum(1, 2 * half / footprint)
        self.frequency = np.float32(1 / every)
        # A pixel is covered by clip(edge - slope * away, 0, 1) * strength, all three of which are known beforehand.
        self.slope = (-every * slope * strength).astype(np.float32)
        self.edge = ((half + footprint) * slope * strength).astype(np.float32)
        self.strength = strength.astype(np.float32)
        self.other, self.whole = np.empty_like(self.strength), np.empty_like(self.strength)

    def cover(self, x: np.ndarray, z: np.ndarray, out: np.ndarray) -> None:
        """Of lines along both axes: the nearer one counts, since both have the same width."""
        self._away(x, out)
        np.minimum(out, self._away(z, self.other), out=out)
        out *= self.slope
        out += self.edge
        np.maximum(out, 0, out=out)
        np.minimum(out, self.strength, out=out)

    def _away(self, at: np.ndarray, out: np.ndarray) -> np.ndarray:
        """Distance from the nearest line, in spacings."""
        np.multiply(at, self.frequency, out=out)
        out -= np.rint(out, out=self.whole)
        return np.abs(out, out=out)


def _box(low: np.ndarray, high: np.ndarray, shape: tuple[int, ...]) -> tuple[int, int, int, int] | None:
    x0, y0 = np.maximum(np.floor(low), 0).astype(int)
    x1, y1 = np.minimum(np.ceil(high) + 1, (shape[1], shape[0])).astype(int)
    return (x0, y0, x1, y1) if x1 > x0 and y1 > y0 else None


def _nearest(box: tuple[int, int, int, int], a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, ...]:
    """For each pixel in the box: the vector from the nearest point on a-b, and where on it (0..1) that point lies."""
    x0, y0, x1, y1 = box
    px = np.arange(x0, x1, dtype=np.float32)[None, :] + np.float32(0.5 - a[0])
    py = np.arange(y0, y1, dtype=np.float32)[:, None] + np.float32(0.5 - a[1])
    dx, dy = np.float32(b[0] - a[0]), np.float32(b[1] - a[1])
    length = max(float(dx * dx + dy * dy), 1e-6)
    along = np.clip((px * dx + py * dy) / np.float32(length), 0, 1)
    return px - along * dx, py - along * dy, along


@dataclass(frozen=True)
class Ball:
    """An end of a capsule: pixel, radius in pixels, and depth and radius in metres."""

    at: np.ndarray
    radius: float
    depth: float
    thick: float


def capsule(image: np.ndarray, nearest: np.ndarray, a: Ball, b: Ball, color: np.ndarray) -> None:
    """Draw a shaded, tapering capsule onto (H, W, 3) float32 where it is nearer than `nearest` (H, W) metres."""
    reach = max(a.radius, b.radius) + 1.5
    box = _box(np.minimum(a.at, b.at) - reach, np.maximum(a.at, b.at) + reach, image.shape)
    if box is None:
        return
    nx, ny, along = _nearest(box, a.at, b.at)
    radius = along * np.float32(b.radius - a.radius)
    radius += np.float32(a.radius)
    cover = np.clip(radius + np.float32(0.5) - np.sqrt(nx * nx + ny * ny), 0, 1)
    inverse = 1 / np.maximum(radius, np.float32(0.5))
    nx *= inverse
    ny *= inverse
    nz = np.sqrt(np.maximum(1 - nx * nx - ny * ny, 0))
    depth = along * np.float32(b.depth - a.depth)
    depth += np.float32(a.depth)
    depth -= nz * (along * np.float32(b.thick - a.thick) + np.float32(a.thick))
    region, before = image[box[1] : box[3], box[0] : box[2]], nearest[box[1] : box[3], box[0] : box[2]]
    cover *= depth < before
    np.copyto(before, depth, where=cover > 0.5)
    nx *= LIGHT[0]
    ny *= LIGHT[1]
    nz *= LIGHT[2]
    lit = 0.62 + 0.5 * np.maximum(nx + ny + nz, 0)
    for channel in range(3):
        plane = region[..., channel]
        plane += (np.minimum(lit * color[channel], 255) - plane) * cover


def shadow(image: np.ndarray, a: np.ndarray, b: np.ndarray, radii: np.ndarray, strength: float = 0.3) -> None:
    """Darken the picture once under soft capsules a-b (N, 2) with radii (N,) in pixels, flattened on the floor.

    The mask is made at half the resolution: it is soft anyway.
    """
    a, b, reach = a / 2, b / 2, radii * 0.8
    shape = (image.shape[0] // 2, image.shape[1] // 2)
    box = _box((np.minimum(a, b) - reach[:, None]).min(0), (np.maximum(a, b) + reach[:, None]).max(0), shape)
    if box is None:
        return
    mask = np.zeros((box[3] - box[1], box[2] - box[0]), np.float32)
    for start, stop, far in zip(a, b, reach, strict=True):
        part = _box(np.minimum(start, stop) - far, np.maximum(start, stop) + far, shape)
        if part is None:
            continue
        nx, ny, _ = _nearest(part, start, stop)
        soft = 1.5 - np.sqrt(nx * nx + 2.5 * ny * ny) * np.float32(1.6 / max(far, 1e-3))
        view = mask[part[1] - box[1] : part[3] - box[1], part[0] - box[0] : part[2] - box[0]]
        np.maximum(view, soft, out=view)
    mask = np.minimum(mask, 1).repeat(2, 0).repeat(2, 1) * np.float32(strength)
    region = image[2 * box[1] : 2 * box[3], 2 * box[0] : 2 * box[2]]
    region += (SHADOW - region) * mask[..., None]


def stamps(image: np.ndarray, points: np.ndarray, radii: np.ndarray, color: np.ndarray, strength: np.ndarray) -> None:
    """Draw many small discs at pixels (N, 2) at once, merged by the largest cover: dense ones make a smooth line.

    Args:
        radii: (N,) in pixels, at most 8.
        strength: (N,) 0..1.
    """
    height, width = image.shape[:2]
    radii = np.minimum(radii, 8.0)
    flats, covers = [], []
    for low, high in ((0.0, 1.5), (1.5, 3.5), (3.5, 8.01)):  # small discs need not look at many pixels
        some = (radii >= low) & (radii < high)
        if not some.any():
            continue
        steps = np.arange(-int(high + 1), int(high + 1) + 1)
        at, corner = points[some].astype(np.float32), np.floor(points[some]).astype(np.int64)
        x, y = corner[:, 0, None] + steps, corner[:, 1, None] + steps
        dx = x.astype(np.float32) + np.float32(0.5) - at[:, :1]
        dy = y.astype(np.float32) + np.float32(0.5) - at[:, 1:]
        distance = np.sqrt((dx * dx)[:, None, :] + (dy * dy)[:, :, None])
        cover = np.clip(radii[some].astype(np.float32)[:, None, None] + np.float32(0.5) - distance, 0, 1)
        cover *= strength[some].astype(np.float32)[:, None, None]
        inside = ((x >= 0) & (x < width))[:, None, :] & ((y >= 0) & (y < height))[:, :, None] & (cover > 0)
        flats.append((y[:, :, None] * width + x[:, None, :])[inside])
        covers.append(cover[inside])
    if not flats or not (flat := np.concatenate(flats)).size:
        return
    mask = np.zeros(height * width, np.float32)
    np.maximum.at(mask, flat, np.concatenate(covers))
    flat = np.flatnonzero(mask)
    y, x = np.divmod(flat, width)
    original = image[y, x]
    image[y, x] = original + (color - original) * mask[flat, None]
